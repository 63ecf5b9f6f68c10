"""Friction that turns round within a step, and from when on it counts the other way.

Where a corner's sliding comes to rest within a step and goes on the other way, dry friction jumps
then from -mu N s to +mu N s, with s the sign of the sliding before. The trapezoidal rule counts
half of each whenever that is: an error of the first order in the step, and a derivative that lacks
the instant's own. So friction counts with its value at the start for the share theta [1] of the
step before the corner comes to rest, and with that at the end for the rest.

The normal force N goes straight from N_0 to N_1 meanwhile, and may double. What moves a corner in a
blow grows with it: so time is told by the impulse of N, of which theta is the share, and friction
counts as a share of N by N_m = (N_0 + N_1) / 2. With the sliding speed w straight in the impulse on
either side of rest, w_0 = a s at the start, w_1 = -b s at the end, and J [m/s] what the jump of
friction under N_m changes the sliding by in a whole step,

    J theta (1 - theta) = a (1 - theta) - b theta.

A corner that comes to rest at the end has b = 0, and theta = min(a / J, 1). In time it is at rest
after the share t of the step in which N has given that impulse,

    t = 2 N_m theta / (N_0 + N_t),   N_t^2 = N_0^2 + theta (N_1^2 - N_0^2).

From near rest on, where smoothed friction itself turns, dw / dt = beta / h + J u(w) / h is solved:
u = (1 - w / sqrt(w^2 + eps^2)) / 2 is the share of the jump still to come, w counted the way the
corner leaves, and beta [m/s] the change of w in a step under the friction it ends with. Beyond
beta the sliding gains

    G = integral of J u / (beta + J u) dw
      = J / (beta + J) / 2 [z + J eps / q atan(q z / (beta eps))]  from z_1 to z_0,

with z = sqrt(w^2 + eps^2) - w and q^2 = beta (beta + J). beta is that of friction unsmoothed,
beta (beta + J) = J (w_1 - w_0) + beta (w_1 - w_0) - J max(-w_0, 0).

How far the parcel goes meanwhile is in `corner_way`, and the means of frictions that the formulas
above are made of in `sliding_corner`.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from .._elementary import arctan
from ..model import Acceleration, Forces, Mechanics
from . import friction_tangent
from .corner_way import comes_to_rest, settles
from .sliding_corner import Corner, Counted, Start, mean_friction, passed, straight


class Turn(NamedTuple):
    """What a turn within the step adds to twice the mean friction over it: the force `added` [N],
    the `share` [1] of the normal force at the step's end by which it grows with that, and its
    `slope` with the sliding speed [N s/m]. And the force `early` [N]: the acceleration by it, times
    h^2, is how much further the parcel goes for it."""

    added: Array
    share: Array
    slope: Array
    early: Array


def _from_sliding(corner: Corner) -> Counted:
    """Of a corner that slides at the start: theta."""
    before, after, gain = corner.start.speed, corner.after, corner.gain
    sign, fast, eps = jnp.sign(before), jnp.abs(before), corner.eps
    onward = jnp.maximum(sign * after, 0.0)
    on, there = straight(corner), corner.end
    here, here_slope = 0.5 * on.share, 0.5 * on.slope
    # What friction changes by, as a share of the normal force.
    drop = jnp.maximum(sign * (there.share - here), 0.0)
    jump = gain * drop
    back = jnp.maximum(-sign * after, 0.0)
    root = jnp.sqrt((jump - fast + back) ** 2 + 4 * fast * back + eps * eps)
    whole = jump + fast + back + root
    until = 2 * fast / whole
    by_jump = -until / whole * (1 + (jump - fast + back) / root)
    by_back = jnp.where(back > 0, -until / root, 0.0)
    twice = 2 * (until * here + (1 - until) * there.share)
    by_drop = gain * by_jump * jnp.where(drop > 0, sign * (there.slope - here_slope), 0.0)
    slope = 2 * (until * here_slope + (1 - until) * there.slope)
    slope = slope - 2 * sign * drop * (by_drop - sign * by_back)
    # None of it where the corner slides on, nor where it hardly slows down.
    near = onward * onward + eps * eps
    slowed = jnp.maximum(1 - onward / jnp.where(fast > 0, fast, 1.0), 0.0)
    rests = eps * eps / near
    ends = rests * slowed * slowed
    fades = -2 * rests * slowed * (slowed * onward / near + 1 / jnp.where(fast > 0, fast, 1.0))
    fades = jnp.where(onward > 0, sign * fades, 0.0)
    slope = on.slope + ends * (slope - on.slope) + fades * (twice - on.share)
    twice = on.share + ends * (twice - on.share)
    some = jnp.abs(sign)
    return Counted(
        some * (twice - corner.start.share - corner.share), some * (slope - corner.slope)
    )


def _from_hold(corner: Corner) -> Counted:
    """Of a corner near rest at the start: G, the step's end counting by itself."""
    before, after, gain, eps = corner.start.speed, corner.after, corner.gain, corner.eps
    some, there = passed(corner)
    mu = jnp.where(some, there.mu, corner.end.mu)
    ahead = jnp.where(after < 0, -1.0, 1.0)
    slow, fast = ahead * before, ahead * after
    least = 1e-3 * eps
    jump, back = 2 * mu * gain, jnp.maximum(-slow, 0.0)
    on = jnp.maximum(fast - jnp.maximum(slow, 0.0), least)
    root = jnp.sqrt((jump - back - on) ** 2 + 4 * on * jump + least * least)
    pull = jnp.maximum(0.5 * (root - jump + back + on), least)
    both = pull + jump
    ending = jnp.sqrt(fast * fast + eps * eps)
    z0, z1 = jnp.sqrt(slow * slow + eps * eps) - slow, ending - fast
    apart = jnp.maximum(z0 - z1, 0.0)
    mean = jnp.sqrt(pull * both)
    angle = arctan(mean * eps * apart / (pull * eps * eps + both * z0 * z1))
    added = (apart + jump * eps / mean * angle) / both
    still = 0.5 * z1 / ending * jump
    slope = still / (pull + still) - 0.5 * jump * added / root
    slope = jnp.where((apart > 0) & (gain > 0), slope / jnp.where(gain > 0, gain, 1.0), 0.0)
    falls = jnp.where(some, there.share - corner.share, 0.0)
    steeper = jnp.where(some, there.slope - corner.slope, 0.0)
    return Counted(2 * (ahead * mu * added + falls), 2 * (slope + steeper))


