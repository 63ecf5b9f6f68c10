"""Sliding that stops and reverses within a few steps: light parcels, grippy fence."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from robustness.extreme_scenes import ORDINARY, impact
from runs import one_by_one

import fencejax as fj

LANES = 64
FINE = dict(step=6.25e-5, slip_speed=2e-4, static_speed=1e-3)


@pytest.fixture(scope="module")
def parcels():
    rng = np.random.default_rng(0)
    return {
        "mass": np.exp(rng.uniform(np.log(0.2), np.log(2.0), LANES)),
        "length": rng.uniform(0.2, 0.5, LANES),
        "breadth": rng.uniform(0.2, 0.4, LANES),
        "grip": rng.uniform(0.25, 0.5, LANES),
        "distance": rng.uniform(0.75, 1.1, LANES),
        "angle": rng.uniform(0.25, 0.5, LANES),
    }


def peaks(parcels, fidelity):
    @jax.jit
    @one_by_one
    def run(x):
        scene = fj.scenes.oblique_impact(
            parcel=fj.Parcel(mass=x["mass"], length=x["length"], breadth=x["breadth"]),
            fence_friction=fj.Friction(kinetic=x["grip"], static=x["grip"] / 0.7),
            distance=x["distance"], drive_angle=x["angle"], duration=0.08,
        )  # fmt: skip
        result = fj.simulate(scene, fidelity=fidelity, only=("peak_force",))
        return result.peak_force, result.status

    return jax.device_get(run(jax.tree.map(jnp.asarray, parcels)))


@pytest.fixture(scope="module")
def fine(parcels):
    return peaks(parcels, fj.Fidelity.standard(**FINE))


# What the rungs promise of ordinary impacts in 95 % of them, and half as much again.
@pytest.mark.parametrize(
    ("rung", "step", "slip_speed", "promise"),
    [
        ("coarse", 1e-3, 1e-3, 2.5e-3),
        ("fast", 5e-4, 5e-4, 1.2e-3),
        ("standard", 2.5e-4, 5e-4, 5e-4),
    ],
)
def test_every_step_finds_its_forces(parcels, fine, rung, step, slip_speed, promise):
    # Friction that falls from static to kinetic bends both ways, and falls faster than the inertia
    # of a light parcel over a step holds against: Newton's own steps go to and fro there, or to a
    # fold of the equations, and leave a tenth of the force unbalanced in 8 to 20 of these lanes.
    fidelity = getattr(fj.Fidelity, rung)(
        modes=4, step=step, step_tolerance=None, slip_speed=slip_speed, static_speed=5 * slip_speed
    )
    found, status = peaks(parcels, fidelity)
    np.testing.assert_array_equal(status, fj.Status.SUCCESSFUL)
    np.testing.assert_array_equal(fine[1], fj.Status.SUCCESSFUL)
    np.testing.assert_allclose(found, fine[0], rtol=promise)


@pytest.mark.parametrize(
    ("rung", "promise"), [("coarse", 5e-3), ("fast", 2.5e-3), ("standard", 1e-3)]
)
def test_steps_that_are_not_solved_are_taken_again(parcels, fine, rung, promise):
    # Friction this sharp: over steps of these lengths Newton's method comes to no end in some of
    # these lanes.
    fidelity = getattr(fj.Fidelity, rung)(modes=4, slip_speed=5e-5, static_speed=2.5e-4)
    if rung != "standard":
        fixed = peaks(parcels, fidelity.replace(step_tolerance=None))[1]
        assert np.any(fixed == fj.Status.STEP_TOO_COARSE)
    found, status = peaks(parcels, fidelity)
    np.testing.assert_array_equal(status, fj.Status.SUCCESSFUL)
    np.testing.assert_allclose(found, fine[0], rtol=promise)


# A heavy parcel that grips a fence bent by a tenth.
HELD = ORDINARY | dict(
    thickness=0.0353, reach=1.497, flexible=0.889, width=0.0971, modulus=1.98e10, density=522.0,
    damping_ratio=0.0107, mass=50.9, length=0.8, aspect=0.766, across=0.2825, along=0.3228,
    stiffness=2.28e9, belt=1.1376, belt_kinetic=0.1167, belt_static=0.1057, kinetic=0.686,
    static=0.466, top_speed=0.583, place=0.9097, angle=0.1184, approach=2.921, ride=1.1376,
)  # fmt: skip


@pytest.mark.parametrize("damping", [2e6, 8e6])
def test_a_fence_that_shortens_does_not_ring_under_a_sticking_corner(damping):
    # The bent fence's points move along it as the force changes, and friction holds the corner to
    # them. Foreseen instead of solved for, that motion lets force and friction grow from step to
    # step of 0.5 ms, up to twice the force with the larger damping of the contact.
    def force(fidelity):
        scene = impact(HELD | {"damping": damping}, 0.1)
        history = fj.simulate(scene, fidelity=fidelity, only=("history",)).history
        return history.time, history.fence[0].normal

    time, found = force(fj.Fidelity.fast())
    fine, wanted = force(fj.Fidelity.standard(step=2.5e-5, step_tolerance=None))
    late = time > 0.05
    np.testing.assert_allclose(found[late], np.interp(time, fine, wanted)[late], rtol=1e-3)


# Static friction of nearly three times the kinetic one, on a fence that swings along itself.
CARRIED = ORDINARY | dict(
    thickness=0.04086, reach=0.9296, flexible=0.6095, width=0.1095, modulus=6.709e9, density=1105.0,
    damping_ratio=0.03326, mass=13.82, length=0.2842, aspect=0.7355, across=-0.492, along=0.2467,
    stiffness=7.666e9, damping=1.866e4, belt=0.7076, belt_kinetic=0.1526, belt_static=0.2776,
    kinetic=0.2004, static=0.5751, top_speed=2.234, place=0.9475, angle=0.2059, approach=3.474,
    ride=0.7076,
)  # fmt: skip


@pytest.mark.parametrize("slip_speed", [5e-4, 5e-5])
def test_a_corner_sticks_until_static_friction_is_overcome(slip_speed):
    # From 13 ms on half of static friction holds it, and all of kinetic friction would not: where
    # it slides is another root of each step's equations. The fence's own motion along itself takes
    # the corner with it by ten times the speed up to which friction holds, from step to step.
    fidelity = fj.Fidelity.standard(slip_speed=slip_speed, static_speed=5 * slip_speed)

    def run(fidelity):
        history = fj.simulate(impact(CARRIED, 0.1), fidelity=fidelity, only=("history",)).history
        return history.time, history.fence[0]

    time, corner = run(fidelity)
    # As long a scene as above, so that the fine steps are those of one program.
    late = (time > 0.013) & (time < 0.04) & (corner.normal > 0)
    share = np.abs(corner.friction / corner.normal)[late]
    assert 1.3 * 0.2004 < np.max(share) < 0.5 * 0.5751
    assert np.max(np.abs(corner.sliding[late])) < slip_speed
    fine, wanted = run(fj.Fidelity.standard(step=2.5e-5, step_tolerance=None))
    # Second order in steps of a fortieth of the blow's 10 ms.
    right = np.interp(time, fine, wanted.normal)[late]
    np.testing.assert_allclose(corner.normal[late], right, rtol=3e-3)
