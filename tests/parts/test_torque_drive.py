"""A fence that a torque drives: closed forms, and an impact against the independent version."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from reference.impact_parts import Impact
from reference.impact_torque import solve

import fencejax as fj

NUMBERS = {"torques": [400.0, 900.0], "inertia": 4.0, "damping": 30.0, "stiffness": 200.0}
CYCLE, HORIZON = 0.8, 0.07
# The modes of the independent version, and no more, in its small-deflection geometry.
FIDELITY = fj.Fidelity(
    step=2.5e-4, step_tolerance=None, modes=3, static_correction=False, geometry="small"
)
INDEPENDENT = Impact(
    modes=3, horizon=HORIZON, load="cubic", geometry="small", mu_belt=(0.0, 0.0),
    mu_fence=(0.0, 0.0),
)  # fmt: skip


def scene(drive):
    return fj.scenes.oblique_impact(
        drive=drive, belt=None, velocity=(2.0, 0.0, 0.0), fence_friction=None, duration=HORIZON,
    )  # fmt: skip


@jax.jit
def struck(numbers):
    """Slopes of the peak force in the drive's numbers, and the result."""

    def run(numbers):
        drive = fj.TorqueDrive(cycle_time=CYCLE, turn=1.0, **numbers)
        result = fj.simulate(
            scene(drive), fidelity=FIDELITY, only=["peak_force", "peak_torque", "energy", "history"]
        )
        return result.peak_force, result

    return jax.grad(run, has_aux=True)(numbers)


def run(**changes):
    return struck({k: jnp.asarray(v) for k, v in {**NUMBERS, **changes}.items()})


def independent(**changes):
    numbers = {**NUMBERS, **changes}
    first, last = numbers.pop("torques")
    return solve(INDEPENDENT, lambda t: first + (last - first) * t / CYCLE, **numbers)


def test_impact_against_the_independent_version():
    # The step is of the second order: 2e-4 of the peak at a quarter of a millisecond.
    slopes, result = run()
    peak, work = independent()
    assert float(result.peak_force) == pytest.approx(peak, rel=3e-4)
    assert float(result.energy.drive_work) == pytest.approx(work, rel=1e-3)
    exchanged = sum(abs(float(term)) for term in jax.tree.leaves(result.energy))
    assert abs(float(result.energy.residual)) < 1e-4 * exchanged
    assert float(result.energy.damping_loss) > 1.0
    # The torque at the end, which is the largest; and the hinge's own motion, with its rates.
    drive = result.history.drive
    assert float(result.peak_torque) == pytest.approx(float(drive.torque[-1]), rel=1e-12)
    step, mean = np.diff(result.history.time), 0.5 * (drive.speed[1:] + drive.speed[:-1])
    np.testing.assert_allclose(np.diff(drive.angle), step * mean, atol=1e-6)
    found = {**slopes, "torques": slopes["torques"][0]}
    for name in ("torques", "inertia"):
        value = NUMBERS["torques"][0] if name == "torques" else NUMBERS[name]
        ends = [share * value for share in (0.98, 1.02)]
        if name == "torques":
            ends = [[end, NUMBERS["torques"][1]] for end in ends]
        low, high = (independent(**{name: end})[0] for end in ends)
        assert float(found[name]) == pytest.approx((high - low) / (0.04 * value), rel=1e-2), name


def test_a_heavy_drive_is_a_given_motion():
    # alpha'' of a spline's first span rises straight; a torque that does the same to an inertia
    # that no blow moves is the same motion.
    inertia, span, control = 1e12, 0.5, 3.0
    torques = [0.0, inertia * control * CYCLE / span**3]
    _, found = run(torques=torques, inertia=inertia)
    given = fj.simulate(
        scene(fj.SplineDrive([control], 4 * span)), fidelity=FIDELITY, only=["peak_force"]
    )
    assert float(found.peak_force) == pytest.approx(float(given.peak_force), rel=1e-9)


@jax.jit
def unloaded(drive, time, inertia):
    """The angle at a time, and the time at that angle."""
    angle = drive.unloaded(time, inertia).angle
    return angle, drive.time_at(angle, inertia)


