"""Evidence of whether the step, the modes and the smoothing of friction resolve the motion: how
forces change from step to step, how the parcel lets go of the belt, what load the modes left out
carry.

Nothing here has a derivative.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Smoothing
from ..model import FlexibleLink
from ..scenes import Body, NormalScene
from .accumulators import (
    BORDER,
    CONTACT,
    FORCE,
    OVER_TIP,
    SURFACE,
    Accumulator,
    Step,
    border_force,
    surface_force,
)
from .belt_catch import Catch, caught
from .hold import Hold, updated
from .peak import Peak, second_difference
from .sample import Sample

LAGGING = 0.0021
"""Largest lag [1] of the modes left out behind their static deflection, as a share of the contact's
depth: |N''| G / w^2 with their compliance G, and w between the highest frequency kept and the
lowest left out. With twice this lag a search finds peak forces of sorts that are off by 4 % on
fences that vibrate, and derivatives of impacts that are off by more than is promised."""
# A blow is over where the force is no more than this share of the largest so far.
_LITTLE = 0.1


class AtPeak(NamedTuple):
    """The state of things when the fence's force was largest.

    - `slip` [m/s]: the speed at which C_s slips on the belt.
    - `creep_time` [s]: how long it has crept on the belt until then; `drift` [m]: the displacement
      that may be wrong by that.
    - `over_tip`: 1.0 where a corner runs over the tip then or up to a step later.
    - `rebound_roughness` [N]: the largest second difference of the force from step to step until
      then, if parcel and fence have separated before; else 0.
    - `sliding_reversed`: 1.0 where a corner in contact with the fence has come to rest on it or
      reversed before; `belt_slip_reversed`: where C_s has reversed on the belt during contact.
    - `blows` [1]: how often the force has risen and fallen before.
    - `unsure_friction` [N]: the largest jump of friction of which it is uncertain whether it
      happened, at a corner on the fence (`hold`) or on the belt (`belt_catch`).
    """

    slip: Array
    creep_time: Array
    drift: Array
    over_tip: Array
    rebound_roughness: Array
    sliding_reversed: Array
    belt_slip_reversed: Array
    blows: Array
    unsure_friction: Array


class Resolution(NamedTuple):
    """The running evidence.

    - `roughness`, `border_roughness` [N]: the largest second differences from step to step of the
      force of the fence, but for its end over the tip, and of the forces of the still surfaces.
    - `creep_time` [s]: how long C_s, under the fence's force, has crept on the belt so far, neither
      at rest nor sliding; `drift` [m]: how much its displacement without contact may be wrong
      since.
    - `separated`: 1.0 where parcel and fence have touched and separated.
    - `blows` [1]: how often the force has fallen to a small share of its largest value.
    - `sliding_reversed`: 1.0 where a corner in contact with the fence has come to rest on it or
      reversed; `belt_slip_reversed`: where C_s has reversed on the belt within a step in contact.
    - `largest` [N]: the fence's largest force at a sample; `later`: those after at least one, two
      and three blows.
    - `residual_acceleration` [m/s^2]: the largest |N''| G under a corner, G [m/N] the compliance of
      the modes left out; `residual_deflection` [m]: the largest deflection G N of these.
    - `hold`: how close corners on the fence were to sticking instead of sliding, or sliding instead
      of sticking; `catch`: whether the belt stopped the parcel for certain.
    """

    roughness: Array
    border_roughness: Array
    creep_time: Array
    drift: Array
    separated: Array
    blows: Array
    sliding_reversed: Array
    belt_slip_reversed: Array
    largest: Array
    residual_acceleration: Array
    residual_deflection: Array
    later: tuple[Array, ...]
    hold: Hold
    catch: Catch
    at_peak: AtPeak


class Slip(NamedTuple):
    """Velocity (x, y) [m/s] at which C_s slips on the belt, and its size."""

    x: Array
    y: Array
    speed: Array


def _slip(sample: Sample) -> Slip:
    """The slip of C_s on the belt: opposite to the force grip u, with the speed grip u^2 over the
    force."""
    zero = jnp.zeros_like(sample.time)
    if sample.belt is None:
        return Slip(zero, zero, zero)
    x, y, moment, dissipated = jax.lax.stop_gradient(sample.belt)
    force = jnp.sqrt(x**2 + y**2)
    some = jnp.where(force > 0, force, 1.0)
    by_sliding = dissipated + moment * jax.lax.stop_gradient(sample.body.spin)
    speed = jnp.where(force > 0, by_sliding / some, 0.0)
    return Slip(-speed * x / some, -speed * y / some, speed)


def _creep_time(
    before: Slip, now: Slip, sample: Sample, length: Array, smoothing: Smoothing, known: Array
) -> Array:
    """How long C_s has crept on the belt under the fence's force [s]. It creeps where it is faster
    than the speed below which the belt holds it (`Smoothing.holds_below`); time counts with the
    weight exp(-(s / w_s)^2), the share that static friction still has above the kinetic one. The
    slip s is taken as linear over a step, and its size as linear down to the least one and up
    again.
    """
    if sample.belt is None:
        return known
    least, scale = smoothing.holds_below, smoothing.static_speed
    x_change, y_change = now.x - before.x, now.y - before.y
    square = x_change**2 + y_change**2
    where = -(before.x * x_change + before.y * y_change) / jnp.where(square > 0, square, 1.0)
    where = jnp.clip(where, 0.0, 1.0)
    nearest = jnp.sqrt((before.x + where * x_change) ** 2 + (before.y + where * y_change) ** 2)

    def excess(speed):
        """The integral of the weight over the speed from 0 to `speed`."""
        integral = jax.scipy.special.erf(jnp.maximum(speed, least) / scale)
        return 0.5 * math.sqrt(math.pi) * scale * integral

    path = jnp.abs(before.speed - nearest) + jnp.abs(now.speed - nearest)
    moves = path > 1e-3 * scale
    within = jnp.abs(excess(before.speed) - excess(nearest))
    within = within + jnp.abs(excess(now.speed) - excess(nearest))
    still = jnp.where(now.speed > least, jnp.exp(-((now.speed / scale) ** 2)), 0.0)
    share = jnp.where(moves, within / jnp.where(moves, path, 1.0), still)
    pressed = jax.lax.stop_gradient(sample.fence_force) > 0
    return known + jnp.where(pressed, jax.lax.stop_gradient(length) * share, 0.0)


def _drift(step: Step, slip: Slip, creep_time: Array, known: Array) -> Array:
    """By how much the displacement of C_s without contact may be wrong as it has crept on the belt
    [m].

    After creeping for a time T its speed differs from that by dry friction by up to
    eps + w_s (mu_s - mu_k) / mu_s, and by no more than mu_s g T, the change of speed by friction.
    """
    scene, smoothing = step.scene, step.smoothing
    if isinstance(scene, NormalScene) or scene.belt is None or step.now.belt is None:
        return known
    belt = jax.lax.stop_gradient(scene.belt)
    _, jump, largest = belt.friction.scales(slip.speed)
    some = jnp.where(largest > 0, largest, 1.0)
    speed = smoothing.slip_speed + smoothing.static_speed * jump / some
    speed = jnp.minimum(speed, largest * belt.gravity * creep_time)
    free = (step.now.fence_force <= 0) & (slip.speed > smoothing.static_speed)
    return known + jnp.where(free, jax.lax.stop_gradient(step.span.length) * speed, 0.0)


def _sliding_reversed(before: Sample, sample: Sample, smoothing: Smoothing, known: Array) -> Array:
    """1.0 from when a corner in contact with the fence has come to rest on it or reversed."""
    for was, now in zip(before.fence, sample.fence, strict=True):
        pressed = (was.normal > 0) & (now.normal > 0)
        rests = jnp.abs(now.sliding) < smoothing.slip_speed
        turns = pressed & (rests | (was.sliding * now.sliding < 0))
        known = jnp.where(turns, 1.0, known)
    return known


def _belt_slip_reversed(
    before: Slip, now: Slip, sample: Sample, smoothing: Smoothing, known: Array
) -> Array:
    """1.0 from when C_s has reversed on the belt from one step to the next, in contact with the
    fence."""
    if sample.belt is None or not sample.fence:
        return known
    slides = jnp.maximum(before.speed, now.speed) > smoothing.holds_below
    turns = (before.x * now.x + before.y * now.y < 0) & slides & (sample.fence_force > 0)
    return jnp.where(turns, 1.0, known)


def _at_peak(peak: Peak, known: AtPeak, sample: Sample, new: AtPeak, unit: float) -> AtPeak:
    """The new state where the force is larger than ever before, else `known`; `peak` lacks this
    sample.

    Where the force is largest within one whole step before it begins to end at the tip, it may as
    well rise until then, as far as such steps resolve; and its derivative changes fast in between.
    """
    higher = sample.fence_force > peak.value
    after = ~higher & ((peak.now >= peak.value) | (sample.time <= peak.time + unit))
    known = known._replace(
        over_tip=jnp.where(after, jnp.maximum(known.over_tip, new.over_tip), known.over_tip)
    )
    return jax.tree.map(lambda old, now: jnp.where(higher, now, old), known, new)


def _residual_acceleration(sample: Sample, roughness: Array, length: Array) -> Array:
    """|N''| G [m/s^2]: the second time derivative of the static deflection of the modes left
    out."""
    largest = jnp.zeros_like(roughness)
    for compliance, _ in jax.lax.stop_gradient(sample.carried):
        largest = jnp.maximum(largest, compliance)
    pace = jnp.where(length > 0, 1 / jnp.where(length > 0, length, 1.0), 0.0)
    return largest * roughness * jax.lax.stop_gradient(pace) ** 2


def _residual_deflection(sample: Sample, least: Array) -> Array:
    """The largest static deflection under a corner that the modes left out take [m], so far."""
    for compliance, load in jax.lax.stop_gradient(sample.carried):
        least = jnp.maximum(least, compliance * jnp.abs(load))
    return least


def cutoff(link: FlexibleLink | None) -> Array | None:
    """The square of an angular frequency between those of the highest mode kept and of the lowest
    one left out [1/s^2], as frequencies of a clamped beam go with (n - 1/2)^2; `None` without
    modes."""
    if link is None or not link.clamped_eigenvalues.size:
        return None
    clamped = jax.lax.stop_gradient(link.clamped_eigenvalues)
    kept = clamped.shape[-1]
    return ((kept + 0.5) / (kept - 0.5)) ** 2 * clamped[-1]


def modes_lag(resolution: Resolution, deepest: Array, cutoff: Array | None) -> Array:
    """The lag of the modes left out behind their static deflection [1], as a share of the contact's
    largest depth so far, `deepest` [m]; 0 where there are none."""
    if cutoff is None:
        return jnp.zeros_like(deepest)
    some = deepest > 0
    lag = resolution.residual_acceleration / jnp.where(some, cutoff * deepest, 1.0)
    return jnp.where(some, lag, 0.0)


def ends_over_tip(step: Step) -> Array:
    """Whether the force changes because a corner runs over the tip, where the model ends the force.
    A shorter step does not resolve that better."""
    before, now = step.before, step.now
    ended = (step.known["over_tip"] > 0) & (now.fence_force <= 0)
    return (before.over_tip > 0) | (now.over_tip > 0) | ended


def _start(nothing: Sample, body: Body) -> Resolution:
    zero = nothing.time
    return Resolution(
        *(zero,) * 11, later=(zero,) * 3, hold=Hold.start(nothing), catch=Catch(zero, zero),
        at_peak=AtPeak(*(zero,) * 9),
    )  # fmt: skip


def _update(state: Resolution, step: Step) -> Resolution:
    before, now, length, smoothing = step.before, step.now, step.span.length, step.smoothing
    force, border = step.known["force"], step.known["border"]
    roughness = second_difference(force.before, force.now, now.fence_force, step.span, step.second)
    roughness = jnp.where(ends_over_tip(step), 0.0, roughness)
    slip_before, slip = _slip(before), _slip(now)
    creep_time = _creep_time(slip_before, slip, now, length, smoothing, state.creep_time)
    drift = _drift(step, slip, creep_time, state.drift)
    at_border = border_force(now)
    of_border = second_difference(border.before, border.now, at_border, step.span, step.second)
    surface, at_surfaces = step.known["surface"], surface_force(now)
    if at_surfaces is not None:
        of_surfaces = second_difference(
            surface.before, surface.now, at_surfaces, step.span, step.second
        )
        of_border = jnp.maximum(of_border, of_surfaces)
    little = _LITTLE * force.value
    falls = (before.fence_force > little) & (now.fence_force <= little)
    blows = state.blows + jnp.where(jax.lax.stop_gradient(falls), 1.0, 0.0)
    apart = (step.known["contact"].touched > 0) & (now.fence_force <= 0)
    separated = jnp.where(apart, 1.0, state.separated)
    roughest = jnp.maximum(state.roughness, roughness)
    reversed_ = _sliding_reversed(before, now, smoothing, state.sliding_reversed)
    on_belt = _belt_slip_reversed(slip_before, slip, now, smoothing, state.belt_slip_reversed)
    hold = updated(state.hold, before, now, length, step.scene, smoothing)
    catch = caught(
        state.catch, slip_before.speed, slip.speed, now, length, step.scene, smoothing
    )
    at_peak = AtPeak(
        slip.speed, creep_time, drift, now.over_tip, separated * roughest, reversed_, on_belt,
        blows, jnp.maximum(hold.unsure, catch.unsure),
    )  # fmt: skip
    acceleration = _residual_acceleration(now, roughness, length)
    new = jax.lax.stop_gradient(now.fence_force)
    return Resolution(
        roughness=roughest,
        border_roughness=jnp.maximum(state.border_roughness, of_border),
        creep_time=creep_time,
        drift=drift,
        separated=separated,
        blows=blows,
        sliding_reversed=reversed_,
        belt_slip_reversed=on_belt,
        largest=jnp.maximum(state.largest, new),
        later=tuple(
            jnp.where(blows >= count, jnp.maximum(known, new), known)
            for count, known in enumerate(state.later, start=1)
        ),
        residual_acceleration=jnp.maximum(state.residual_acceleration, acceleration),
        residual_deflection=_residual_deflection(now, state.residual_deflection),
        hold=hold,
        catch=catch,
        at_peak=_at_peak(force, state.at_peak, now, at_peak, step.unit),
    )


RESOLUTION = Accumulator(
    "resolution", _start, _update, needs=(FORCE, BORDER, SURFACE, CONTACT, OVER_TIP)
)
