"""The constant push of a point mass across the belt, against its motion step by step."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.design import sorting


def sort(mass, kinetic, static, rubbing, front=0.1, offset=0.05):
    """A sort of the paper's fence and belt, whose reach is 1.2 m and whose speed is 2 m/s."""
    return fj.scenes.whole_sort(
        parcel=fj.Parcel(mass), front=front, offset=offset,
        belt=fj.Belt(friction=fj.Friction(kinetic, static)),
        fence_friction=fj.Friction(rubbing, rubbing),
    )  # fmt: skip


def way(force, mass, kinetic, rubbing, time):
    """The distance across the belt by a constant push, by 20,000 steps of the motion."""
    step, place, speed, now = time / 10_000, np.zeros(2), np.zeros(2), 0.0
    grip = kinetic * mass * 9.81
    push = force * np.array([-rubbing, 1.0])
    while now < time or np.hypot(*speed) > 1e-3:
        along = speed / np.hypot(*speed) if np.any(speed) else push / np.hypot(*push)
        rate = ((push if now < time else 0.0) - grip * along) / mass
        faster = speed + step * rate
        place, speed, now = place + 0.5 * step * (speed + faster), faster, now + step
    return place[1]


@pytest.mark.parametrize(("rubbing", "past"), [(0.0, 0.0), (0.35, 0.1)])
def test_the_push_leads_just_as_far_as_is_asked_for(rubbing, past):
    # As little static friction as kinetic: the way decides. From the centre at 0.2 m to the edge at
    # 0.7 m; the rearmost corner begins at -0.3 m.
    scene = sort(12.0, 0.4, 0.4, rubbing)
    force = float(sorting.constant_push(scene, past))
    time = (1.2 + 0.3 + rubbing * (0.5 + past)) / 2.0
    # Ends of a step: 1e-4 of the time each; the glide is cut off at 1 mm/s.
    assert way(force, 12.0, 0.4, rubbing, time) == pytest.approx(0.5 + past, rel=5e-4)
    assert force * np.hypot(1, rubbing) > 0.4 * 12 * 9.81


def test_no_push_undercuts_what_holds_the_parcel_on_the_belt():
    # The paper's numbers: 0.85 m g, less by what the fence's friction helps.
    heavy = sorting.constant_push(sort(20.0, 0.65, 0.85, 0.35))
    assert float(heavy) == pytest.approx(0.85 * 20 * 9.81 / np.hypot(1, 0.35))
    assert float(sorting.constant_push(sort(20.0, 0.65, 0.85, 0.0))) == pytest.approx(166.77)
    # Already as far as is asked for.
    assert float(sorting.constant_push(sort(20.0, 0.65, 0.85, 0.35), -0.6)) == 0.0
    with pytest.raises(ValueError, match="a parcel that rides in"):
        sorting.constant_push(fj.scenes.oblique_impact())


def test_slopes_of_the_push():
    point = np.array([12.0, 0.4, 0.35, 0.1, 0.05])

    def push(z):
        return sorting.constant_push(sort(z[0], z[1], z[1], z[2], z[3], z[4]), 0.1)

    slopes = np.asarray(jax.grad(push)(jnp.asarray(point)))
    for i, one in enumerate(np.eye(5) * 1e-5 * point):
        change = float(push(point + one)) - float(push(point - one))
        # Central differences of a smooth function: (1e-5)^2, and rounding of 1e-16 / 1e-5.
        assert slopes[i] == pytest.approx(change / (2 * one[i]), rel=1e-6)