def turns(
    mechanics: Mechanics,
    forces: Forces,
    sticking: tuple[Array, ...],
    pressed: tuple[Array | None, ...],
    starts: tuple[Start | None, ...],
    step: Array,
) -> list[Turn | None]:
    """Of each contact, what the turn of its friction adds; `None` where `starts` has none. The
    weights `sticking` tell which corners friction held at the start, and the forces `pressed` [N]
    how they were pressed there."""
    found: list[Turn | None] = []
    smoothing = mechanics.fidelity.smoothing
    weights = friction_tangent.spread(mechanics, sticking)
    for meeting, friction, weight, first, start in zip(
        forces.meetings, mechanics.frictions, weights, pressed, starts, strict=True
    ):
        if friction is None or start is None:
            found.append(None)
            continue
        what, parts, _, response = meeting
        assert response is not None
        assert first is not None
        normal = 0.5 * (first + what.normal)
        gain = step * mechanics.lightness(parts) * normal
        corner = Corner(
            start, what.sliding, response.share, response.sliding,
            mean_friction(friction, what.sliding, smoothing), gain, smoothing.slip_speed,
        )  # fmt: skip
        sliding, held = _from_sliding(corner), _from_hold(corner)
        share, slope = (
            (1 - weight) * a + weight * b for a, b in zip(sliding, held, strict=True)
        )
        # The step's equations count friction at either end by the normal force there; a corner that
        # was held has that of the end throughout.
        free, grown = 1 - weight, what.normal - normal
        apart = free * (start.share - response.share)
        added = normal * share + grown * apart
        slope = normal * slope - grown * free * response.sliding
        early = comes_to_rest(
            corner, 0.5 * (start.share + response.share + share), (first, what.normal)
        )
        early = free * early + weight * normal * settles(corner, held.share)
        found.append(Turn(added, 0.5 * (share + apart), slope, early))
    return found


def shares(forces: Forces, turns: list[Turn | None]) -> list[Array]:
    """Of each contact, how much the friction that counts grows with the normal force at a step's
    end [1]."""
    return [
        meeting.response.share + (0.0 if turn is None else turn.share)
        for meeting, turn in zip(forces.meetings, turns, strict=True)
        if meeting.response is not None
    ]


def _pushed(
    mechanics: Mechanics, forces: Forces, pushes: list[Array | None]
) -> Acceleration | None:
    """The acceleration by these `pushes` [N] along the surfaces; `None` without any."""
    total = None
    for (_, parts, _, _), push in zip(forces.meetings, pushes, strict=True):
        if push is not None:
            more = [push * t for t in parts.tangent]
            total = more if total is None else [q + f for q, f in zip(total, more, strict=True)]
    return None if total is None else mechanics.acceleration(*total)


def turned(
    mechanics: Mechanics, forces: Forces, turns: list[Turn | None], end: Acceleration
) -> Acceleration:
    """The acceleration at the `end` of a step with what the turns add to it."""
    more = _pushed(mechanics, forces, [turn and turn.added for turn in turns])
    return end if more is None else Acceleration(*map(jnp.add, end, more))


def way(
    mechanics: Mechanics,
    forces: Forces,
    turns: list[Turn | None],
    holds: list[Array] | None,
    step: Array,
) -> Acceleration | None:
    """How much further than by the step's cubic the parcel goes (x, y [m], angle [rad]) in a step
    in which corners come to rest or turn round, and in one in which they are held and the
    acceleration by frictions that hold changes by `holds`; `None` where no corner has friction."""
    if holds is None:
        return None
    further = [f / 6 for f in holds]
    more = _pushed(mechanics, forces, [turn and turn.early for turn in turns])
    if more is not None:
        further = map(jnp.add, further, more)
    return Acceleration(*(step**2 * a for a in further))
