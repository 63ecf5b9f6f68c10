"""Accumulators: peaks, integrals and times in contact, updated from sample to sample.

An accumulator is a state with a start and an update. `fencejax.results.measures` reads the measures
of a result from these states; `resolution` adds those that show whether steps, modes and smoothing
resolve the motion. What is not read is not in the compiled program.
"""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Smoothing
from ..scenes import Body, NormalScene, Scene
from .peak import Peak, Span
from .sample import Sample

_PRESSING = 1.0


class Step(NamedTuple):
    """Two consecutive samples, as an accumulator sees them.

    `unbalance` [N] is the force by which the step's equations are out of balance; `second` whether
    `now` is the scene's second sample; `smoothing` how dry friction is smoothed; `unit` [s] the
    length of a step that nothing shortens; `cutoff` the square of an angular frequency [1/s^2] up
    to which the fence's modes are kept, `None` without modes; `known` the states of all
    accumulators before this step; `scene` the scene that is simulated.
    """

    before: Sample
    now: Sample
    span: Span
    second: Array
    unbalance: Array
    smoothing: Smoothing
    unit: float
    cutoff: Array | None
    known: Mapping[str, Any]
    scene: NormalScene | Scene

    def integral(self, before: Array, now: Array) -> Array:
        """The integral of a signal over the step by the trapezoidal rule, as in the equations of
        motion."""
        return 0.5 * self.span.length * (before + now)


@dataclasses.dataclass(frozen=True)
class Accumulator:
    """A running state, by name.

    - `name`: no other accumulator of a simulation has it, this package's included; `simulate`
      raises `ValueError` where two that are not the same have one name.
    - `start(nothing, body)`: the state before the first sample, from a sample of zeros and the
      parcel's motion at the start; every leaf is floating-point.
    - `update(state, step)`: the state after a `Step`.
    - `needs`: other accumulators whose states before the step it reads in `step.known`.
    """

    name: str
    start: Callable[[Sample, Body], Any]
    update: Callable[[Any, Step], Any]
    needs: tuple["Accumulator", ...] = ()


class Course(NamedTuple):
    """A signal over a scene: times [s] of shape (n,) and the signal there, of shape (n, ...). Where
    longer steps have left room, the last sample is repeated."""

    time: Array
    signal: Any


@dataclasses.dataclass(frozen=True)
class Trace:
    """A signal that is kept at every sample, in place of an accumulator, for a measure that is read
    from the whole `Course` of it. No other trace of a simulation has its `name`; `simulate` raises
    `ValueError` where two different ones do."""

    name: str
    signal: Callable[[Sample], Any]


def mean_where(value: tuple[Array, Array], level: tuple[Array, Array]) -> Array:
    """Mean over a step of a value where a level is above 0, and of 0 elsewhere; both are linear
    from before the step to now."""
    (a, b), (low, high) = value, level
    apart = (low > 0) != (high > 0)
    share = jnp.where(apart, low, 0.0) / jnp.where(apart, low - high, 1.0)
    # The part before, and the part after, the instant at which the level is 0.
    first = share * (a + 0.5 * share * (b - a))
    whole = 0.5 * (a + b)
    part = jnp.where(low > 0, first, whole - first)
    return jnp.where(apart, part, jnp.where(low > 0, whole, 0.0))


def peak_of(name: str, signal: Callable[[Sample], Array | None]) -> Accumulator:
    """The largest value of a signal that is not negative, and its time. Where a scene lacks the
    part that makes the signal, which is `None` then, the state is `None` too, and nothing is
    computed."""

    def start(nothing: Sample, body: Body) -> Peak | None:
        return None if signal(nothing) is None else Peak.start(nothing.time)

    def update(state: Peak | None, step: Step) -> Peak | None:
        now = signal(step.now)
        if state is None or now is None:
            return None
        return state.update(now, step.now.time, step.span)

    return Accumulator(name, start, update)


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


def surface_force(sample: Sample) -> Array | None:
    """Normal force of the surfaces besides the border [N], all together; `None` without any."""
    if not sample.surfaces:
        return None
    contacts = (c for corners in sample.surfaces for c in corners)
    return sum((c.normal for c in contacts), jnp.zeros_like(sample.time))


FORCE = peak_of("force", lambda sample: sample.fence_force)
TIP = peak_of("tip", lambda sample: jnp.abs(sample.tip_deflection))
STRESS = peak_of("stress", lambda sample: sample.stress)
TORQUE = peak_of("torque", lambda sample: jnp.abs(sample.torque))
BORDER = peak_of("border", border_force)
SURFACE = peak_of("surface", surface_force)


def _update_stress_place(place: Array, step: Step) -> Array:
    higher = step.now.stress >= step.known["stress"].value
    return jnp.where(higher, step.now.stress_place, place)


