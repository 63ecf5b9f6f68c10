"""The results of a simulation and their printed form."""

import functools
import itertools

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from runs import FIXED, SCENES, fixed

import fencejax as fj
from fencejax.results import MEASURES

FAST = fj.Fidelity.fast()
# The cheapest programs, with a bending fence and a rigid one, where the numbers matter less.
PLAIN = fj.Fidelity.fast(modes=1, static_correction=False, geometry="small")
RIGID = fj.Fidelity.fast(modes=0, geometry="small")


@pytest.mark.parametrize("name", SCENES)
def test_every_field_is_a_finite_number(name):
    result = fixed(name)
    touched = name not in ("free_motion", "free_motion_with_fence")
    for path, leaf in jax.tree_util.tree_leaves_with_path(result):
        where = jax.tree_util.keystr(path)
        name = where.replace(".measures['", "").replace("']", "")
        if where == ".gradient_error":
            # Nothing is differentiated here.
            assert np.isinf(leaf)
        elif MEASURES.get(name, MEASURES["impulse"]).sign == "NaN if none" and not touched:
            assert np.isnan(leaf)
        else:
            assert np.all(np.isfinite(leaf)), where
    for field in ("peak_force", "impulse", "contact_time", "deepest"):
        assert (getattr(result, field) > 0) == touched, field
    assert int(result.status) <= fj.Status.LEFT_OVER_TIP


@pytest.mark.parametrize("name", SCENES)
def test_history_runs_from_start_to_end(name):
    result, scene = fixed(name), SCENES[name]()
    history = result.history
    step = FIXED.step
    count = history.time.size
    strides = np.diff(history.time) / step
    if name == "whole_sort":
        # Strides are powers of two of a step, up to 2 ms.
        assert {round(x) for x in strides} == {1, 2, 4, 8}
    else:
        assert count == round(scene.duration / step) + 1
    np.testing.assert_allclose(strides, np.round(strides), rtol=1e-8)
    for path, leaf in jax.tree_util.tree_leaves_with_path(history):
        assert leaf.shape[0] == count, jax.tree_util.keystr(path)
    assert history.time[0] == 0
    assert history.time[-1] == pytest.approx(scene.duration, rel=1e-12)
    assert [float(q[-1]) for q in history.body] == [float(q) for q in result.final]
    # Peaks lie at the highest sample or, by the parabola, above it.
    highest = np.max(history.fence_force)
    assert highest <= result.peak_force <= highest * 1.01
    assert np.max(np.abs(history.tip_deflection)) <= result.tip_deflection
    assert np.max(history.body.y) == result.furthest_y


@functools.cache
def walls():
    speeds = jnp.array([0.5, 1.0, -1.0])
    run = jax.vmap(lambda v: fj.simulate(fj.scenes.rigid_wall(speed=v), history=False))
    return jax.jit(run)(speeds)


def test_prints_itself():
    result = fixed("rigid_wall")
    text = str(result)
    assert f"peak force  {float(result.peak_force):.2f} N" in text
    assert f"status  {fj.Status.SUCCESSFUL.text}" in text
    for unit in ("N s", "ms", " m", "mm", "MPa", "N m", "J"):
        assert unit in text
    # A batch: how many lanes, how they came out, the range of the force.
    text = str(walls())
    low, high = float(walls().peak_force.min()), float(walls().peak_force.max())
    assert "(3,)" in text
    assert "SUCCESSFUL 2" in text
    assert "NEVER_TOUCHED 1" in text
    assert f"{low:.4g} ... {high:.4g} N" in text
    # Inside a transformation there are no numbers yet.
    texts = []

    @eqx.filter_jit
    def traced(speed):
        result = fj.simulate(fj.scenes.rigid_wall(speed=speed), history=False)
        texts.append(str(result))
        return result.peak_force

    traced(jnp.asarray(1.0))
    assert texts == ["Result(traced)"]


DRIVES = {
    "harmonic": lambda: fj.HarmonicDrive(),
    "held": lambda: fj.HeldDrive(0.3),
    "constant speed": lambda: fj.ConstantSpeedDrive(),
    "trapezoid": lambda: fj.TrapezoidDrive(),
    "S-curve": lambda: fj.SCurveDrive(),
    "spline": lambda: fj.SplineDrive(jnp.array([0.1, 0.4, 0.7, 0.7, 0.4, 0.1])),
}


