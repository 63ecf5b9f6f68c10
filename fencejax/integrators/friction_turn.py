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

Where a wall lies on the fence, its corners turn round within the same step, and the jump of one
changes the sliding of the other. A jump that alone would change this sliding by C in a whole step,
and that comes after the share theta' of it, counts in J as

    C (1 - theta') / (1 - theta)  where it is later,   C theta' / theta  where it is sooner:

all of it where both come at once, none where the other turns at an end of the step.

From near rest on, where smoothed friction itself turns, dw / dt = beta / h + J u(w) / h is solved:
u = (1 - w / sqrt(w^2 + eps^2)) / 2 is the share of the jump still to come, w counted the way the
corner leaves, and beta [m/s] the change of w in a step under the friction it ends with. Beyond
beta the sliding gains

    G = integral of J u / (beta + J u) dw
      = J / (beta + J) / 2 [z + J eps / q atan(q z / (beta eps))]  from z_1 to z_0,

with z = sqrt(w^2 + eps^2) - w and q^2 = beta (beta + J). beta is that of friction unsmoothed,
beta (beta + J) = J (w_1 - w_0) + beta (w_1 - w_0) - J max(-w_0, 0).

A corner that slides at the start and has turned round leaves later than it comes to rest: while it
is near rest, smoothed friction is still in part what it was before. By that it has gained

    D = integral of J u / (beta + J u) dw from 0 to b,  of which  b J u(b) / (beta + J u(b))

is counted already, as friction at the step's end acts from theta on. What is left, E, is added, and
theta is that of the speed b - E. Where a step ends within ten eps of rest, the derivative of b
would lack it by J u / beta without, and the next step, in which friction goes on to turn, begin
with that. Where beta is 0, which holds a corner, E is none. With friction of other corners in J,
the corner's own has its share of E.

How far the parcel goes meanwhile is in `corner_way`, and the means of frictions that the formulas
above are made of in `sliding_corner`.
"""

import functools
import itertools
from collections.abc import Callable
from typing import NamedTuple

import jax
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


class _Rest(NamedTuple):
    """When a corner comes to rest: after the share `until` of the step, with its slopes `by_jump`
    and `by_back` [s/m] with J and b."""

    until: Array
    by_jump: Array
    by_back: Array


def _rest(corner: Corner, jump: Array, late: Array | float = 0.0) -> _Rest:
    """theta, for what friction's `jump` changes the sliding by in a whole step, J [m/s], and where
    the corner leaves faster by E for friction that turns `late` [m/s]."""
    fast = jnp.abs(corner.start.speed)
    back = jnp.maximum(-jnp.sign(corner.start.speed) * corner.after, 0.0) - late
    root = jnp.sqrt((jump - fast + back) ** 2 + 4 * fast * back + corner.eps**2)
    whole = jump + fast + back + root
    until = 2 * fast / whole
    by_jump = -until / whole * (1 + (jump - fast + back) / root)
    return _Rest(until, by_jump, jnp.where(back > 0, -until / root, 0.0))


def _change(corner: Corner, on: Counted) -> Array:
    """What the friction of a corner that slides on as `on` says (`straight`) changes by as it
    turns, as a share of the normal force [1]."""
    return corner.end.share - 0.5 * on.share


def _from_sliding(corner: Corner, on: Counted, others: Array | float = 0.0) -> Counted:
    """Of a corner that slides at the start, first as `on` says (`straight`). Frictions of `others`
    that turn with its own change its sliding by that in a whole step [m/s]."""
    before, after, gain = corner.start.speed, corner.after, corner.gain
    sign, fast, eps = jnp.sign(before), jnp.abs(before), corner.eps
    onward = jnp.maximum(sign * after, 0.0)
    there = corner.end
    here, here_slope = 0.5 * on.share, 0.5 * on.slope
    drop = jnp.maximum(sign * _change(corner, on), 0.0)
    jump = jnp.maximum(gain * drop + sign * others, 0.0)
    falls = jnp.where((drop > 0) & (jump > 0), sign * (there.slope - here_slope), 0.0)
    late, later = jax.jvp(
        functools.partial(_late, fast, eps),
        (jnp.maximum(-sign * after, 0.0), 2 * gain * there.mu, jump),
        (jnp.where(sign * after < 0, -sign, 0.0), 2 * gain * there.mu_slope, gain * falls),
    )
    until, by_jump, by_back = _rest(corner, jump, late)
    twice = 2 * (until * here + (1 - until) * there.share)
    slope = 2 * (until * here_slope + (1 - until) * there.slope)
    by_after = by_jump * gain * falls - by_back * (sign + later)
    slope = slope - 2 * sign * drop * by_after
    per = sign * jnp.where(gain > 0, 2 / jnp.where(gain > 0, gain, 1.0), 0.0)
    twice, slope = twice - per * late, slope - per * later
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


def _passed(
    eps: float, pull: Array, jump: Array, between: tuple[Array | float, Array], apart: Array
) -> Array:
    """2 G / J, for z `between` z_0 and z_1, which are `apart` [m/s]; beta is the `pull` [m/s]."""
    z0, z1 = between
    both = pull + jump
    mean = jnp.sqrt(pull * both)
    angle = arctan(mean * eps * apart / (pull * eps * eps + both * z0 * z1))
    return (apart + jump * eps / mean * angle) / both


def _late(fast: Array, eps: float, back: Array, own: Array, jump: Array) -> Array:
    """E [m/s] of a corner that slides as `fast` at the start and leaves at the speed `back`, b.
    Friction that turns changes the sliding by `own` in a whole step, unsmoothed, and with that of
    others by `jump`, smoothed as at b."""
    least = 1e-3 * eps
    ending = jnp.sqrt(back * back + eps * eps)
    still = 0.5 * (1 - back / ending)
    jump = jump + own * still
    excess = fast + back - jump
    root = jnp.sqrt(excess * excess + 4 * jump * back + least * least)
    pull = jnp.maximum(0.5 * (excess + root), least)
    apart = 2 * eps * back / (eps + back + ending)
    gained = 0.5 * _passed(eps, pull, jump, (eps, eps * eps / (ending + back)), apart)
    onward = pull + jump * still
    left = own * (gained - back * still / onward)
    # The step's equation takes a small speed that is added for a later turn: to the first order, so
    # much more is.
    return left * (1 + jump * still / onward)


class _Held(NamedTuple):
    """What is counted of a held corner's friction: its share, and its slope with the sliding speed
    [s/m], and what of the share makes the sliding gain G."""

    share: Array
    slope: Array
    gained: Array


def _from_hold(corner: Corner) -> _Held:
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
    ending = jnp.sqrt(fast * fast + eps * eps)
    z0, z1 = jnp.sqrt(slow * slow + eps * eps) - slow, ending - fast
    apart = jnp.maximum(z0 - z1, 0.0)
    added = _passed(eps, pull, jump, (z0, z1), apart)
    still = 0.5 * z1 / ending * jump
    slope = still / (pull + still) - 0.5 * jump * added / root
    slope = jnp.where((apart > 0) & (gain > 0), slope / jnp.where(gain > 0, gain, 1.0), 0.0)
    falls = jnp.where(some, there.share - corner.share, 0.0)
    steeper = jnp.where(some, there.slope - corner.slope, 0.0)
    gained = 2 * ahead * mu * added
    return _Held(gained + 2 * falls, 2 * (slope + steeper), gained)


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
    corners: dict[int, Corner] = {}
    smoothing = mechanics.fidelity.smoothing
    weights = friction_tangent.by_contact(mechanics, sticking)
    for k, (meeting, friction, first, start) in enumerate(
        zip(forces.meetings, mechanics.frictions, pressed, starts, strict=True)
    ):
        if friction is None or start is None:
            continue
        what, parts, _, response = meeting
        assert response is not None
        assert first is not None
        gain = step * mechanics.lightness(parts) * 0.5 * (first + what.normal)
        corners[k] = Corner(
            start, what.sliding, response.share, response.sliding,
            mean_friction(friction, what.sliding, smoothing), gain, smoothing.slip_speed,
        )  # fmt: skip
    free = {k: 1 - weights[k] for k in corners}
    ons = {k: straight(corner) for k, corner in corners.items()}
    changes = {k: _change(corner, ons[k]) for k, corner in corners.items()}
    coupled = _coupled(mechanics, forces, corners, changes)
    of_others = _by_others(coupled, {k: free[k] * changes[k] for k in corners}, _together)
    sliding = {k: _from_sliding(corner, ons[k], of_others[k]) for k, corner in corners.items()}
    holding = {k: _from_hold(corner) for k, corner in corners.items()}
    counted = {
        k: Counted(
            free[k] * sliding[k].share + weights[k] * holding[k].share,
            free[k] * sliding[k].slope + weights[k] * holding[k].slope,
        )
        for k in corners
    }
    means = {
        k: 0.5 * (corner.start.share + corner.share + counted[k].share)
        for k, corner in corners.items()
    }
    more = {k: free[k] * (0.5 * ons[k].share - means[k]) for k in corners}
    of_others = _by_others(coupled, more, _before)
    found: list[Turn | None] = []
    for k, (meeting, first) in enumerate(zip(forces.meetings, pressed, strict=True)):
        if k not in corners:
            found.append(None)
            continue
        assert first is not None
        (what, *_), corner, weight = meeting, corners[k], weights[k]
        share, slope = counted[k]
        normal = 0.5 * (first + what.normal)
        # The step's equations count friction at either end by the normal force there; a corner that
        # was held has that of the end throughout.
        grown = what.normal - normal
        apart = free[k] * (corner.start.share - corner.share)
        added = normal * share + grown * apart
        slope = normal * slope - grown * free[k] * corner.slope
        early = free[k] * comes_to_rest(
            corner, ons[k], means[k], (first, what.normal), of_others[k]
        )
        early = early + weight * normal * settles(corner, holding[k].gained)
        found.append(Turn(added, 0.5 * (share + apart), slope, early))
    return found


def _together(until: Array, other: Array) -> Array:
    """How much of the jump of a friction that turns after the share `other` of the step counts as
    one of a corner's own that turns at `until`."""
    later = other >= until
    rest = jnp.where(later & (until < 1), 1 - until, 1.0)
    return jnp.where(later, (1 - other) / rest, other / jnp.where(later, 1.0, until))


def _before(until: Array, other: Array) -> Array:
    """How much of what a friction that turns after the share `other` of the step is above its mean
    until then acts until a corner comes to rest, at `until`."""
    sooner = other < until
    without = (until - other) / jnp.where(sooner, until, 1.0) / jnp.where(sooner, 1 - other, 1.0)
    return jnp.where(sooner, 1 - without, 1.0)


class _Coupled(NamedTuple):
    """Corners that slide on one surface: after which share of the step each comes to `rest` by its
    own friction, and by how much friction of mu = 1 at the second of a pair changes the sliding of
    the first in a whole step, `across` [m/s]; nothing for a corner alone."""

    rest: dict[int, Array]
    across: dict[tuple[int, int], Array]


def _coupled(
    mechanics: Mechanics, forces: Forces, corners: dict[int, Corner], changes: dict[int, Array]
) -> _Coupled:
    """Of corners whose frictions change by these shares of their normal forces as they turn."""
    across = {}
    for k, j in itertools.permutations(corners, 2):
        one, other = forces.meetings[k].touch, forces.meetings[j].touch
        share = mechanics.lightness(one, other) / mechanics.lightness(other)
        across[k, j] = share * corners[j].gain
    rest = {}
    if across:
        for k, corner in corners.items():
            rest[k] = _rest(corner, corner.gain * jnp.abs(changes[k])).until
    return _Coupled(rest, across)


def _by_others(
    coupled: _Coupled, changes: dict[int, Array], counts: Callable[[Array, Array], Array]
) -> dict[int, Array | float]:
    """What frictions of other corners change each corner's sliding by in a whole step [m/s], where
    they are more by these `changes`, as shares of their normal forces: as much of it as `counts`
    for the instants at which that corner and the other come to rest."""
    found: dict[int, Array | float] = dict.fromkeys(changes, 0.0)
    for (k, j), across in coupled.across.items():
        share = counts(coupled.rest[k], coupled.rest[j])
        found[k] = found[k] + share * across * changes[j]
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
