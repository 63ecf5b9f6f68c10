"""The defect of a step: how far the contact forces inside it are from the straight lines that the
step is built on.

A step takes each contact force as linear in time, and all else follows exactly or to the same
order. So the error that a step adds is made by what the contact law says inside it, less that line:

    d = max over theta of |law(D(theta), Ddot(theta)) - (N_0 + theta (N_1 - N_0))|.

D(theta) is the step's own dense output: the modes and the residual mode advance exactly to theta h,
under the linear force, and the rest of the gap, which no mode rings in, is the cubic through its
values and rates at both ends. Two inner points, a quarter and a half of the step, see deviations of
even and of odd shape; their maps are those of shorter steps.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..model import FenceState, Forces, Mechanics, dot, propagate
from .fence_response import FenceEnd
from .step_size import Stride

INNER = (0.25, 0.5)
"""The points of a step [1] at which the contact law is asked."""


class Ends(NamedTuple):
    """A contact at the end of a step, and so at the start of the next one: the normal force [N],
    the gap [m], its rate [m/s] and the share of the contact law that acts there [1]."""

    normal: Array
    gap: Array
    gap_rate: Array
    share: Array


class Defect(NamedTuple):
    """Of a contact: the `force` d [N], and how fast [m/s] it would make the gap change over the
    step beside how fast the gap does."""

    force: Array
    speed: Array
    closing: Array


def ends(mechanics: Mechanics, forces: Forces, shares: tuple[Array, ...]) -> tuple[Ends, ...]:
    """What the next step has to know of each contact."""
    found = []
    for k, meeting in enumerate(forces.meetings):
        what = meeting.contact
        share = shares[k] if k < len(shares) else jnp.ones_like(what.gap)
        found.append(Ends(what.normal, what.gap, what.gap_rate, share))
    return tuple(found)


def _smooth(theta: float, length: Array, low, high, bend: Array):
    """The rest of a gap and its rate inside a step, from both at its ends: the rate goes straight
    but for `bend` [m/s], what a linear force makes of the parcel's. The gap follows the rates'
    difference and not the rates: where the geometry is at its limits they are not quite the
    derivative of the gap, and that is no defect of the step."""
    (gap, gap_rate), (gap_after, rate_after) = low, high
    inner = 0.5 * theta * (1 - theta)
    turn = rate_after - gap_rate
    return gap + theta * (gap_after - gap) - inner * length * turn, (
        gap_rate + theta * turn + inner * bend
    )


class _Ringing(NamedTuple):
    """What the modes and the residual mode give to the gap at a corner: deflection [m], its rate
    [m/s]."""

    deflection: Array
    rate: Array


def _residual(fence: FenceEnd, k: int, force, rate) -> _Ringing | None:
    shape = fence.shapes[k].residual_mode
    if shape is None:
        return None
    return _Ringing(-shape[0] * (force - fence.link.lag * rate), -shape[0] * rate)


def _rings(fence: FenceEnd, k: int, vibration, residual) -> _Ringing:
    shape = fence.shapes[k].deflection
    deflection, rate = dot(shape, vibration.amplitude), dot(shape, vibration.rate)
    if residual is not None:
        deflection, rate = deflection + residual.deflection, rate + residual.rate
    return _Ringing(deflection, rate)


def _inside(
    fence: FenceEnd,
    before: FenceState,
    after: FenceState,
    inner: Stride,
    theta: float,
) -> list[_Ringing]:
    """The ringing at each corner at theta."""
    load = tuple(a + theta * (b - a) for a, b in zip(before.modal_force, after.modal_force, strict=True))
    free = propagate(inner.maps, before.vibration, before.modal_force, load)
    found = []
    for k in range(len(fence.shapes)):
        residual = None
        if fence.shapes[k].residual_mode is not None:
            force, rate = before.residual[k]
            force_here = force + theta * (after.residual[k].force - force)
            rate_here = inner.lag_decay * rate + inner.lag_gain * (force_here - force)
            residual = _residual(fence, k, force_here, rate_here)
        found.append(_rings(fence, k, free, residual))
    return found


def defects(
    mechanics: Mechanics,
    strides: tuple[Stride, ...],
    length: Array,
    was: tuple[Ends, ...],
    now: tuple[Ends, ...],
    fence: FenceEnd | None,
    before: FenceState | None,
    after: FenceState | None,
) -> list[Array]:
    """The defect of each contact [N]: of a step of the `length` [s] from `was` to `now`; `strides` are those that lead to the inner points."""
    at_ends: list[tuple[_Ringing, _Ringing]] = []
    inside: list[list[_Ringing]] = [[] for _ in INNER]
    if fence is not None and fence.flexible:
        for k in range(len(fence.shapes)):
            pair = []
            for state in (before, after):
                residual = None
                if fence.shapes[k].residual_mode is not None:
                    residual = _residual(fence, k, *state.residual[k])
                pair.append(_rings(fence, k, state.vibration, residual))
            at_ends.append(tuple(pair))
        inside = [
            _inside(fence, before, after, inner, theta)
            for inner, theta in zip(strides, INNER, strict=True)
        ]
    found = []
    for k, (a, b) in enumerate(zip(was, now, strict=True)):
        low, high = (a.gap, a.gap_rate), (b.gap, b.gap_rate)
        if k < len(at_ends):
            first, last = at_ends[k]
            low = (low[0] - first.deflection, low[1] - first.rate)
            high = (high[0] - last.deflection, high[1] - last.rate)
        largest = jnp.zeros_like(a.gap)
        bend = length * (b.normal - a.normal) / mechanics.mass
        for theta, ringing in zip(INNER, inside, strict=True):
            gap, gap_rate = _smooth(theta, length, low, high, bend)
            if k < len(at_ends):
                gap, gap_rate = gap + ringing[k].deflection, gap_rate + ringing[k].rate
            share = a.share + theta * (b.share - a.share)
            law = share * mechanics.law.force(gap, gap_rate, mechanics.viscosity).force
            line = a.normal + theta * (b.normal - a.normal)
            largest = jnp.maximum(largest, jnp.abs(law - line))
        found.append(largest)
    return found
