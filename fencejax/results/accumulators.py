"""What is summed and compared step by step: peaks refined between steps, work, impulse, contact."""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Smoothing
from ..scenes import Body
from .sample import Energy, Power, Sample

_PRESSING = 1.0


class Span(NamedTuple):
    """The length [s] of the step to a sample, whether it is the scene's first sample (the length is
    then 0), and the ratio [1] of the step before it to this one."""

    length: Array
    first: Array
    ratio: Array | float


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
        # now + lean s + bend s^2 through the samples at s = -ratio, 0, 1 in this step's length.
        rise = new - self.now
        bend = (rise + (self.before - self.now) / span.ratio) / (1 + span.ratio)
        lean = rise - bend
        inner = (self.now >= self.before) & (self.now > new) & (bend < 0)
        place = jnp.where(inner, -0.5 * lean / jnp.where(inner, bend, -1.0), 0.0)
        vertex = self.now + 0.5 * lean * place
        # What is not a number stays so.
        held = (new <= self.value) | jnp.isnan(self.value)
        value = jnp.where(held, self.value, new)
        when = jnp.where(held, self.time, time)
        refined = inner & (vertex >= value)
        value = jnp.where(refined, vertex, value)
        when = jnp.where(refined, time - span.length * (1 - place), when)
        # Nothing peaks between the window's begin and its first sample.
        return Peak(jnp.where(span.first, 2 * new + 1, self.now), new, value, when)


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


class Scope(NamedTuple):
    """What a tally has to know of its scene: `reach` R_z [m], where the fence ends; with
    `tip_contact` a corner beyond it is in contact as long as it presses; and how dry friction is
    smoothed."""

    reach: Array | None
    tip_contact: bool = False
    smoothing: Smoothing = Smoothing(1.0, 1.0)


class AtPeak(NamedTuple):
    """What was so when the fence's force was largest: `slip` [m/s] is the speed at which C_s
    slipped on the belt, `crept` [s] how long it had crept on it until then, `cut` 1.0 where a
    corner ran over the tip then or a step later, `again` [N] the largest second difference of the
    force from step to step until then if parcel and fence had parted before, else 0; `turned` 1.0
    where a corner pressed on the fence had come to rest on it, or turned round, before, `slewed`
    where C_s, pressed by it, had turned round on the belt."""

    slip: Array
    crept: Array
    cut: Array
    again: Array
    turned: Array
    slewed: Array


class Tally(NamedTuple):
    """Running results of a scene; each is free where nobody reads it.

    `origin` are the energies at the start; `length` [s] is that of the last step, `None` where all
    are alike. `rough`, `rough_border` [N] are the largest second differences of the forces of the
    fence and of the border from step to step; `crept` [s] is how long C_s, under the fence's force,
    has let go of the belt or come to rest on it so far, neither at rest nor sliding; `parted` and
    `turned` are 1.0 where parcel and fence have touched and parted, and where a corner pressed on
    the fence has come to rest on it or turned round, `slewed` where C_s, pressed by the fence, has
    turned round on the belt within a step; `hurry` [m/s^2] the largest |N''| G under a corner,
    G [m/N] the compliance of the modes left out, and `carried` [m] the largest deflection G N that
    they take there. They say whether the step, the smoothing of friction and the modes resolve the
    motion, and have no derivative.
    """

    last: Sample
    origin: Energy
    length: Array | None
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
    rough: Array
    rough_border: Array
    crept: Array
    parted: Array
    turned: Array
    slewed: Array
    at_peak: AtPeak
    hurry: Array
    carried: Array


def _border_force(sample: Sample) -> Array:
    return sum((c.normal for c in sample.border), jnp.zeros_like(sample.time))


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


def empty(like: Sample, body: Body, alike: bool) -> Tally:
    """A tally that has seen nothing yet, of samples of the shape `like`; `alike`: whether all steps
    are of one length."""
    nothing = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), like)
    zero = nothing.time
    peak = Peak.start(zero)
    stay = Stay(zero - 1, zero, zero + jnp.inf, zero - jnp.inf, body.x, body.y, zero)
    return Tally(
        last=nothing,
        origin=nothing.energy,
        length=None if alike else zero,
        force=peak,
        tip=peak,
        stress=peak,
        stress_place=zero,
        torque=peak,
        border=peak,
        work=nothing.power,
        impulse=zero,
        stay=stay,
        deepest=zero,
        furthest=body.y,
        largest_place=zero,
        over_tip=zero,
        defect=zero,
        rough=zero,
        rough_border=zero,
        crept=zero,
        parted=zero,
        turned=zero,
        slewed=zero,
        at_peak=AtPeak(*(zero,) * 6),
        hurry=zero,
        carried=zero,
    )


