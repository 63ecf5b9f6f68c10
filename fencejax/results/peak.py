"""The largest value of a signal over a scene, refined between samples."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array


class Span(NamedTuple):
    """The length [s] of the step to a sample, whether it is the scene's first sample (the length is
    then 0), and the ratio [1] of the step before it to this one."""

    length: Array
    first: Array
    ratio: Array | float


def _half_difference(before: Array, now: Array, new: Array, span: Span) -> Array:
    """Half the second difference of three samples, for the length of the last step."""
    return (new - now + (before - now) / span.ratio) / (1 + span.ratio)


class Vertex(NamedTuple):
    """The parabola through a sample and its two neighbours: whether the signal has a maximum there
    (`inner`), the parabola's largest value then, and its place after the sample in lengths of the
    step that follows it."""

    inner: Array
    value: Array
    place: Array

    @classmethod
    def of(cls, before: Array, now: Array, new: Array, span: Span) -> "Vertex":
        """The vertex at the sample `now`; `span` is that of the step from it to `new`."""
        # now + slope s + curve s^2 through the samples at s = -ratio, 0, 1 in this step's length.
        curve = _half_difference(before, now, new, span)
        slope = new - now - curve
        inner = (now >= before) & (now > new) & (curve < 0)
        place = jnp.where(inner, -0.5 * slope / jnp.where(inner, curve, -1.0), 0.0)
        return cls(inner, now + 0.5 * slope * place, place)


class Peak(NamedTuple):
    """The largest value of a signal so far, its time and a companion value there.

    The vertex of the parabola through three consecutive samples refines an inner peak, so that the
    derivative of the peak is right and not only its value. A peak at an end of the window is the
    sample there. Signals here are not negative.
    """

    before: Array
    now: Array
    value: Array
    time: Array

    @classmethod
    def start(cls, zero: Array) -> "Peak":
        return cls(zero, zero, zero, zero)

    def update(self, new: Array, time: Array, span: Span) -> "Peak":
        """Take in the sample `new` at `time` [s]."""
        inner, vertex, place = Vertex.of(self.before, self.now, new, span)
        # NaN stays NaN.
        unchanged = (new <= self.value) | jnp.isnan(self.value)
        value = jnp.where(unchanged, self.value, new)
        when = jnp.where(unchanged, self.time, time)
        refined = inner & (vertex >= value)
        value = jnp.where(refined, vertex, value)
        when = jnp.where(refined, time - span.length * (1 - place), when)
        # Nothing peaks between the window's begin and its first sample.
        return Peak(jnp.where(span.first, 2 * new + 1, self.now), new, value, when)


def signed_second_difference(
    before: Array, now: Array, new: Array, span: Span, second: Array
) -> Array:
    """Second difference [N] of a force over the last two steps, for the length of the last one;
    the plain difference at the second sample of a scene, 0 at its first one."""
    difference = 2 * _half_difference(before, now, new, span)
    return jnp.where(span.first, 0.0, jnp.where(second, new - now, difference))


def second_difference(before: Array, now: Array, new: Array, span: Span, second: Array) -> Array:
    """The size of `signed_second_difference` [N], without derivatives."""
    difference = signed_second_difference(before, now, new, span, second)
    return jax.lax.stop_gradient(jnp.abs(difference))
