"""The defect of a step: the distance of the contact forces inside it from the straight lines that
the step is built on.

A step takes each contact force as linear in time; everything else follows exactly or to the same
order. So the error of a step comes from the difference between the contact law inside the step and
that line:

    d = max over theta of |law(D(theta), Ddot(theta)) - (N_0 + theta (N_1 - N_0))|.

D(theta) is the step's own dense output: the modes and the residual mode advance exactly to theta h
under the linear force, and the rest of the gap is smooth. Two inner points, at a quarter and at a
half of the step, see deviations of even and of odd shape. Their maps are those of shorter steps.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Smoothing
from ..model import (
    FenceState,
    PadState,
    ResidualMode,
    Vibration,
    corner_share,
    dot,
    propagate,
)
from ..parts import AbstractContactLaw, AbstractFriction
from .fence_response import FenceResponse
from .pad_response import PadResponse
from .step_size import Stride

INNER = (0.25, 0.5)
"""The points of a step [1] at which the contact law is evaluated."""


class ContactData(NamedTuple):
    """The data of a contact force: the contact law, its `viscosity` for the parcel, and the
    parcel's `mass` [kg]; the friction of each contact, if it has any, and how it is smoothed."""

    law: AbstractContactLaw
    viscosity: Array
    mass: Array
    frictions: tuple[AbstractFriction | None, ...] = ()
    smoothing: Smoothing | None = None


class Ends(NamedTuple):
    """A contact at the end of a step, and so at the start of the next one: the normal force [N],
    the gap [m], its rate [m/s] and the share of the contact law that acts there [1], `None` where
    all of it always does; the friction [N] and the sliding speed [m/s], `None` without friction."""

    normal: Array
    gap: Array
    gap_rate: Array
    share: Array | None = None
    friction: Array | None = None
    sliding: Array | None = None


def _smooth(
    theta: float,
    length: Array,
    low: tuple[Array, Array],
    high: tuple[Array, Array],
    bend: Array,
) -> tuple[Array, Array]:
    """The smooth part of a gap and its rate inside a step, from their values at both ends.

    The rate is linear but for `bend` [m/s], the effect of a linear force on the parcel's rate. The
    gap follows from the difference of the rates and not from the rates themselves: where the
    geometry is at its limits, these are not quite the derivative of the gap, which is no defect of
    the step.
    """
    (gap, gap_rate), (gap_after, rate_after) = low, high
    inner = 0.5 * theta * (1 - theta)
    turn = rate_after - gap_rate
    return gap + theta * (gap_after - gap) - inner * length * turn, (
        gap_rate + theta * turn + inner * bend
    )


class _Ringing(NamedTuple):
    """The part of the gap at a corner by the modes, the residual mode and the cover: their
    deflection [m], and its rate [m/s]."""

    deflection: Array
    rate: Array


def _ringing(
    fence: FenceResponse,
    vibration: Vibration,
    residual: tuple[ResidualMode, ...],
    pads: tuple[PadState, ...],
) -> list[_Ringing]:
    """This part of the gap at each corner, by the mode shapes at the step's end."""
    found = []
    for k, shape in enumerate(fence.shapes):
        deflection = dot(shape.deflection, vibration.amplitude)
        rate = dot(shape.deflection, vibration.rate)
        if fence.link.hinge is not None:
            turn, turn_rate = fence.link.hinge.twist(vibration)
            deflection = deflection + shape.place * turn
            rate = rate + shape.place * turn_rate
        if shape.residual_mode is not None:
            force, amplitude_rate = residual[k]
            amplitude = force - fence.link.lag * amplitude_rate
            deflection = deflection - shape.residual_mode[0] * amplitude
            rate = rate - shape.residual_mode[0] * amplitude_rate
        if pads:
            pressed, pressed_rate = fence.pads[k].cover.compression(pads[k])
            deflection, rate = deflection - pressed, rate - pressed_rate
        found.append(_Ringing(deflection, rate))
    return found


def _inside(
    fence: FenceResponse, before: FenceState, after: FenceState, inner: Stride, theta: float
) -> list[_Ringing]:
    """This part of the gap at each corner at theta h, the end of the shorter step `inner`."""
    load = tuple(
        start + theta * (end - start)
        for start, end in zip(before.modal_force, after.modal_force, strict=True)
    )
    vibration = propagate(inner.maps, before.vibration, before.modal_force, load)
    residual = []
    for start, end in zip(before.residual, after.residual, strict=True):
        change = theta * (end.force - start.force)
        rate = inner.lag_decay * start.rate + inner.lag_gain * change
        residual.append(ResidualMode(start.force + change, rate))
    pads = tuple(
        PadResponse.of(pad.cover, start, inner).at(
            start.settled + theta * (end.settled - start.settled)
        )
        for pad, start, end in zip(fence.pads, before.pads, after.pads, strict=True)
    )
    return _ringing(fence, vibration, tuple(residual), pads)


