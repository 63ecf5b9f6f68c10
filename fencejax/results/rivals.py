"""The difference of the derivatives of the fence's force between instants at which it may be
largest.

The gradient of the peak force is that of the force at the instant at which it is largest. Other
maxima may be as high, to within the accuracy of the force, and so may shoulders, where the force
nearly stops to rise or fall. Then it is uncertain which of them is the peak; and where two are
equally high the peak force has a kink. The possible error of the gradient is the difference between
their derivatives and its own.

The accuracy of a force is three tolerances of the steps; and as far as modes that are left out lag
behind, up to the 2.5 % that are promised, in proportion to the lag.

The least and the largest of these derivatives cannot be had by differentiating a function of the
motion. They are the tangents of two numbers that are always 0, by a rule of their own for
derivatives (`jax.custom_jvp`). So they cost nothing where nothing is differentiated.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .accumulators import CONTACT, DEEPEST, FORCE, Accumulator, Step, last_change
from .peak import Vertex
from .resolution import LAGGING, RESOLUTION, modes_lag

STEPS_MISS = 3.0
"""Error of the difference between two maxima by the steps, in tolerances of the error control: each
maximum is off by at most one and a half in 99 % of random impacts (`standard`), and a search had
found a wrong choice of the higher one with 2.5."""
# Uncertain share of a force where modes left out lag by the largest allowed lag [1].
_IN_DOUBT = 0.025


class Rivals(NamedTuple):
    """The `largest` force [N] at a maximum or a shoulder so far; the share `apart` of it by which
    others may be lower to count as rivals; and two numbers that are 0, whose derivatives are the
    `least` and the `most` of the derivatives of the force at all of them."""

    largest: Array
    apart: Array
    least: Array
    most: Array


@jax.custom_jvp
def _range(least: Array, most: Array, new: Array, joins: Array, alone: Array):
    """`least` and `most`. Their derivatives include that of `new` where it `joins` the rivals, and
    are that of `new` where it is `alone`; both flags are 0.0 or 1.0."""
    del new, joins, alone
    return least, most


@_range.defjvp
def _(primals, tangents):
    least, most, _, joins, alone = primals
    least_dot, most_dot, new_dot, *_ = tangents
    lower = jnp.where(joins > 0, jnp.minimum(least_dot, new_dot), least_dot)
    upper = jnp.where(joins > 0, jnp.maximum(most_dot, new_dot), most_dot)
    lower = jnp.where(alone > 0, new_dot, lower)
    upper = jnp.where(alone > 0, new_dot, upper)
    return (least, most), (lower, upper)


def _candidate(step: Step) -> tuple[Array, Array]:
    """Whether the force has a maximum at the sample before this step, or a shoulder in the step
    before that, in which it changes by less than in the steps next to it; and the force there."""
    known, contact, now = step.known["force"], step.known["contact"], step.now.fence_force
    inner, value, _ = Vertex.of(known.before, known.now, now, step.span)
    length = step.span.length
    spans = (length > 0) & (contact.length_before > 0)
    rate = (now - known.now) / jnp.where(spans, length, 1.0)
    middle = last_change(step, contact.force_before).rate
    before = contact.rate_before
    alike = (before * middle > 0) & (middle * rate > 0)
    least = jnp.abs(middle) < jnp.minimum(jnp.abs(before), jnp.abs(rate))
    shoulder = spans & alike & least
    return inner | shoulder, jnp.where(inner, value, 0.5 * (known.before + known.now))


def _in_doubt(step: Step, missed: float) -> Array:
    """The uncertain share of a force [1]."""
    lag = modes_lag(step.known["resolution"], step.known["deepest"], step.cutoff)
    return missed + _IN_DOUBT * jnp.minimum(lag / LAGGING, 1.0)


def rivals(missed: float) -> Accumulator:
    """The accumulator of rivals. Steps may make errors of the share `missed` [1]; 0 for fixed
    steps."""

    def update(state: Rivals, step: Step) -> Rivals:
        there, value = _candidate(step)
        apart = jax.lax.stop_gradient(_in_doubt(step, missed))
        alone = there & (state.largest < (1 - apart) * value)
        joins = there & (value >= (1 - apart) * state.largest)
        flags = (joins.astype(value.dtype), alone.astype(value.dtype))
        least, most = _range(state.least, state.most, value, *flags)
        largest = jnp.where(there, jnp.maximum(state.largest, value), state.largest)
        return Rivals(jax.lax.stop_gradient(largest), apart, least, most)

    def start(nothing, body) -> Rivals:
        del body
        return Rivals(*(nothing.time,) * 4)

    return Accumulator("rivals", start, update, needs=(FORCE, CONTACT, DEEPEST, RESOLUTION))
