"""How the derivatives of the fence's force differ between instants at which it may be largest.

The gradient of the peak force is that of the force at the instant at which it is largest. Other
maxima, and shoulders, where the force all but rests as it rises or falls, may be as high within
what is known of a force: which of them is the peak is then in doubt, and where two are equally high
the peak force has a kink. What its gradient may be off by is how far their derivatives are from its
own.

Forces are known to three tolerances of the steps and, as far as modes that are left out lag behind,
to the 2.5 % that are promised, in proportion to the lag.

The least and the most of derivatives are no functions of the motion: they are carried by numbers
that are 0 themselves. So they cost nothing where nobody differentiates.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .accumulators import CONTACT, DEEPEST, FORCE, Accumulator, Step, last_change
from .peak import Vertex
from .resolution import LAGGING, RESOLUTION, modes_lag

STEPS_MISS = 3.0
"""How far steps may have two maxima too close or too far apart, in tolerances of the error control:
each is off by one and a half at most in 99 % of random impacts (`standard`), and a search had found
the wrong one of two the higher by 2.5."""
# What of a force is in doubt where modes left out lag as far as they may [1].
_IN_DOUBT = 0.025


class Rivals(NamedTuple):
    """The `largest` force [N] at a maximum or a shoulder so far; how far `apart` from it, as a
    share, others count; and two numbers that are 0, whose derivatives are the `least` and the
    `most` of those of the force there and at these."""

    largest: Array
    apart: Array
    least: Array
    most: Array


@jax.custom_jvp
def _range(least: Array, most: Array, new: Array, joins: Array, alone: Array):
    """The two, whose derivatives take in that of `new` where it `joins` them, and are that of `new`
    where it is `alone`; both flags are 0.0 or 1.0."""
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
    before that, which it changes in by less than in the ones beside it; and how large it is."""
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
    """The share of a force that is in doubt [1]."""
    lag = modes_lag(step.known["resolution"], step.known["deepest"], step.cutoff)
    return missed + _IN_DOUBT * jnp.minimum(lag / LAGGING, 1.0)


def rivals(missed: float) -> Accumulator:
    """Of forces of which steps may have `missed` a share [1], 0 where they are fixed."""

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