def _deepest(sample, least):
    for c in (*sample.fence, *sample.border):
        least = jnp.maximum(least, jnp.where(c.normal > 0, c.gap, 0.0))
    return least


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


def _bend(before: Array, now: Array, new: Array, span: Span, second: Array) -> Array:
    """Second difference [N] of a force over the last two steps, for the length of the last one;
    the plain difference at the second sample of a scene, 0 at its first one."""
    rise = new - now
    bend = 2 * (rise + (before - now) / span.ratio) / (1 + span.ratio)
    bend = jnp.abs(jnp.where(second, rise, bend))
    return jax.lax.stop_gradient(jnp.where(span.first, 0.0, bend))


class Slip(NamedTuple):
    """Velocity (x, y) [m/s] at which C_s slips on the belt, and its size."""

    x: Array
    y: Array
    speed: Array


def _slip(sample: Sample) -> Slip:
    """How C_s slips on the belt: against the force grip u, at grip u^2 over that force."""
    zero = jnp.zeros_like(sample.time)
    if sample.belt is None:
        return Slip(zero, zero, zero)
    x, y, moment, dissipated = jax.lax.stop_gradient(sample.belt)
    force = jnp.sqrt(x**2 + y**2)
    some = jnp.where(force > 0, force, 1.0)
    by_sliding = dissipated + moment * jax.lax.stop_gradient(sample.body.spin)
    speed = jnp.where(force > 0, by_sliding / some, 0.0)
    return Slip(-speed * x / some, -speed * y / some, speed)


def _crept(
    before: Slip, now: Slip, sample: Sample, length: Array, scope: Scope, known: Array
) -> Array:
    """How long C_s has crept on the belt under the fence's force [s]: its slip s was above 2 eps,
    up to which the belt holds with nine tenths of the largest static friction; counted by what
    static friction still has over kinetic, exp(-(s / w_s)^2). Over a step the slip is taken to go
    straight, its size linearly down to the least and up again."""
    if sample.belt is None:
        return known
    least, scale = 2 * scope.smoothing.slip_speed, scope.smoothing.static_speed
    x_change, y_change = now.x - before.x, now.y - before.y
    square = x_change**2 + y_change**2
    where = -(before.x * x_change + before.y * y_change) / jnp.where(square > 0, square, 1.0)
    where = jnp.clip(where, 0.0, 1.0)
    nearest = jnp.sqrt((before.x + where * x_change) ** 2 + (before.y + where * y_change) ** 2)

    def excess(speed):
        """Its integral over the speed from 0 to `speed`."""
        held = jax.scipy.special.erf(jnp.maximum(speed, least) / scale)
        return 0.5 * math.sqrt(math.pi) * scale * held

    way = jnp.abs(before.speed - nearest) + jnp.abs(now.speed - nearest)
    moves = way > 1e-3 * scale
    within = jnp.abs(excess(before.speed) - excess(nearest))
    within = within + jnp.abs(excess(now.speed) - excess(nearest))
    still = jnp.where(now.speed > least, jnp.exp(-((now.speed / scale) ** 2)), 0.0)
    share = jnp.where(moves, within / jnp.where(moves, way, 1.0), still)
    pressed = jax.lax.stop_gradient(sample.fence_force) > 0
    return known + jnp.where(pressed, jax.lax.stop_gradient(length) * share, 0.0)


def _turned(before: Sample, sample: Sample, scope: Scope, known: Array) -> Array:
    """1.0 from when a corner pressed on the fence has come to rest on it or turned round."""
    for was, now in zip(before.fence, sample.fence, strict=True):
        pressed = (was.normal > 0) & (now.normal > 0)
        rests = jnp.abs(now.sliding) < scope.smoothing.slip_speed
        turns = pressed & (rests | (was.sliding * now.sliding < 0))
        known = jnp.where(turns, 1.0, known)
    return known


def _slewed(before: Slip, now: Slip, sample: Sample, scope: Scope, known: Array) -> Array:
    """1.0 from when C_s, pressed by the fence, has turned round on the belt from step to step."""
    if sample.belt is None or not sample.fence:
        return known
    slides = jnp.maximum(before.speed, now.speed) > 2 * scope.smoothing.slip_speed
    turns = (before.x * now.x + before.y * now.y < 0) & slides & (sample.fence_force > 0)
    return jnp.where(turns, 1.0, known)


def _at_peak(peak: Peak, known: AtPeak, sample: Sample, new: AtPeak) -> AtPeak:
    """`known`, or what is so now where the force has not been larger; `peak` lacks this sample."""
    higher = sample.fence_force > peak.value
    after = ~higher & (peak.now >= peak.value)
    known = known._replace(cut=jnp.where(after, jnp.maximum(known.cut, new.cut), known.cut))
    return jax.tree.map(lambda old, now: jnp.where(higher, now, old), known, new)