STRESS_PLACE = Accumulator(
    "stress_place", lambda nothing, body: nothing.time, _update_stress_place, needs=(STRESS,)
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
    for c in (*sample.fence, *sample.border, *sum(sample.surfaces, ())):
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
    """Times [s] at which the fence's force acts: the `total`, the `first` and the `last`; C_s at
    the last [m]; and for the step before the last one, from which the force is extrapolated, the
    force at its end [N], its rate of change [N/s] and the step's length [s].

    Flags are 0.0 or 1.0: the state that diffrax carries is floating-point throughout.
    """

    total: Array
    first: Array
    last: Array
    x: Array
    y: Array
    touched: Array
    force_before: Array
    rate_before: Array
    length_before: Array


def _no_contact(nothing: Sample, body: Body) -> ContactTimes:
    zero = nothing.time
    return ContactTimes(
        zero, zero + jnp.inf, zero - jnp.inf, body.x, body.y, zero, zero, zero, zero
    )


def _touch(step: Step) -> Array:
    """Share of the step [1] after which the first of the corners that press at its end touched:
    where its gap, linear over the step, passed zero; 0 where it was closed already."""
    first = jnp.ones_like(step.now.time)
    for was, now in zip(step.before.fence, step.now.fence, strict=True):
        crossed = (was.gap < 0) & (now.gap > 0)
        share = jnp.where(crossed, was.gap / jnp.where(crossed, was.gap - now.gap, 1.0), 0.0)
        first = jnp.where(now.normal > 0, jnp.minimum(first, share), first)
    return jnp.where(step.span.first, 0.0, first)


class Change(NamedTuple):
    """The rate of change [N/s] of the force over the step before the last one, and its length."""

    rate: Array
    length: Array


def last_change(step: Step, force_before: Array) -> Change:
    """The change of the fence's force over the step before this one, which began with
    `force_before` [N]."""
    length = step.span.length * step.span.ratio
    change = step.before.fence_force - force_before
    return Change(change / jnp.where(length > 0, length, 1.0), length)


def _release(step: Step, state: ContactTimes, change: Change) -> Array:
    """Share of the step [1] after which the last of the corners in contact has let go.

    A corner whose gap has passed zero lets go there. A corner whose gap is still positive recovers
    its shape more slowly than the bodies separate: its force goes to zero at a finite rate, at the
    zero of the parabola through the last three samples under load. With N(s) = N_0 - b s + c s^2
    this is s = 2 N_0 / (b + sqrt(b^2 - 4 c N_0)). It may be a little beyond the step's end. Where
    it is a whole step beyond, the force has ended for another reason, and the step's end is taken.
    """
    force, length = step.before.fence_force, step.span.length
    whole = change.length + state.length_before
    curve = jnp.where(state.length_before > 0, change.rate - state.rate_before, 0.0)
    curve = curve / jnp.where(whole > 0, whole, 1.0)
    fall = -(change.rate + curve * change.length)
    square = fall * fall - 4 * curve * force
    ends = (fall > 0) & (square > 0) & (length > 0)
    slope = jnp.where(ends, fall + jnp.sqrt(jnp.where(ends, square, 1.0)), 1.0)
    share = 2 * force / (slope * jnp.where(length > 0, length, 1.0))
    share = jnp.where(ends & (share < 2.0), share, 1.0)
    last = jnp.zeros_like(share)
    for was, now in zip(step.before.fence, step.now.fence, strict=True):
        crossed = (was.gap > 0) & (now.gap < 0)
        gone = was.gap / jnp.where(crossed, was.gap - now.gap, 1.0)
        released = jnp.where(crossed, gone, share)
        last = jnp.maximum(last, jnp.where(was.normal > 0, released, 0.0))
    return last


def _presses(step: Step) -> tuple[Array, Array]:
    """Whether the fence's force acts before the step, and at its end."""
    return (step.before.fence_force > 0) & ~step.span.first, step.now.fence_force > 0


def _update_contact(state: ContactTimes, step: Step) -> ContactTimes:
    before, now, length = step.before, step.now, step.span.length
    was, acts = _presses(step)
    begins, ends = acts & ~was, was & ~acts
    change = last_change(step, state.force_before)
    released = jnp.where(ends, jnp.minimum(_release(step, state, change), 1.0), 0.0)
    share = jnp.where(begins, _touch(step), released)
    part = jnp.where(begins, 1.0 - share, jnp.where(ends, share, jnp.where(acts, 1.0, 0.0)))
    moment = before.time + share * length

    def between(a: Array, b: Array) -> Array:
        return a + share * (b - a)

    def last_value(at_sample: Array, at_moment: Array, known: Array) -> Array:
        return jnp.where(acts, at_sample, jnp.where(ends, at_moment, known))

    return ContactTimes(
        total=state.total + length * part,
        first=jnp.where(begins & (state.touched == 0), moment, state.first),
        last=last_value(now.time, moment, state.last),
        x=last_value(now.body.x, between(before.body.x, now.body.x), state.x),
        y=last_value(now.body.y, between(before.body.y, now.body.y), state.y),
        touched=jnp.where(acts, 1.0, state.touched),
        force_before=before.fence_force,
        rate_before=change.rate,
        length_before=change.length,
    )


CONTACT = Accumulator("contact", _no_contact, _update_contact)


def _update_impulse(impulse: Array, step: Step) -> Array:
    """The trapezoidal rule, as in the equations of motion, except for the step in which the force
    ends.

    There the force falls to zero after a share s of the step and stays zero: N h s / 2. The
    trapezoidal rule would give N h / 2 wherever in the step that is. Its error, between 0 and h^2
    |N'| / 8, is small; but the derivative of that error in the instant of separation, h |N'| (1 - 2
    s) / 2, is of the first order and changes its sign from step to step.
    """
    before, now = step.before.fence_force, step.now.fence_force
    contact = step.known["contact"]
    was, acts = _presses(step)
    share = _release(step, contact, last_change(step, contact.force_before))
    parting = 0.5 * share * step.span.length * before
    return impulse + jnp.where(was & ~acts, parting, step.integral(before, now))


IMPULSE = Accumulator(
    "impulse", lambda nothing, body: nothing.time, _update_impulse, needs=(CONTACT,)
)