def test_every_drive_is_here():
    drives = {type(make()) for make in DRIVES.values()}
    exported = {
        value for value in (getattr(fj, name) for name in fj.__all__)
        if isinstance(value, type) and issubclass(value, fj.AbstractDrive)
    }
    # What a torque drives has no law of the angle: `test_torque_drive.py`.
    given = {drive for drive in exported if not issubclass(drive, fj.AbstractTorqueDrive)}
    assert drives == given - {fj.AbstractDrive}


@pytest.mark.parametrize("name", DRIVES)
def test_drives_are_interchangeable(name):
    drive = DRIVES[name]()
    scene = fj.scenes.oblique_impact(drive=drive, duration=0.05)
    only = "peak_force", "start_time", "history"
    result = fj.simulate(scene, fidelity=RIGID, only=only)
    start = drive.motion(result.start_time)
    # The corner touches at 0.3 rad on the way out, and the fence goes on by the law.
    assert float(start.angle) == pytest.approx(0.3, abs=1e-9)
    motion = jax.vmap(drive.motion)(result.start_time + result.history.time)
    np.testing.assert_allclose(result.history.drive.angle, motion.angle, atol=1e-12)
    np.testing.assert_allclose(result.history.drive.speed, motion.speed, atol=1e-9)
    # The force stays below that of a rigid wall, which goes with the speed to the power 1.6, at
    # the largest normal speed v sin alpha + sigma alphadot that fence and belt make between them
    # while it lasts, and what the belt adds, a load put on at once: twice mu_1s m g = 125 N.
    (c,) = result.history.fence
    approach = np.max(2 * np.sin(motion.angle) + c.place * motion.speed)
    ceiling = 3293.85 * (approach / 2.426) ** 1.6 + 2 * 125
    assert 0.6 * ceiling < float(result.peak_force) < ceiling
    assert int(result.status) <= fj.Status.IN_CONTACT_AT_END


ORDINARY = {
    "thickness": 0.045, "distance": 1.0, "stiffness": 1.72e9, "damping": 3.3e5, "mass": 15.0,
    "across": 0.0, "length": 0.4, "breadth": 0.3,
}
LANES = {
    "ordinary": ({}, fj.Status.SUCCESSFUL),
    "moves away": ({"across": 3.0}, fj.Status.NEVER_TOUCHED),
    "heavy": ({"mass": 40.0}, fj.Status.IN_CONTACT_AT_END),
    # Over the tip, and at once: the force ends within a few steps.
    "near the tip": ({"distance": 1.16}, fj.Status.PEAK_AT_TIP),
    # A large parcel, so that what is half its side is not what is exceeded.
    "thin": (
        {"thickness": 0.02, "length": 1.2, "breadth": 1.2, "mass": 30.0},
        fj.Status.MODES_TOO_FEW,
    ),
    # So soft that it yields by more than half its breadth.
    "soft parcel": ({"stiffness": 1e3, "damping": 1e3}, fj.Status.DEEP_PENETRATION),
    "not a number": ({"thickness": np.nan}, fj.Status.NON_FINITE),
}


@functools.cache
def statuses():
    @jax.jit
    @jax.vmap
    def run(x):
        scene = fj.scenes.oblique_impact(
            fence=fj.Fence(thickness=x["thickness"]),
            distance=x["distance"],
            parcel=fj.Parcel(
                mass=x["mass"], length=x["length"], breadth=x["breadth"],
                stiffness=x["stiffness"], damping=x["damping"],
            ),
            velocity=(jnp.asarray(2.0), x["across"], jnp.asarray(0.0)),
            duration=0.14,
        )
        return fj.simulate(scene, fidelity=FAST, history=False)

    rows = [ORDINARY | changes for changes, _ in LANES.values()]
    return run({k: jnp.array([row[k] for row in rows]) for k in ORDINARY})


@pytest.mark.parametrize("name", LANES)
def test_statuses(name):
    status = int(statuses().status[list(LANES).index(name)])
    assert fj.Status(status) == LANES[name][1]
    assert np.isnan(statuses().tip_deflection[list(LANES).index("not a number")])


