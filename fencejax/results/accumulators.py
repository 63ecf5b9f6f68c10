"""What is summed and compared from sample to sample: peaks, integrals, times in contact.

An accumulator is a state with a start and an update. `fencejax.results.measures` reads the
measures of a result from these states, `resolution` adds those that tell whether steps, modes and
smoothing resolve the motion. What nobody reads is not in the compiled program.
"""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Smoothing
from ..scenes import Body
from .peak import Peak, Span
from .sample import Sample

_PRESSING = 1.0


class Scope(NamedTuple):
    """What accumulators have to know of their scene: `reach` R_z [m], where the fence ends; with
    `tip_contact` a corner beyond it is in contact as long as it presses; and how dry friction is
    smoothed."""

    reach: Array | None
    tip_contact: bool = False
    smoothing: Smoothing = Smoothing(1.0, 1.0)


class Step(NamedTuple):
    """Two samples next to each other, as an accumulator sees them.

    `unbalance` [N] is the force that the step's equations leave unbalanced; `second` whether `now`
    is the scene's second sample; `known` the states of all accumulators before this step.
    """

    before: Sample
    now: Sample
    span: Span
    second: Array
    unbalance: Array
    scope: Scope
    known: Mapping[str, Any]

    def integral(self, before: Array, now: Array) -> Array:
        """Of a signal over the step, by the trapezoidal rule, as the motion's are."""
        return 0.5 * self.span.length * (before + now)


@dataclasses.dataclass(frozen=True)
class Accumulator:
    """A running state, by name.

    - `start(nothing, body)`: the state before the first sample, from a sample of zeros and the
      parcel's motion at the start; every leaf is floating-point.
    - `update(state, step)`: the state after a `Step`.
    - `needs`: other accumulators whose states before the step it reads in `step.known`.
    """

    name: str
    start: Callable[[Sample, Body], Any]
    update: Callable[[Any, Step], Any]
    needs: tuple["Accumulator", ...] = ()


def peak_of(name: str, signal: Callable[[Sample], Array]) -> Accumulator:
    """The largest value of a signal that is not negative, and its time."""
    return Accumulator(
        name,
        lambda nothing, body: Peak.start(nothing.time),
        lambda state, step: state.update(signal(step.now), step.now.time, step.span),
    )


def largest_of(name: str, signal: Callable[[Sample], Array], start=None) -> Accumulator:
    """The largest value of a signal at a sample, at least 0 or the signal of the start."""
    return Accumulator(
        name,
        lambda nothing, body: nothing.time if start is None else start(body),
        lambda state, step: jnp.maximum(state, signal(step.now)),
    )


def border_force(sample: Sample) -> Array:
    """Normal force of the border [N], all corners together."""
    return sum((c.normal for c in sample.border), jnp.zeros_like(sample.time))


FORCE = peak_of("force", lambda sample: sample.fence_force)
TIP = peak_of("tip", lambda sample: jnp.abs(sample.tip_deflection))
STRESS = peak_of("stress", lambda sample: sample.stress)
TORQUE = peak_of("torque", lambda sample: jnp.abs(sample.torque))
BORDER = peak_of("border", border_force)


def _update_stress_place(place: Array, step: Step) -> Array:
    higher = step.now.stress >= step.known["stress"].value
    return jnp.where(higher, step.now.stress_place, place)


STRESS_PLACE = Accumulator(
    "stress_place", lambda nothing, body: nothing.time, _update_stress_place, needs=(STRESS,)
)
IMPULSE = Accumulator(
    "impulse",
    lambda nothing, body: nothing.time,
    lambda state, step: state + step.integral(step.before.fence_force, step.now.fence_force),
)
WORK = Accumulator(
    "work",
    lambda nothing, body: nothing.power,
    lambda state, step: jax.tree.map(
        lambda w, a, b: w + step.integral(a, b), state, step.before.power, step.now.power
    ),
)
ORIGIN = Accumulator(
    "origin",
    lambda nothing, body: nothing.energy,
    lambda state, step: jax.tree.map(
        lambda kept, new: jnp.where(step.span.first, new, kept), state, step.now.energy
    ),
)


def _depth(sample: Sample) -> Array:
    """The largest gap D of a corner under load [m], at least 0."""
    depth = jnp.zeros_like(sample.time)
    for c in (*sample.fence, *sample.border):
        depth = jnp.maximum(depth, jnp.where(c.normal > 0, c.gap, 0.0))
    return depth


