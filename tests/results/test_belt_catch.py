"""A parcel that the belt stops: for certain, or by its static friction alone."""

import jax.numpy as jnp
import numpy as np
import pytest
from robustness.peaks import peaks

import fencejax as fj
from fencejax.fidelity import Smoothing
from fencejax.results import belt_catch

MASS, STEP, SMOOTHING = 2.0, 1e-3, Smoothing(1e-8, 1e-3)
KINETIC, STATIC, GRAVITY = 0.2, 0.5, 10.0
DRAG, JUMP = KINETIC * MASS * GRAVITY, (STATIC - KINETIC) * MASS * GRAVITY


def unsure(*course, fence_force=50.0):
    """The jump of friction [N] in doubt after samples, each the slip on the belt [w_s] and the
    friction there [N]."""
    scene = fj.scenes.oblique_impact(
        parcel=fj.Parcel(MASS),
        belt=fj.Belt(friction=fj.Friction(KINETIC, STATIC), gravity=GRAVITY),
        distance=0.6,
    )
    one = fj.simulate(scene, fidelity=fj.Fidelity.coarse()).history.at(jnp.zeros(1))
    known = belt_catch.Catch(*[jnp.zeros(())] * 2)
    for (before, _), (now, friction) in zip(course, course[1:], strict=False):
        belt = type(one.belt)(*map(jnp.asarray, (friction, 0.0, 0.0, 0.0)))
        sample = one._replace(belt=belt, fence_force=jnp.asarray(fence_force))
        slips = (jnp.asarray(slip * SMOOTHING.static_speed) for slip in (before, now))
        known = belt_catch.caught(known, *slips, sample, jnp.asarray(STEP), scene, SMOOTHING)
    return float(known.unsure)


SLIDES, PULLED_TO_REST = (20.0, DRAG), (0.1, 1.2 * DRAG)
# Kinetic friction takes 2 w_s off the slip in a step, and by as much less as it is needed.
HELD, HARDLY_HELD, PUSHED = (0.01, 0.4 * DRAG), (0.01, 0.7 * DRAG), (0.01, 1.3 * DRAG)


@pytest.mark.parametrize(
    ("course", "in_doubt"),
    [
        # It needs more than kinetic friction at once, or before that would have stopped w_s.
        ((SLIDES, SLIDES, PULLED_TO_REST, PUSHED), True),
        ((SLIDES, SLIDES, PULLED_TO_REST, HARDLY_HELD, PUSHED), True),
        # As soon as that would have stopped w_s, it is caught for certain.
        ((SLIDES, SLIDES, PULLED_TO_REST, HARDLY_HELD, HARDLY_HELD, PUSHED), False),
        ((SLIDES, SLIDES, PULLED_TO_REST, HELD, PUSHED), False),
        ((SLIDES, SLIDES, PULLED_TO_REST, HELD, HELD, PUSHED), False),
        # Off again, it has to be stopped again.
        ((SLIDES, SLIDES, PULLED_TO_REST, HELD, HELD, SLIDES, PULLED_TO_REST, PUSHED), True),
        # It never slid, or it does not rest.
        ((HELD, HELD, PUSHED), False),
        ((SLIDES, SLIDES, (2.0, 1.5 * DRAG), (2.0, 1.5 * DRAG)), False),
    ],
)
def test_a_parcel_is_caught_for_certain_where_kinetic_friction_stops_it(course, in_doubt):
    assert unsure(*course) == (pytest.approx(JUMP) if in_doubt else 0.0)
    # What the belt does before the fence touches decides the force of no blow.
    assert unsure(*course, fence_force=0.0) == 0.0


# A search for errors came to it. The parcel's slip on the belt falls to 0.7 mm/s as the fence
# begins to push it. Static friction, smoothed over `standard`'s 0.75 mm/s, stops it, though kinetic
# friction is hardly more than the fence's pull by then, and holds it for 6 ms. Smoothed over a
# fifth of that it lets the parcel slide on.
NEARLY_CAUGHT = dict(
    thickness=0.0431348, reach=1.29505, flexible=0.253881, width=0.251449, modulus=836322000.0,
    density=1753.84, damping_ratio=0.00676701, mass=3.80231, length=0.521432, aspect=0.473849,
    across=-0.0247145, along=-0.38107, stiffness=158395000.0, damping=163.49, belt=0.708225,
    gravity=9.81, belt_kinetic=0.492839, belt_static=0.828925, kinetic=0.119659,
    static=0.798979, top_speed=0.511183, place=0.754339, angle=0.140164, approach=0.20338,
    ride=0.708225,
)  # fmt: skip


def test_a_parcel_that_smoothed_static_friction_alone_catches_is_said():
    # The second is a little faster and slides on; the kinetic friction of the third stops it.
    others = {"approach": 0.21}, {"belt_kinetic": 0.8}
    rows = [NEARLY_CAUGHT, *(NEARLY_CAUGHT | other for other in others)]
    x = {name: np.array([row[name] for row in rows]) for name in NEARLY_CAUGHT}
    status, force, *_ = peaks(fj.Fidelity.standard(), "value", "impact")(x)
    assert status[0] == fj.Status.FRICTION_SMOOTHED
    assert np.all(status[1:] <= fj.Status.LEFT_OVER_TIP)
    status, finer, *_ = peaks(fj.Fidelity.reference(), "value", "impact")(x)
    assert np.all(status <= fj.Status.LEFT_OVER_TIP)
    # Held for a while, it presses harder.
    assert force[0] > 1.025 * finer[0]
    np.testing.assert_allclose(force[1:], finer[1:], rtol=0.005)
