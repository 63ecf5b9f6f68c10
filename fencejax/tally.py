"""What is summed and compared step by step: peaks refined between steps, work, impulse, contact."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .instant import Instant, Power

_PRESSING = 1.0

class Peak(NamedTuple):
    """The largest value of a signal so far, its time and a companion value there.

    The vertex of the parabola through three consecutive samples refines an inner peak, so that the
    derivative of the peak is right and not only its value. A peak at an end of the window is the
    sample there.
    """

    before: Array
    now: Array
    value: Array
    time: Array

    @classmethod
    def start(cls, value: Array, time: Array) -> "Peak":
        return cls(value, value, value, time)

    def update(self, new: Array, time: Array, step: float) -> "Peak":
        """Take in the sample `new` at `time` [s], one `step` [s] after the last one."""
        bend = self.before - 2 * self.now + new
        lean = 0.5 * (new - self.before)
        inner = (self.now >= self.before) & (self.now > new) & (bend < 0)
        safe = jnp.where(inner, bend, -1.0)
        vertex = self.now - 0.5 * lean**2 / safe
        value = jnp.where(new > self.value, new, self.value)
        when = jnp.where(new > self.value, time, self.time)
        refined = inner & (vertex >= value)
        value = jnp.where(refined, vertex, value)
        when = jnp.where(refined, time - step - step * lean / safe, when)
        return Peak(self.now, new, value, when)


class Stay(NamedTuple):
    """Times in contact with the fence: in all, first touch, last touch; where C_s was then.

    Flags are 0.0 or 1.0: the state that diffrax carries is floating-point throughout.
    """

    gap: Array
    total: Array
    first: Array
    last: Array
    x: Array
    y: Array
    touched: Array


class Tally(NamedTuple):
    """Running results of a scene; each is free where nobody reads it."""

    last: Instant
    force: Peak
    tip: Peak
    stress: Peak
    stress_place: Array
    torque: Peak
    border: Peak
    work: Power
    impulse: Array
    stay: Stay
    deepest: Array
    furthest: Array
    largest_place: Array
    over_tip: Array
    defect: Array


def _border_force(instant: Instant) -> Array:
    return sum((c.normal for c in instant.border), jnp.zeros_like(instant.time))


def _gap(instant: Instant, reach: Array | None) -> Array:
    """The deepest gap of the corners that are over the fence; -1 m where there is none."""
    gap = jnp.full_like(instant.time, -1.0)
    for c in instant.fence:
        assert reach is not None
        over = (c.place >= 0) & (c.place <= reach)
        gap = jnp.maximum(gap, jnp.where(over, c.gap, -1.0))
    return gap


def begin(instant: Instant, reach: Array | None) -> Tally:
    """A tally that has seen the first sample."""
    time = instant.time
    zero = jnp.zeros_like(time)
    gap = _gap(instant, reach)
    # A start at the touch is one at the touch whatever round-off makes of it.
    gap = jnp.where(jnp.abs(gap) < 64 * jnp.finfo(gap.dtype).eps, 0.0, gap)
    touching = gap > 0
    stay = Stay(
        gap,
        zero,
        jnp.where(touching, time, jnp.inf),
        jnp.where(touching, time, -jnp.inf),
        instant.body.x,
        instant.body.y,
        touching.astype(gap.dtype),
    )
    return Tally(
        last=instant,
        force=Peak.start(instant.fence_force, time),
        tip=Peak.start(jnp.abs(instant.tip_deflection), time),
        stress=Peak.start(instant.stress, time),
        stress_place=instant.stress_place,
        torque=Peak.start(jnp.abs(instant.torque), time),
        border=Peak.start(_border_force(instant), time),
        work=jax.tree.map(jnp.zeros_like, instant.power),
        impulse=zero,
        stay=stay,
        deepest=_deepest(instant, zero),
        furthest=instant.body.y,
        largest_place=largest_place_so_far(instant, instant, zero),
        over_tip=zero,
        defect=zero,
    )


def _deepest(instant, least):
    for c in (*instant.fence, *instant.border):
        least = jnp.maximum(least, jnp.where(c.normal > 0, c.gap, 0.0))
    return least


def largest_place_so_far(before: Instant, instant: Instant, least: Array) -> Array:
    """Largest arc coordinate [m] of a corner that presses with more than 1 N.

    The moment at which the load falls through 1 N is interpolated between the samples, so that the
    derivative follows that moment as well.
    """
    for was, now in zip(before.fence, instant.fence, strict=True):
        least = jnp.maximum(least, jnp.where(now.normal > _PRESSING, now.place, 0.0))
        ends = (was.normal > _PRESSING) & (now.normal <= _PRESSING)
        fall = jnp.where(ends, was.normal - now.normal, 1.0)
        share = jnp.where(ends, was.normal - _PRESSING, 0.0) / fall
        last = was.place + share * (now.place - was.place)
        least = jnp.maximum(least, jnp.where(ends, last, 0.0))
    return least


def _stayed(stay: Stay, instant: Instant, before: Instant, gap: Array, step: float) -> Stay:
    """Contact begins and ends where the gap, linear over the step, passes zero."""
    was, now = stay.gap > 0, gap > 0
    change = gap - stay.gap
    crossed = was != now
    share = jnp.where(crossed, -stay.gap / jnp.where(crossed, change, 1.0), 0.0)
    part = jnp.where(now, 1.0 - share, share)
    lasted = step * jnp.where(crossed, part, jnp.where(now, 1.0, 0.0))
    moment = before.time + share * step
    fresh = now & ~was & (stay.touched == 0)
    ended = was & ~now
    pick = lambda old, new: jnp.where(ended, new, old)  # noqa: E731
    between = lambda a, b: a + share * (b - a)  # noqa: E731
    return Stay(
        gap,
        stay.total + lasted,
        jnp.where(fresh, moment, stay.first),
        jnp.where(now, instant.time, pick(stay.last, moment)),
        jnp.where(now, instant.body.x, pick(stay.x, between(before.body.x, instant.body.x))),
        jnp.where(now, instant.body.y, pick(stay.y, between(before.body.y, instant.body.y))),
        jnp.where(now, 1.0, stay.touched),
    )


def add(
    tally: Tally, instant: Instant, step: float, reach: Array | None, defect: Array
) -> Tally:
    """Take in the next sample. Integrals are by the trapezoidal rule, as the motion's are."""
    before = tally.last
    time = instant.time
    mean = lambda a, b: 0.5 * step * (a + b)  # noqa: E731
    work = jax.tree.map(lambda w, a, b: w + mean(a, b), tally.work, before.power, instant.power)
    for (was, load), (now, loaded) in zip(before.carried, instant.carried, strict=True):
        # 1/2 r^2 dG: the load that the modes left out carry has moved along the fence.
        work = work._replace(geometry=work.geometry + 0.25 * (load**2 + loaded**2) * (now - was))
    stress = tally.stress.update(instant.stress, time, step)
    higher = instant.stress >= tally.stress.value
    over = tally.over_tip
    for c in instant.fence:
        assert reach is not None
        passed = (c.place > reach) & (c.gap > 0) & (c.normal > 0)
        over = jnp.where(passed, 1.0, over)
    return Tally(
        last=instant,
        force=tally.force.update(instant.fence_force, time, step),
        tip=tally.tip.update(jnp.abs(instant.tip_deflection), time, step),
        stress=stress,
        stress_place=jnp.where(higher, instant.stress_place, tally.stress_place),
        torque=tally.torque.update(jnp.abs(instant.torque), time, step),
        border=tally.border.update(_border_force(instant), time, step),
        work=work,
        impulse=tally.impulse + mean(before.fence_force, instant.fence_force),
        stay=_stayed(tally.stay, instant, before, _gap(instant, reach), step),
        deepest=_deepest(instant, tally.deepest),
        furthest=jnp.maximum(tally.furthest, instant.body.y),
        largest_place=largest_place_so_far(before, instant, tally.largest_place),
        over_tip=over,
        defect=jnp.maximum(tally.defect, defect),
    )