def test_too_coarse_a_step_is_said():
    # Two iterations are not enough for a step of a fifth of the contact.
    scene, coarse = fj.scenes.rigid_wall(), fj.Fidelity.fast(
        step=1e-2, step_tolerance=None, iterations=1
    )
    result = fj.simulate(scene, fidelity=coarse, history=False)
    assert int(result.status) == fj.Status.STEP_TOO_COARSE
    assert float(result.defect) > 1e-3 * float(result.peak_force)
    with pytest.raises(RuntimeError, match="STEP_TOO_COARSE: the steps are too long"):
        fj.simulate(scene, fidelity=coarse, history=False, throw=True)
    # With enough iterations the equations are solved, and the step is as coarse as before.
    enough = fj.simulate(scene, fidelity=coarse.replace(iterations=12), history=False)
    assert float(enough.defect) < 1e-6 * float(enough.peak_force)
    assert int(enough.status) == fj.Status.STEP_TOO_COARSE
    fine = fj.simulate(scene, fidelity=fj.Fidelity.fast(), history=False)
    assert int(fine.status) == fj.Status.SUCCESSFUL


def test_throw():
    # Up to LEFT_OVER_TIP the numbers are good: nothing is raised.
    away = fj.scenes.rigid_wall(speed=-1.0)
    result = fj.simulate(away, history=False, throw=True)
    assert int(result.status) == fj.Status.NEVER_TOUCHED
    with pytest.raises(TypeError, match="concrete"):
        jax.jit(lambda v: fj.simulate(fj.scenes.rigid_wall(speed=v), throw=True).impulse)(1.0)


def test_wrong_arguments():
    with pytest.raises(TypeError, match=r"`scene`.*Fence"):
        fj.simulate(fj.Fence())
    with pytest.raises(TypeError, match=r"`fidelity`.*Fidelity.fast\(\)"):
        fj.simulate(fj.scenes.rigid_wall(), fidelity="fast")


def test_status_of_each_lane():
    assert [fj.Status(int(s)).name for s in walls().status] == [
        "SUCCESSFUL", "SUCCESSFUL", "NEVER_TOUCHED",
    ]


@pytest.mark.parametrize(("fence", "peak"), [("two links", 271.0), ("one link", 261.0)])
def test_whole_sort(fence, peak):
    # Figures on record, computed independently: the peak force, and the parcel at y = 0.90 m at
    # the end. Half a unit of the last digit, and what smoothing costs at this fidelity.
    if fence == "two links":
        result = fixed("whole_sort")
    else:
        result = fj.simulate(fj.scenes.whole_sort(fence=fj.Fence.one_link()))
    assert float(result.peak_force) == pytest.approx(peak, rel=0.02)
    assert float(result.final.y) == pytest.approx(0.90, abs=0.02)
    # It leaves the fence beyond the belt, s = 0.7 m, and lies still on the belt's continuation.
    assert float(result.leave_y) > 0.7
    assert float(result.final.x_rate) == pytest.approx(2.0, abs=1e-6)
    assert abs(float(result.final.y_rate)) < 1e-6
    # Smooth and free of impact: the fence takes the parcel along from its first moment on.
    assert float(result.first_contact) < 0.05
    assert int(result.status) in (fj.Status.SUCCESSFUL, fj.Status.LEFT_OVER_TIP)


# A fence of four elements with one mode, friction smooth enough for an explicit method.
SMALL = fj.Fidelity.standard(
    elements=4, modes=1, static_correction=False, geometry="small", step=1e-4, slip_speed=0.02,
    static_speed=0.1,
)
COMPARED = "peak_force", "impulse", "tip_deflection", "furthest_y"


def one_impact(integrator):
    fidelity = SMALL.replace(integrator=integrator)
    return fj.simulate(fj.scenes.oblique_impact(duration=0.07), fidelity=fidelity, only=COMPARED)


@functools.cache
def modal_impact():
    return one_impact("modal")


# By name, and any solver of diffrax as it is.
@pytest.mark.parametrize("integrator", ["kvaerno5", diffrax.Tsit5()], ids=["name", "solver"])
def test_general_integrators_agree(integrator):
    # Both solve the same equations. The modal one's step leaves (h / T)^2 with T = 0.1 s of
    # contact, some 1e-5; the general ones their tolerance, 1e-7. Friction is as smooth as these
    # need it, and all say so.
    ours, theirs = modal_impact(), one_impact(integrator)
    assert int(theirs.status) == int(ours.status) == fj.Status.FRICTION_SMOOTHED
    for field in COMPARED:
        assert float(getattr(ours, field)) == pytest.approx(
            float(getattr(theirs, field)), rel=1e-4
        ), field


class Counting(fj.HarmonicDrive):
    """A drive that counts how often it is evaluated: in tracing alone, never in a run."""

    def angle(self, time):
        next(LOOKED_AT)
        return super().angle(time)


LOOKED_AT = itertools.count()


