"""Signals between their samples."""

import jax
import jax.numpy as jnp
from jaxtyping import Array


def interpolate(time: Array, knots: Array, values: Array) -> Array:
    """A signal at other times, by cubics between its samples; constant before and after them.

    The slope at a knot is that of the parabola through it and its neighbours (a knot at an end has
    the chord's), so that the error is of the third order in any spacing; two knots at the same time
    are a jump. Differentiable in all three.

    **Arguments:** `time` (K,), `knots` [the same unit] (T,) in rising order, `values` (T, ...).
    """
    one = (1,) * (values.ndim - 1)
    span = jnp.diff(knots)
    apart = span > 0
    safe = jnp.where(apart, span, 1.0)
    place = jnp.clip(
        jnp.searchsorted(knots, jax.lax.stop_gradient(time), side="right") - 1, 0, span.size - 1
    )
    inside = jnp.clip(time, knots[0], knots[-1])
    s = ((inside - knots[place]) / safe[place]).reshape(-1, *one)
    apart, safe = apart.reshape(-1, *one), safe.reshape(-1, *one)
    chord = jnp.where(apart, jnp.diff(values, axis=0) / safe, 0.0)
    before, after = safe[:-1], safe[1:]
    inner = (after * chord[:-1] + before * chord[1:]) / (before + after)
    # Beside a jump the parabola would reach over it.
    inner = jnp.where(apart[:-1], jnp.where(apart[1:], inner, chord[:-1]), chord[1:])
    slope = jnp.concatenate([chord[:1], inner, chord[-1:]])
    width = safe[place]
    a, b = values[place], values[place + 1]
    rise, fall = slope[place] * width, slope[place + 1] * width
    return a + s * (rise + s * (3 * (b - a) - 2 * rise - fall + s * (2 * (a - b) + rise + fall)))