DEEPEST = largest_of("deepest", _depth)
FURTHEST = largest_of("furthest", lambda sample: sample.body.y, lambda body: body.y)
OVER_TIP = largest_of("over_tip", lambda sample: sample.over_tip)
UNBALANCE = Accumulator(
    "unbalance",
    lambda nothing, body: nothing.time,
    lambda state, step: jnp.maximum(state, step.unbalance),
)


def largest_place_so_far(before: Sample, sample: Sample, least: Array) -> Array:
    """Largest arc coordinate [m] of a corner that presses with more than 1 N.

    The moment at which the load falls through 1 N is interpolated between the samples, so that the
    derivative follows that moment as well.
    """
    for was, now in zip(before.fence, sample.fence, strict=True):
        least = jnp.maximum(least, jnp.where(now.normal > _PRESSING, now.place, 0.0))
        ends = (was.normal > _PRESSING) & (now.normal <= _PRESSING)
        fall = jnp.where(ends, was.normal - now.normal, 1.0)
        share = jnp.where(ends, was.normal - _PRESSING, 0.0) / fall
        last = was.place + share * (now.place - was.place)
        least = jnp.maximum(least, jnp.where(ends, last, 0.0))
    return least


LARGEST_PLACE = Accumulator(
    "largest_place",
    lambda nothing, body: nothing.time,
    lambda state, step: largest_place_so_far(step.before, step.now, state),
)


class ContactTimes(NamedTuple):
    """Times [s] in contact with the fence: in all, first touch, last touch; where C_s was then [m].

    Flags are 0.0 or 1.0: the state that diffrax carries is floating-point throughout.
    """

    gap: Array
    total: Array
    first: Array
    last: Array
    x: Array
    y: Array
    touched: Array


def _no_contact(nothing: Sample, body: Body) -> ContactTimes:
    zero = nothing.time
    return ContactTimes(
        zero - 1, zero, zero + jnp.inf, zero - jnp.inf, body.x, body.y, zero
    )


def _gap(sample: Sample, scope: Scope) -> Array:
    """The deepest gap of the corners that are over the fence; -1 m where there is none."""
    gap = jnp.full_like(sample.time, -1.0)
    for c in sample.fence:
        assert scope.reach is not None
        before_tip = c.place <= scope.reach
        if scope.tip_contact:
            before_tip = before_tip | (c.normal > 0)
        over = (c.place >= 0) & before_tip
        gap = jnp.maximum(gap, jnp.where(over, c.gap, -1.0))
    return gap


def _update_contact(stay: ContactTimes, step: Step) -> ContactTimes:
    """Contact begins and ends where the gap, linear over the step, passes zero."""
    before, sample, span = step.before, step.now, step.span
    gap = _gap(sample, step.scope)
    # A start at the touch is one at the touch whatever round-off makes of it.
    touch = span.first & (jnp.abs(gap) < 64 * jnp.finfo(gap.dtype).eps)
    gap, length = jnp.where(touch, 0.0, gap), span.length
    was, now = stay.gap > 0, gap > 0
    change = gap - stay.gap
    crossed = was != now
    share = jnp.where(crossed, -stay.gap / jnp.where(crossed, change, 1.0), 0.0)
    part = jnp.where(now, 1.0 - share, share)
    lasted = length * jnp.where(crossed, part, jnp.where(now, 1.0, 0.0))
    moment = before.time + share * length
    fresh = now & ~was & (stay.touched == 0)
    ended = was & ~now
    pick = lambda old, new: jnp.where(ended, new, old)  # noqa: E731
    between = lambda a, b: a + share * (b - a)  # noqa: E731
    return ContactTimes(
        gap,
        stay.total + lasted,
        jnp.where(fresh, moment, stay.first),
        jnp.where(now, sample.time, pick(stay.last, moment)),
        jnp.where(now, sample.body.x, pick(stay.x, between(before.body.x, sample.body.x))),
        jnp.where(now, sample.body.y, pick(stay.y, between(before.body.y, sample.body.y))),
        jnp.where(now, 1.0, stay.touched),
    )


CONTACT = Accumulator("contact", _no_contact, _update_contact)
