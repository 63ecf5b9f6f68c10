"""The fence's tip against the parcel's side, from the first contact or after a corner ran over the
tip.

A corner C inside the fence by D, at the arc coordinate R_z - s, meets the fence along its normal n.
The side of the parcel behind it, from this corner to the next one, has the inward normal m, turned
from n towards the tip by theta: m = n cos(theta) + t sin(theta). The tip is inside that side by
D cos(theta) + s sin(theta), which is less than D where s < D tan(theta / 2). There the tip carries
the contact, along m. Both are one gap,

    g = D + sin(theta) psi(x),   x = s - D tan(theta / 2),

with psi(x) = 0 for x >= l, x for x <= -l and a smooth minimum of the two in between, so that the
force is N times the gradient of g: it does work like a spring, and has a continuous derivative.
Where the corner is beyond the tip before anything touches, g is the tip's depth in the side alone:
the tip meets the flat side first, at any 0 < theta < pi, upright on the fence or not.

The tip is on the side up to its far end, the next corner, and what it carries ends over l there.
Where the side falls below the fence, theta < 0, the next corner lies under the fence, and the tip
is under the side for as long as that corner's foot is on the fence: it came there from below, and
not through the side. Beyond it the next corner hands its own contact over to its own side. A side
that faces away, theta < -pi / 2, is not met.

A tip with an edge of the radius r ends in an arc about the point r behind the end of its face. Its
foremost point against the side is r m from there, so that the tip is inside the side by r (1 -
cos(theta)) more, and

    x = s - (D - r) tan(theta / 2)

where theta > 0; else the end of the face is foremost as before. The contact's line of action then
goes through the arc's centre, and meets the fence's line r tan(theta) beyond the tip: there it
loads the fence, continued along its tangent, up to r / LEAST_SHARE. For a corner on the arc itself,
D < r, the arc is replaced by its tangents with the normals n and m, whose intersection psi rounds
off: a sharp one would lie (1 / cos(theta / 2) - 1) (r - D) outside the arc.
"""

import functools
import operator
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from .fading import fade
from .kinematics import TipLoad, Touch


class Side(NamedTuple):
    """The side of the parcel behind a corner: its direction from there, (x, y) in fixed axes, and
    its length [m]; whether the corner at its other end can touch the fence; and the length [m] of
    the side before the corner, if the corner that begins it cannot touch the fence (else
    `None`)."""

    x: Array
    y: Array
    length: Array
    follows: bool = True
    before: Array | None = None


LEAST_SHARE = 0.1
"""Least share [1] of a contact force that bends the fence with which the place is computed where
the line of that force meets the fence: the place goes to infinity as the share goes to 0."""


def _smooth_minimum(x: Array, length: float) -> tuple[Array, Array]:
    """psi(x) [m], a smooth minimum of 0 and x over `length` on either side, and its derivative."""
    s = jnp.clip(0.5 * (x / length + 1), 0.0, 1.0)
    bend = 2 * length * (s - 0.5 - s**3 + 0.5 * s**4)
    return bend + jnp.minimum(x + length, 0.0), fade(x + length, 2 * length)


def _half_tangent(sine: Array, cosine: Array) -> Array:
    """tan(theta / 2) [1], finite where theta comes to pi."""
    away = cosine < 0
    over = jnp.where(away & (sine != 0), sine, 1.0)
    return jnp.where(away, (1 - cosine) / over, sine / (1 + jnp.maximum(cosine, 0.0)))


def around(
    touch: Touch,
    spin: Array,
    side: Side,
    edge: Array,
    length: float,
    radius: Array | None = None,
) -> Touch:
    """The `touch` of a corner near the tip: under the corner, at the tip, or between the two.

    `touch` is that of the corner against the straight line through the fence's point U; `spin`
    phidot [rad/s]; `edge` [m] the arc from U to the tip; `length` l [m] the smoothing; `radius`
    r [m] that of the tip's edge, `None` for a sharp one. The contact ends over l where the tip
    comes to the other end of the side, or the corner there to the tip: that corner takes over.
    """
    along_x, along_y, along_turn = touch.tangent
    up_x, up_y, up_turn = touch.normal
    depth, slip = touch.gap, touch.sliding
    sine = side.y * along_x - side.x * along_y
    cosine = side.y * up_x - side.x * up_y
    half = _half_tangent(sine, cosine)
    under = depth if radius is None else depth - jnp.where(sine > 0, radius, 0.0)
    before_tip = edge - touch.foot_offset
    least, share = _smooth_minimum(before_tip - half * under, length)
    # Derivatives of g in D, s and theta.
    by_depth = 1 - share * sine * half
    by_place = share * sine
    by_turn = cosine * least - share * half * under
    reached = under * sine - before_tip * cosine
    on_side = 1 - share * (1 - fade(reached - side.length + length, length))
    next_corner = jnp.minimum(before_tip, 0.0) + side.length * cosine
    lasting = jnp.where(sine > 0, on_side, fade(length - next_corner, length))
    across, along = touch.rates
    return Touch(
        gap=depth + sine * least,
        gap_rate=by_depth * touch.gap_rate - by_place * slip - by_turn * spin,
        sliding=by_depth * slip + by_place * touch.gap_rate,
        foot_offset=touch.foot_offset,
        normal=(
            by_depth * up_x + by_place * along_x,
            by_depth * up_y + by_place * along_y,
            by_depth * up_turn + by_place * along_turn + by_turn,
        ),
        tangent=(
            by_depth * along_x - by_place * up_x,
            by_depth * along_y - by_place * up_y,
            by_depth * along_turn - by_place * up_turn,
        ),
        rates=(by_depth * across + by_place * along, by_depth * along - by_place * across),
        tip_load=TipLoad(
            by_depth, (depth * by_place + by_turn) / jnp.maximum(by_depth, LEAST_SHARE)
        ),
        lasting=lasting,
        missed=_missed(side, depth, before_tip, sine, cosine),
    )


def _missed(side: Side, depth: Array, before_tip: Array, sine: Array, cosine: Array):
    """1.0 where a neighbouring corner that cannot touch the fence is lower than this one and under
    the fence, or its side under the tip, else 0.0; `None` where both neighbours can. The fence is
    continued along its tangent.
    """
    found = []
    if not side.follows:
        under = depth - side.length * sine > 0
        found.append((sine < 0) & under & (before_tip + side.length * cosine > 0))
    if side.before is not None:
        on_fence = before_tip - side.before * sine > 0
        corner, tip = depth - side.before * cosine, depth * sine - before_tip * cosine
        inside = jnp.where(on_fence, corner, tip) > 0
        found.append((cosine < 0) & (before_tip > 0) & inside)
    if not found:
        return None
    return functools.reduce(operator.or_, found).astype(depth.dtype)
