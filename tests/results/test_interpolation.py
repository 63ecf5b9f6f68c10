"""Signals at other times than those of the samples."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.results import interpolate


def test_interpolation():
    # Exact for parabolas on any grid, up to the two ends; differentiable in the time.
    knots = jnp.asarray([0.0, 0.1, 0.4, 0.5, 1.1, 1.2])
    values = 2 * knots**2 - knots
    time = jnp.linspace(0.1, 1.1, 23)
    found = interpolate(time, knots, values)
    np.testing.assert_allclose(found, 2 * time**2 - time, rtol=0, atol=1e-14)
    slope = jax.jit(jax.vmap(jax.grad(lambda t: interpolate(t[None], knots, values)[0])))(
        time[1:-1]
    )
    np.testing.assert_allclose(slope, 4 * time[1:-1] - 1, rtol=0, atol=1e-12)
    # Constant outside, and itself at the knots.
    outside = interpolate(jnp.asarray([-1.0, 9.0]), knots, values)
    np.testing.assert_allclose(outside, np.asarray(values)[[0, -1]], rtol=0, atol=1e-14)
    at_knots = interpolate(knots, knots, values)
    np.testing.assert_allclose(at_knots, values, rtol=0, atol=1e-14)
    # A jump: two knots at one time.
    step = jnp.asarray([0.0, 1.0, 1.0, 2.0])
    jump = jnp.asarray([0.0, 0.0, 5.0, 5.0])
    found = interpolate(jnp.asarray([0.5, 0.999, 1.0, 1.5]), step, jump)
    np.testing.assert_allclose(found, jump, rtol=0, atol=1e-12)


def test_a_history_at_times_of_ones_own():
    scene = fj.scenes.rigid_wall(speed=1.0, duration=0.03)
    history = fj.simulate(scene, only=("history",)).history
    # Steps of several lengths, as a whole sort has them.
    kept = np.flatnonzero(np.arange(history.time.size) % 7 < 5)
    history = jax.tree.map(lambda leaf: leaf[kept], history)
    some = history.at(history.time[5:9])
    for path, leaf in jax.tree_util.tree_leaves_with_path(some):
        assert leaf.shape[0] == 4, jax.tree_util.keystr(path)
    np.testing.assert_allclose(some.fence_force, history.fence_force[5:9], rtol=1e-12)
    # A position changes as its speed says: the slope of the parabolas is off by the square of the
    # longest step over 6 times the largest jerk; at the two ends it is a chord's.
    middle = (0.5 * (history.time[:-1] + history.time[1:]))[1:-1]
    rate = jax.jit(jax.vmap(jax.grad(lambda t: history.at(t[None]).body.y[0])))(middle)
    exact = np.interp(middle, history.time, history.body.y_rate)
    step = np.diff(history.time)
    jerk = np.max(np.abs(np.diff(history.acceleration.y) / step))
    np.testing.assert_allclose(rate, exact, rtol=0, atol=np.max(step) ** 2 * jerk / 6)
    with pytest.raises(ValueError, match="jax.vmap"):
        jax.tree.map(lambda leaf: leaf[None], history).at(middle)