def share_defect(was: Ends, now: Ends) -> Array:
    """Distance of a contact's normal force [N] from its line inside a step in which the contact
    begins to end near the tip, or comes to its end there. It is at most half of what the end takes
    away, as all of that may happen in either half of the step."""
    if was.share is None or now.share is None:
        return jnp.zeros_like(now.normal)
    kinks = (was.share != now.share) & (
        (was.share >= 1) | (now.share >= 1) | (was.share <= 0) | (now.share <= 0)
    )
    most = jnp.maximum(was.share, now.share)
    whole = jnp.maximum(was.normal, now.normal) / jnp.where(most > 0, most, 1.0)
    return jnp.where(kinks, 0.5 * jnp.abs(now.share - was.share) * whole, 0.0)


def friction_defect(
    friction: AbstractFriction,
    smoothing: Smoothing,
    was: Ends,
    now: Ends,
) -> Array:
    """Distance of a contact's friction [N] from its line inside a step, with a sliding speed and a
    normal force that are linear in time.

    Friction bends where the corner comes to rest, and where it falls from static to kinetic, and
    that curve may be as much above its line as below. So two points are evaluated: half way from
    rest to either end, or a quarter from each end.
    """
    assert was.sliding is not None
    assert now.sliding is not None
    assert was.friction is not None
    assert now.friction is not None
    turns = was.sliding * now.sliding < 0
    rest = jnp.where(turns, was.sliding / jnp.where(turns, was.sliding - now.sliding, 1.0), 0.5)
    off = jnp.zeros_like(rest)
    for theta in (0.5 * rest, 0.5 + 0.5 * rest):
        sliding, normal, line = (
            a + theta * (b - a)
            for a, b in (
                (was.sliding, now.sliding),
                (was.normal, now.normal),
                (was.friction, now.friction),
            )
        )
        of_line = normal * corner_share(friction, sliding, smoothing)[0] - line
        off = jnp.maximum(off, jnp.abs(of_line))
    return off


def defects(
    contact: ContactData,
    strides: tuple[Stride, ...],
    length: Array,
    was: tuple[Ends, ...],
    now: tuple[Ends, ...],
    fence: FenceResponse | None,
    before: FenceState | None,
    after: FenceState | None,
) -> list[Array]:
    """The defect of each contact [N] for a step of the `length` [s] from `was` to `now`.

    `contact` is what makes the contact forces; `strides` are the steps that lead to the points of
    `INNER`; the fence, if any, goes from the state `before` to the state `after`.
    """
    first = last = []
    inside: list[list[_Ringing]] = [[] for _ in INNER]
    if fence is not None and fence.flexible:
        assert before is not None
        assert after is not None
        first = _ringing(fence, before.vibration, before.residual, before.pads)
        last = _ringing(fence, after.vibration, after.residual, after.pads)
        inside = [
            _inside(fence, before, after, inner, theta)
            for inner, theta in zip(strides, INNER, strict=True)
        ]
    found = []
    for k, (a, b) in enumerate(zip(was, now, strict=True)):
        low, high = (a.gap, a.gap_rate), (b.gap, b.gap_rate)
        if k < len(first):
            low = (a.gap - first[k].deflection, a.gap_rate - first[k].rate)
            high = (b.gap - last[k].deflection, b.gap_rate - last[k].rate)
        defect = jnp.zeros_like(a.gap)
        bend = length * (b.normal - a.normal) / contact.mass
        for theta, ringing in zip(INNER, inside, strict=True):
            gap, gap_rate = _smooth(theta, length, low, high, bend)
            if k < len(ringing):
                gap, gap_rate = gap + ringing[k].deflection, gap_rate + ringing[k].rate
            law = contact.law.force(gap, gap_rate, contact.viscosity).force
            if a.share is not None and b.share is not None:
                law = (a.share + theta * (b.share - a.share)) * law
            line = a.normal + theta * (b.normal - a.normal)
            defect = jnp.maximum(defect, jnp.abs(law - line))
        found.append(defect)
    return found