def test_one_program_serves_all_designs():
    def run(thickness, top_speed, mass, speed):
        scene = fj.scenes.free_motion(
            fence=fj.Fence(thickness=thickness), drive=Counting(top_speed), duration=0.05,
            parcel=fj.Parcel(mass=mass), velocity=(speed, 0.0, 0.0),
        )
        return fj.simulate(scene, fidelity=PLAIN, history=False)

    first = run(0.045, 1.53, 15.0, 1.0)
    before = next(LOOKED_AT)
    assert before > 0
    second = run(jnp.asarray(0.03), 1.2, 4, np.float64(0.7))
    assert next(LOOKED_AT) == before + 1
    assert float(first.peak_torque) != float(second.peak_torque)
    # Another structure is another program.
    fj.simulate(
        fj.scenes.free_motion(fence=fj.Fence(), drive=Counting(), belt=None, duration=0.05),
        fidelity=PLAIN, history=False,
    )
    assert next(LOOKED_AT) > before + 2


def test_an_integrator_is_a_name_or_a_solver_of_diffrax():
    assert fj.Fidelity(integrator=diffrax.Dopri5()) == fj.Fidelity(integrator=diffrax.Dopri5())
    assert fj.Fidelity(integrator=diffrax.Dopri5()) != fj.Fidelity(integrator=diffrax.Tsit5())
    with pytest.raises(TypeError, match="`integrator` must be .* a solver of diffrax, but is 3"):
        fj.Fidelity(integrator=3)


def test_a_general_integrator_is_refused_in_the_normal_direction_alone():
    with pytest.raises(ValueError, match="`fidelity.integrator` must be 'modal'"):
        fj.simulate(fj.scenes.rigid_wall(), fidelity=fj.Fidelity(integrator="tsit5"))


@pytest.mark.parametrize("build", [fj.scenes.oblique_impact, fj.scenes.normal_impact])
def test_single_precision_by_fidelity(build):
    # The numbers given and returned stay double. A step's forces are balanced to 2e-3 at most; the
    # peak is better than that.
    scene = build(duration=0.12)
    double, single = (
        fj.simulate(scene, fidelity=fj.Fidelity.fast(precision=name), only=("peak_force",))
        for name in ("float64", "float32")
    )
    assert single.peak_force.dtype == double.peak_force.dtype
    assert float(single.peak_force) == pytest.approx(float(double.peak_force), rel=2e-3)
    assert float(single.peak_force) != float(double.peak_force)
    assert int(single.status) == int(double.status)


def test_precision_is_checked():
    with pytest.raises(ValueError, match="`precision` must be one of"):
        fj.Fidelity(precision="float16")
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(ValueError, match="`fidelity.precision` is 'float64'"):
            fj.simulate(fj.scenes.rigid_wall(), fidelity=fj.Fidelity(precision="float64"))
    finally:
        jax.config.update("jax_enable_x64", True)


def test_a_whole_sort_needs_no_duration_inside_jit():
    # The default drive's cycle is known beforehand, another one's is not.
    jax.eval_shape(lambda x: fj.scenes.whole_sort(front=x), 0.1)
    with pytest.raises(ValueError, match="`duration` .* must be given"):
        jax.eval_shape(
            lambda t: fj.scenes.whole_sort(drive=fj.HarmonicDrive(cycle_time=t)), 1.0
        )


def test_the_history_of_a_scene_that_a_program_has_built_in():
    scene = fj.scenes.free_motion(fence=fj.Fence(), duration=0.02)

    def history():
        return fj.simulate(scene, fidelity=PLAIN, history=True).history

    inside, outside = (jax.tree.leaves(run()) for run in (jax.jit(history), history))
    for one, other in zip(inside, outside, strict=True):
        # Outside a program the room that is left at the end is cut off.
        np.testing.assert_allclose(one[: len(other)], other, rtol=1e-12, atol=1e-12)


def test_the_derivative_of_a_history_outside_a_program():
    # Closed form: nothing touches it, and the parcel moves on as fast as it was let go.
    def positions(speed):
        scene = fj.scenes.free_motion(
            fence=None, belt=None, velocity=(speed, 0.3, 0.0), duration=0.02
        )
        return fj.simulate(scene, fidelity=PLAIN, history=True).history

    history, slopes = jax.jvp(positions, (1.5,), (1.0,))
    np.testing.assert_allclose(slopes.body.x, history.time, atol=1e-12)
    np.testing.assert_allclose(slopes.body.x_rate, 1.0, atol=1e-12)
    np.testing.assert_allclose(slopes.body.y, 0.0, atol=1e-12)
