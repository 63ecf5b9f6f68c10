"""Quantities and limits: their values, their margins, and the end of a load."""

import types

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.design import LIMITS, OBJECTIVES, Limit, objectives
from fencejax.results import accumulators


def _result(time, load, place):
    """A result whose largest place is tallied from samples of a load and a place."""

    def instant(t):
        return types.SimpleNamespace(
            fence=(types.SimpleNamespace(normal=load(t), place=place(t)),)
        )

    largest, before = jnp.zeros(()), instant(time[0])
    for t in time:
        now = instant(t)
        largest = accumulators.largest_place_so_far(before, now, largest)
        before = now
    return types.SimpleNamespace(largest_place=largest)


def _scene():
    return types.SimpleNamespace(fence=fj.Fence())


def test_tip_clearance_follows_the_end_of_the_load():
    # N = 50 - c t falls through 1 N at t = 49 / c, where the corner is at 0.9 + 1.5 t; both are
    # linear, so that the interpolation is exact: clearance 0.3 - 73.5 / c, derivative 73.5 / c^2.
    time = jnp.linspace(0.0, 0.2, 37)

    def clearance(rate):
        result = _result(time, lambda t: jnp.maximum(50 - rate * t, 0), lambda t: 0.9 + 1.5 * t)
        return objectives.TIP_CLEARANCE(result, _scene())

    rate = 401.7
    # The sample after the end has N = 0, not the line's value: the error is within one sample.
    assert float(clearance(rate)) == pytest.approx(0.3 - 73.5 / rate, abs=1.5 * 0.2 / 36)

    def smooth(rate):
        result = _result(time, lambda t: 50 - rate * t, lambda t: 0.9 + 1.5 * t)
        return objectives.TIP_CLEARANCE(result, _scene())

    assert float(smooth(rate)) == pytest.approx(0.3 - 73.5 / rate, rel=1e-12)
    assert float(jax.grad(smooth)(rate)) == pytest.approx(73.5 / rate**2, rel=1e-10)


def test_tip_clearance_with_the_furthest_place_inside_and_with_no_load():
    time = jnp.linspace(0.0, 1.0, 11)
    inside = _result(time, lambda t: 9 - 8 * t, lambda t: 1.1 - (t - 0.5) ** 2)
    assert float(objectives.TIP_CLEARANCE(inside, _scene())) == pytest.approx(0.1, rel=1e-12)
    never = _result(time, lambda t: 0 * t, lambda t: 5 + t)
    assert float(objectives.TIP_CLEARANCE(never, _scene())) == pytest.approx(1.2, rel=1e-12)


def test_margins():
    most = Limit(objectives.TIP_DEFLECTION, 0.08)
    assert most.margin_of(0.06) == pytest.approx(0.25)
    assert most.margin_of(0.10) == pytest.approx(-0.25)
    least = Limit(objectives.CROSSING, 0.1, "at least", 0.7)
    assert least.margin_of(0.17) == pytest.approx(0.1)
    assert least.margin_of(0.03) == pytest.approx(-0.1)
    assert all(name == limit.name == OBJECTIVES[name].name for name, limit in LIMITS.items())


def test_quantities_read_a_wall_scene():
    scene = fj.scenes.rigid_wall()
    result = fj.simulate(scene, history=False)
    for quantity in OBJECTIVES.values():
        if quantity.applies_to(scene):
            assert np.isfinite(float(quantity(result, scene)))
    assert not objectives.CROSSING.applies_to(scene)
    assert float(objectives.PEAK_FORCE(result, scene)) > 1000


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Limit(objectives.CROSSING, 0.0, "at least"), "crossing scale. must be .*above 0"),
        (lambda: Limit(objectives.PEAK_STRESS, 4e7, "below"), "`sense` must be one of"),
        (lambda: objectives.CROSSING(None, fj.scenes.rigid_wall()), "`scene` must have"),
        (lambda: objectives.TIP_CLEARANCE(None, fj.scenes.free_motion()), "`scene` must have"),
    ],
)
def test_refusals(make, message):
    with pytest.raises(ValueError, match=message):
        make()
