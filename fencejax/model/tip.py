"""The fence's tip against the parcel's side: how a contact goes on when a corner runs over the tip.

A corner C inside the fence by D, at the arc coordinate R_z - s, meets the fence along its normal n.
The side of the parcel behind it, from this corner to the next one, has the inward normal m, turned
from n towards the tip by theta: m = n cos(theta) + t sin(theta). The tip is inside that side by
D cos(theta) + s sin(theta), which is less than D where s < D tan(theta / 2). There the tip carries
the contact, along m. Both are one gap,

    g = D + sin(theta) psi(x),   x = s - D tan(theta / 2),

with psi(x) = 0 for x >= l, x for x <= -l and a smooth lesser of the two between them, so that the
force is N times the gradient of g: it does work like a spring, and has a continuous derivative.

A tip with an edge of the radius r ends in an arc about the point r behind the end of its face. Its
foremost point against the side is r m from there, so that the tip is inside the side by r (1 -
cos(theta)) more, and

    x = s - (D - r) tan(theta / 2)

where theta > 0; else the end of the face is foremost as before. The contact's line of action then
goes through the arc's centre, and meets the fence's line r tan(theta) beyond the tip: there it
loads the fence, continued along its tangent. A corner that is itself on the arc, less deep than r,
is met by the arc's tangents at n and m, rounded as psi rounds them: without that by (1 / cos(theta
/ 2) - 1) (r - D) too much.

A side that stands upright on the fence, or faces away from it, is not met by the tip: what the tip
carries ends between cos(theta) = 0.2 and 0.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from .contact import fade
from .kinematics import Lean, Touch


class Side(NamedTuple):
    """The side of the parcel behind a corner: its direction from there, (x, y) in fixed axes, and
    its length [m]."""

    x: Array
    y: Array
    length: Array


UPRIGHT = 0.2
"""cos(theta) [1] from which on what the tip carries ends."""


def _lesser(x: Array, length: float) -> tuple[Array, Array]:
    """psi(x) [m], a smooth lesser of 0 and x over `length` on either side, and its derivative."""
    s = jnp.clip(0.5 * (x / length + 1), 0.0, 1.0)
    bend = 2 * length * (s - 0.5 - s**3 + 0.5 * s**4)
    return bend + jnp.minimum(x + length, 0.0), fade(x + length, 2 * length)


def around(
    touch: Touch,
    spin: Array,
    side: Side,
    edge: Array,
    length: float,
    radius: Array | None = None,
) -> Touch:
    """A corner's `touch` as it is near the tip: under the corner, at the tip, or between the two.

    `touch` is that of the corner against the straight line through the fence's point U; `spin`
    phidot [rad/s]; `edge` [m] the arc from U to the tip; `length` l [m] the smoothing; `radius`
    r [m] that of the tip's edge, `None` for a sharp one. The contact ends over l where the tip
    comes to the far end of the side. There the next corner takes over; where the side stands
    upright, the one before it.
    """
    along_x, along_y, along_turn = touch.tangent
    up_x, up_y, up_turn = touch.normal
    depth, slip = touch.gap, touch.sliding
    sine = side.y * along_x - side.x * along_y
    cosine = side.y * up_x - side.x * up_y
    half = sine / jnp.maximum(1 + cosine, 0.1)
    under = depth if radius is None else depth - jnp.where(sine > 0, radius, 0.0)
    before_tip = edge - touch.foot_offset
    lesser, share = _lesser(before_tip - half * under, length)
    # Derivatives of g in D, s and theta.
    by_depth = 1 - share * sine * half
    by_place = share * sine
    by_turn = cosine * lesser - share * half * under
    reached = under * sine - before_tip * cosine
    on_side = 1 - share * (1 - fade(reached - side.length + length, length))
    facing = 1 - share * fade(cosine, UPRIGHT)
    across, along = touch.rates
    return Touch(
        gap=depth + sine * lesser,
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
        lean=Lean(by_depth, (depth * by_place + by_turn) / jnp.maximum(by_depth, 0.1)),
        lasting=(on_side, facing),
    )
