"""Signals of a simulated scene at the times of a recording, with their derivatives."""

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Fidelity
from ..results import Sample
from ..scenes import numbers as scene_numbers
from ..simulate import simulate


def interpolate(time: Array, knots: Array, values: Array) -> Array:
    """A signal at other times, by cubics between its samples; constant before and after them.

    The slope at a knot is that of the parabola through it and its neighbours (a knot at an end has
    the chord's), so that the error is of the third order in any spacing; two knots at the same time
    are a jump. Differentiable in all three.

    **Arguments:** `time` (K,), `knots` [the same unit] (T,) in rising order, `values` (T,).
    """
    span = jnp.diff(knots)
    apart = span > 0
    safe = jnp.where(apart, span, 1.0)
    chord = jnp.where(apart, jnp.diff(values) / safe, 0.0)
    before, after = safe[:-1], safe[1:]
    inner = (after * chord[:-1] + before * chord[1:]) / (before + after)
    # Beside a jump the parabola would reach over it.
    inner = jnp.where(apart[:-1], jnp.where(apart[1:], inner, chord[:-1]), chord[1:])
    slope = jnp.concatenate([chord[:1], inner, chord[-1:]])
    place = jnp.clip(
        jnp.searchsorted(knots, jax.lax.stop_gradient(time), side="right") - 1, 0, span.size - 1
    )
    inside = jnp.clip(time, knots[0], knots[-1])
    width = safe[place]
    s = (inside - knots[place]) / width
    a, b = values[place], values[place + 1]
    rise, fall = slope[place] * width, slope[place + 1] * width
    return a + s * (rise + s * (3 * (b - a) - 2 * rise - fall + s * (2 * (a - b) + rise + fall)))


def _signal(history: Sample, name: str) -> Array:
    if name == "force":
        return history.fence_force
    if name == "tip_deflection":
        return history.tip_deflection
    return getattr(history.body, name)


def _read(time: Array, history: Sample, name: str) -> Array:
    """A signal at some times: before the scene's start there is no force, and what moves goes on
    backwards as it moves then."""
    knots, values = history.time, _signal(history, name)
    found = interpolate(time, knots, values)
    if name == "force":
        return jnp.where(time < knots[0], 0.0, found)
    apart = knots[1] > knots[0]
    rate = jnp.where(apart, values[1] - values[0], 0.0) / jnp.where(apart, knots[1] - knots[0], 1.0)
    return found + rate * jnp.minimum(time - knots[0], 0.0)


@functools.lru_cache(maxsize=64)
def program_of(structure, chosen: tuple[str, ...], signals: tuple[str, ...], fidelity: Fidelity):
    """Signals at given times with their derivatives in the parameters and in the offset."""

    def model(parameters, offset, leaves, time):
        scene = scene_numbers.replace(jax.tree.unflatten(structure, leaves), chosen, parameters)
        result = simulate(scene, fidelity=fidelity, only=("history",))
        history = result.history
        assert history is not None
        shown = [_read(time + offset, history, name) for name in signals]
        return jnp.stack(shown), result.status

    def run(parameters, offset, leaves, time):
        def twice(p, o):
            values, status = model(p, o, leaves, time)
            return values, (values, status)

        slopes, (values, status) = jax.jacfwd(twice, argnums=(0, 1), has_aux=True)(
            list(parameters), offset
        )
        return values, jnp.stack([*slopes[0], slopes[1]], axis=-1), status

    return jax.jit(run)