@functools.partial(jax.jit, static_argnums=1)
def swung(numbers, time):
    """The angle of a rigid fence that a torque of 300 N m has swung, and its slopes in damping and
    stiffness."""

    def last(numbers):
        drive = fj.TorqueDrive([300.0], inertia=2.0, damping=numbers[0], stiffness=numbers[1])
        result = fj.simulate(
            fj.scenes.free_motion(fence=fj.Fence(), drive=drive, duration=time),
            fidelity=fj.Fidelity(modes=0, static_correction=False), only=["history"],
        )  # fmt: skip
        angle = result.history.drive.angle[-1]
        return angle, angle

    slopes, angle = jax.jacfwd(last, has_aux=True)(numbers)
    return angle, slopes


def test_closed_forms():
    # phi = T t^2 / (2 J) of a rigid fence, also with its first contact; T / c (t - J / c (1 -
    # exp(-c t / J))) with damping, and (1 - cos(w t)) T / k on a spring.
    fence, time = fj.Fence(), 0.21
    inertia = float(fence.inertia) + 2.0
    for numbers, exact in (
        ({}, 300 * time**2 / (2 * inertia)),
        ({"damping": 90.0}, 300 / 90 * (time - inertia / 90 * (1 - np.exp(-90 * time / inertia)))),
        ({"stiffness": 500.0}, 0.6 * (1 - np.cos(np.sqrt(500 / inertia) * time))),
    ):
        drive = fj.TorqueDrive([300.0], inertia=2.0, **numbers)
        angle, found = unloaded(drive, time, fence.inertia)
        # Runge's and Kutta's method in 64 steps: (c h / J)^4 / 120 = 2e-7 at most.
        assert float(angle) == pytest.approx(exact, rel=2e-7)
        assert float(found) == pytest.approx(time, rel=1e-9)
    # The simulation's own: exact but in the damping, of the second order there; and its slopes
    # where neither is, -T t^3 / (6 J^2) in the damping, -T t^4 / (24 J^2) in the stiffness.
    drive = fj.TorqueDrive([300.0], inertia=2.0, damping=90.0, stiffness=500.0)
    exact, _ = unloaded(drive, time, fence.inertia)
    angle, _ = swung(jnp.array([90.0, 500.0]), time)
    assert float(angle) == pytest.approx(float(exact), rel=1e-5)
    angle, slopes = swung(jnp.zeros(2), time)
    assert float(angle) == pytest.approx(300 * time**2 / (2 * inertia), rel=1e-12)
    expected = [-300 * time**3 / (6 * inertia**2), -300 * time**4 / (24 * inertia**2)]
    np.testing.assert_allclose(slopes, expected, rtol=1e-5)


def test_a_cylinder_fills_and_empties():
    drive = fj.PneumaticDrive(open_time=0.3)
    times = jnp.linspace(0.0, 0.8, 801)
    torque = jax.vmap(drive.torque)(times)
    rate = jax.vmap(jax.grad(lambda t: drive.torque(t)))(times)
    supply = jnp.where(times < 0.3, drive.largest, 0.0)
    off = jnp.abs(drive.fill_time * rate + torque - supply)
    assert float(jnp.max(jnp.where(jnp.abs(times - 0.3) < 1e-6, 0.0, off))) < 1e-12 * 120
    assert float(drive.largest) == pytest.approx(6e5 * 2e-3 * 0.1, rel=1e-12)


def test_it_is_described_named_and_refused():
    sorter = fj.Sorter(drive={"law": "torque", "torques": [50.0, 0.0, -50.0], "inertia": 4.0})
    assert float(sorter.drive.inertia) == 4.0
    sort = sorter.replace(free={"fence.thickness": (0.02, 0.06)}).scene()
    assert fj.scene_numbers.number(sort, "torques[1]").unit == "N m"
    cylinder = fj.Sorter(drive={"law": "pneumatic", "pressure": "5 bar"})
    assert float(cylinder.drive.pressure) == pytest.approx(5e5)
    with pytest.raises(ValueError, match="`shaft` of the fence must be None on a TorqueDrive"):
        fj.scenes.whole_sort(fence=fj.Fence(shaft=fj.Shaft()), drive=fj.TorqueDrive([1.0]))
    with pytest.raises(ValueError, match="`drive_angle` must be at most"):
        scene(fj.TorqueDrive([1.0], inertia=100.0))
    with pytest.raises(TypeError, match="whose angle is a state"):
        fj.TorqueDrive([1.0]).angle(jnp.asarray(0.1))