def _hurry(sample: Sample, rough: Array, length: Array) -> Array:
    """|N''| G [m/s^2]: how fast the static deflection of the modes left out is asked to change,
    times its rate of change."""
    largest = jnp.zeros_like(rough)
    for compliance, _ in jax.lax.stop_gradient(sample.carried):
        largest = jnp.maximum(largest, compliance)
    pace = jnp.where(length > 0, 1 / jnp.where(length > 0, length, 1.0), 0.0)
    return largest * rough * jax.lax.stop_gradient(pace) ** 2


def _carried(sample: Sample, least: Array) -> Array:
    """The largest static deflection under a corner that the modes left out take [m], so far."""
    for compliance, load in jax.lax.stop_gradient(sample.carried):
        least = jnp.maximum(least, compliance * jnp.abs(load))
    return least


def _stayed(stay: Stay, sample: Sample, before: Sample, gap: Array, span: Span) -> Stay:
    """Contact begins and ends where the gap, linear over the step, passes zero."""
    # A start at the touch is one at the touch whatever round-off makes of it.
    touch = span.first & (jnp.abs(gap) < 64 * jnp.finfo(gap.dtype).eps)
    gap, step = jnp.where(touch, 0.0, gap), span.length
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
        jnp.where(now, sample.time, pick(stay.last, moment)),
        jnp.where(now, sample.body.x, pick(stay.x, between(before.body.x, sample.body.x))),
        jnp.where(now, sample.body.y, pick(stay.y, between(before.body.y, sample.body.y))),
        jnp.where(now, 1.0, stay.touched),
    )


def add(
    tally: Tally,
    sample: Sample,
    length: Array,
    defect: Array,
    scope: Scope,
) -> Tally:
    """Take in the next sample, one step of `length` [s] after the last; 0 for the first sample.

    Integrals are by the trapezoidal rule, as the motion's are.
    """
    before = tally.last
    time = sample.time
    first = length == 0
    ratio = 1.0
    if tally.length is not None:
        known = (tally.length > 0) & ~first
        ratio = jnp.where(known, tally.length, 1.0) / jnp.where(known, length, 1.0)
    span = Span(length, first, ratio)
    mean = lambda a, b: 0.5 * length * (a + b)  # noqa: E731
    work = jax.tree.map(lambda w, a, b: w + mean(a, b), tally.work, before.power, sample.power)
    stress = tally.stress.update(sample.stress, time, span)
    higher = sample.stress >= tally.stress.value
    # Times count from the scene's first sample.
    second = ~first & (before.time == 0)
    border = _border_force(sample)
    force, wall = tally.force, tally.border
    rough = _bend(force.before, force.now, sample.fence_force, span, second)
    slip_before, slip = _slip(before), _slip(sample)
    crept = _crept(slip_before, slip, sample, length, scope, tally.crept)
    rough_border = _bend(wall.before, wall.now, border, span, second)
    apart = (tally.stay.touched > 0) & (sample.fence_force <= 0)
    parted = jnp.where(apart, 1.0, tally.parted)
    roughest = jnp.maximum(tally.rough, rough)
    turned = _turned(before, sample, scope, tally.turned)
    slewed = _slewed(slip_before, slip, sample, scope, tally.slewed)
    at_peak = AtPeak(slip.speed, crept, sample.over_tip, parted * roughest, turned, slewed)
    return Tally(
        last=sample,
        origin=jax.tree.map(
            lambda kept, new: jnp.where(first, new, kept), tally.origin, sample.energy
        ),
        length=None if tally.length is None else length,
        force=force.update(sample.fence_force, time, span),
        tip=tally.tip.update(jnp.abs(sample.tip_deflection), time, span),
        stress=stress,
        stress_place=jnp.where(higher, sample.stress_place, tally.stress_place),
        torque=tally.torque.update(jnp.abs(sample.torque), time, span),
        border=wall.update(border, time, span),
        work=work,
        impulse=tally.impulse + mean(before.fence_force, sample.fence_force),
        stay=_stayed(tally.stay, sample, before, _gap(sample, scope), span),
        deepest=_deepest(sample, tally.deepest),
        furthest=jnp.maximum(tally.furthest, sample.body.y),
        largest_place=largest_place_so_far(before, sample, tally.largest_place),
        over_tip=jnp.maximum(tally.over_tip, sample.over_tip),
        defect=jnp.maximum(tally.defect, defect),
        rough=roughest,
        rough_border=jnp.maximum(tally.rough_border, rough_border),
        crept=crept,
        parted=parted,
        turned=turned,
        slewed=slewed,
        at_peak=_at_peak(force, tally.at_peak, sample, at_peak),
        hurry=jnp.maximum(tally.hurry, _hurry(sample, rough, length)),
        carried=_carried(sample, tally.carried),
    )
