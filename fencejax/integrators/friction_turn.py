"""Friction that reverses within a step, as a corner's sliding reverses.

Where a corner's sliding comes to rest within a step and goes on the other way, dry friction jumps
at that instant from -mu N s to +mu N s, with s the sign of the sliding before. The trapezoidal rule
takes the mean of the two wherever in the step the instant is: an error of the first order in the
step, and a derivative without that of the instant. So here friction acts with its value at the
start for the share theta [1] of the step, until the corner comes to rest, and with its value at the
end from then on.

Meanwhile the normal force N changes linearly from N_0 to N_1, and may double. The forces that
accelerate a corner in a blow grow with N, so progress in the step is measured by the impulse of N:
theta is a share of that impulse, and friction acts as a share of the mean force
N_m = (N_0 + N_1) / 2. The sliding speed w is taken as linear in the impulse before and after rest,
w_0 = a s at the start and w_1 = -b s at the end. With J [m/s] the change of w that the jump of
friction under N_m makes in a whole step,

    J theta (1 - theta) = a (1 - theta) - b theta.

A corner that comes to rest at the end has b = 0, and theta = min(a / J, 1). In time it is at rest
after the share t of the step in which N has given that impulse,

    t = 2 N_m theta / (N_0 + N_t),   N_t^2 = N_0^2 + theta (N_1^2 - N_0^2).

Where a wall lies on the fence, both of its corners may reverse within the same step, and the jump
of one changes the sliding of the other. A jump that alone would change this sliding by C in a whole
step, and that comes after the share theta' of it, adds to J

    C (1 - theta') / (1 - theta)  where it is later,   C theta' / theta  where it is sooner:

all of C where both come at once, nothing where the other corner reverses at an end of the step.

From near rest on, where smoothed friction reverses gradually, dw / dt = beta / h + J u(w) / h is
solved: u = (1 - w / sqrt(w^2 + eps^2)) / 2 is the share of the jump still to come, w is positive
in the direction in which the corner leaves, and beta [m/s] is the change of w in a step under the
friction at its end. In addition to beta the sliding speed gains

    G = integral of J u / (beta + J u) dw
      = J / (beta + J) / 2 [z + J eps / q atan(q z / (beta eps))]  from z_1 to z_0,

with z = sqrt(w^2 + eps^2) - w and q^2 = beta (beta + J). beta is that of friction unsmoothed,
beta (beta + J) = J (w_1 - w_0) + beta (w_1 - w_0) - J max(-w_0, 0).

A corner that slides at the start and has reversed at the end leaves later than it comes to rest:
while it is near rest, smoothed friction still has part of its former direction. By that it gains

    D = integral of J u / (beta + J u) dw from 0 to b,  of which  b J u(b) / (beta + J u(b))

is included already, as friction at the step's end acts from theta on. The rest, E, is added, and
theta is that of the speed b - E. Without E, the derivative of b would be off by J u / beta where a
step ends within ten eps of rest, and the next step, in which friction goes on to reverse, would
begin with that error. Where beta is 0, friction stops the corner for good, and E is 0. Where
frictions of other corners contribute to J, the corner's own friction has its share of E.

The parcel's displacement meanwhile is in `corner_way`, and the mean frictions that the formulas
above are made of are in `sliding_corner`.
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
from .sliding_corner import Corner, MeanShare, Start, linear_mean, mean_friction, mean_over_step


class Turn(NamedTuple):
    """What a reversal within the step adds to the step's equations.

    `added` [N] is added to twice the mean friction over the step; it grows with the normal force at
    the step's end by the `share` [1] of that, and with the sliding speed by `slope` [N s/m]. The
    acceleration by the force `displacing` [N], times h^2, is added to the displacement.
    """

    added: Array
    share: Array
    slope: Array
    displacing: Array


class _TimeOfRest(NamedTuple):
    """The share `until` of the step after which a corner comes to rest, and its derivatives
    `by_jump` and `by_back` [s/m] in J and b."""

    until: Array
    by_jump: Array
    by_back: Array


def _time_of_rest(corner: Corner, jump: Array, late: Array | float = 0.0) -> _TimeOfRest:
    """theta, from the change of the sliding speed J [m/s] that friction's `jump` makes in a whole
    step; smoothed friction, which reverses late, makes the corner leave faster by `late`, E
    [m/s]."""
    fast = jnp.abs(corner.start.speed)
    back = jnp.maximum(-jnp.sign(corner.start.speed) * corner.after, 0.0) - late
    root = jnp.sqrt((jump - fast + back) ** 2 + 4 * fast * back + corner.eps**2)
    whole = jump + fast + back + root
    until = 2 * fast / whole
    by_jump = -until / whole * (1 + (jump - fast + back) / root)
    return _TimeOfRest(until, by_jump, jnp.where(back > 0, -until / root, 0.0))


def _change(corner: Corner, linear: MeanShare) -> Array:
    """The change of friction at the reversal, as a share of the normal force [1]."""
    return corner.end.share - 0.5 * linear.share


def _from_sliding(corner: Corner, linear: MeanShare, others: Array | float = 0.0) -> MeanShare:
    """The friction that a reversal adds for a corner that slides at the start, with the mean
    friction `linear` (`linear_mean`) until it is at rest. Frictions of `others` that reverse in the
    same step change its sliding speed by that much in a whole step [m/s]."""
    before, after, gain = corner.start.speed, corner.after, corner.gain
    sign, fast, eps = jnp.sign(before), jnp.abs(before), corner.eps
    onward = jnp.maximum(sign * after, 0.0)
    there = corner.end
    here, here_slope = 0.5 * linear.share, 0.5 * linear.slope
    drop = jnp.maximum(sign * _change(corner, linear), 0.0)
    jump = jnp.maximum(gain * drop + sign * others, 0.0)
    falls = jnp.where((drop > 0) & (jump > 0), sign * (there.slope - here_slope), 0.0)
    late, later = jax.jvp(
        functools.partial(_late_gain, fast, eps),
        (jnp.maximum(-sign * after, 0.0), 2 * gain * there.mu, jump),
        (jnp.where(sign * after < 0, -sign, 0.0), 2 * gain * there.mu_slope, gain * falls),
    )
    until, by_jump, by_back = _time_of_rest(corner, jump, late)
    twice = 2 * (until * here + (1 - until) * there.share)
    slope = 2 * (until * here_slope + (1 - until) * there.slope)
    by_after = by_jump * gain * falls - by_back * (sign + later)
    slope = slope - 2 * sign * drop * by_after
    per = sign * jnp.where(gain > 0, 2 / jnp.where(gain > 0, gain, 1.0), 0.0)
    twice, slope = twice - per * late, slope - per * later
    # Nothing is added where the corner slides on, nor where it hardly slows down.
    rests = eps * eps / (onward * onward + eps * eps)
    per_speed = 1 / jnp.where(fast > 0, fast, 1.0)
    slowed = jnp.maximum(1 - onward * per_speed, 0.0)
    ends = rests * slowed * slowed
    fades = -2 * rests * slowed * (slowed * onward * rests / (eps * eps) + per_speed)
    fades = jnp.where(onward > 0, sign * fades, 0.0)
    slope = linear.slope + ends * (slope - linear.slope) + fades * (twice - linear.share)
    twice = linear.share + ends * (twice - linear.share)
    slides = jnp.abs(sign)
    return MeanShare(
        slides * (twice - corner.start.share - corner.share), slides * (slope - corner.slope)
    )


def _gain_integral(
    eps: float, pull: Array, jump: Array, between: tuple[Array | float, Array], apart: Array
) -> Array:
    """2 G / J, for z `between` z_0 and z_1, whose difference is `apart` [m/s]; `pull` is beta
    [m/s]."""
    z0, z1 = between
    both = pull + jump
    mean = jnp.sqrt(pull * both)
    angle = arctan(mean * eps * apart / (pull * eps * eps + both * z0 * z1))
    return (apart + jump * eps / mean * angle) / both


def _late_gain(fast: Array, eps: float, back: Array, own: Array, jump: Array) -> Array:
    """E [m/s] of a corner that slides at the speed `fast` at the start and at `back`, b, at the
    end.

    The reversal of friction changes its sliding speed in a whole step by `own`, unsmoothed, and
    with the frictions of other corners by `jump`, smoothed as at b.
    """
    least = 1e-3 * eps
    ending = jnp.sqrt(back * back + eps * eps)
    still = 0.5 * (1 - back / ending)
    jump = jump + own * still
    excess = fast + back - jump
    root = jnp.sqrt(excess * excess + 4 * jump * back + least * least)
    pull = jnp.maximum(0.5 * (excess + root), least)
    apart = 2 * eps * back / (eps + back + ending)
    gained = 0.5 * _gain_integral(eps, pull, jump, (eps, eps * eps / (ending + back)), apart)
    per_speed = still / (pull + jump * still)
    left = own * (gained - back * per_speed)
    # The step's equations damp a speed that is added near rest: this factor compensates for that
    # to the first order.
    return left * (1 + jump * per_speed)


class _FromRest(NamedTuple):
    """The friction added for a corner near rest at the start: its `share` of the normal force, its
    `slope` with the sliding speed [s/m], and the part `gained` of the share by which w gains G."""

    share: Array
    slope: Array
    gained: Array


def _from_rest(corner: Corner) -> _FromRest:
    """The friction that is added to that at the step's end for a corner near rest at the start."""
    before, after, gain, eps = corner.start.speed, corner.after, corner.gain, corner.eps
    some, there = mean_over_step(corner)
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
    added = _gain_integral(eps, pull, jump, (z0, z1), apart)
    still = 0.5 * z1 / ending * jump
    slope = still / (pull + still) - 0.5 * jump * added / root
    slope = jnp.where((apart > 0) & (gain > 0), slope / jnp.where(gain > 0, gain, 1.0), 0.0)
    falls = jnp.where(some, there.share - corner.share, 0.0)
    steeper = jnp.where(some, there.slope - corner.slope, 0.0)
    gained = 2 * ahead * mu * added
    return _FromRest(gained + 2 * falls, 2 * (slope + steeper), gained)


def turns(
    mechanics: Mechanics,
    forces: Forces,
    sticking: tuple[Array, ...],
    pressed: tuple[Array | None, ...],
    starts: tuple[Start | None, ...],
    step: Array,
) -> list[Turn | None]:
    """What the reversal of each contact's friction adds; `None` where `starts` has none. `sticking`
    are the contacts' weights, 1 for a corner that sticks at the step's start, and `pressed` [N] the
    normal forces there."""
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
    sliding_weight = {k: 1 - weights[k] for k in corners}
    linear = {k: linear_mean(corner) for k, corner in corners.items()}
    changes = {k: _change(corner, linear[k]) for k, corner in corners.items()}
    coupled = _coupled(mechanics, forces, corners, changes)
    jumps = {k: sliding_weight[k] * changes[k] for k in corners}
    by_others = _by_others(coupled, jumps, _acts_with)
    sliding = {k: _from_sliding(corner, linear[k], by_others[k]) for k, corner in corners.items()}
    resting = {k: _from_rest(corner) for k, corner in corners.items()}
    added_shares = {
        k: MeanShare(
            sliding_weight[k] * sliding[k].share + weights[k] * resting[k].share,
            sliding_weight[k] * sliding[k].slope + weights[k] * resting[k].slope,
        )
        for k in corners
    }
    means = {
        k: 0.5 * (corner.start.share + corner.share + added_shares[k].share)
        for k, corner in corners.items()
    }
    extra = {k: sliding_weight[k] * (0.5 * linear[k].share - means[k]) for k in corners}
    by_others = _by_others(coupled, extra, _acts_before_rest)
    found: list[Turn | None] = []
    for k, (meeting, first) in enumerate(zip(forces.meetings, pressed, strict=True)):
        if k not in corners:
            found.append(None)
            continue
        assert first is not None
        (what, *_), corner, weight = meeting, corners[k], weights[k]
        share, slope = added_shares[k]
        normal = 0.5 * (first + what.normal)
        # The step's equations take the friction at each end by the normal force there; that of a
        # corner that sticks is the friction of the end throughout.
        grown = what.normal - normal
        apart = sliding_weight[k] * (corner.start.share - corner.share)
        added = normal * share + grown * apart
        slope = normal * slope - grown * sliding_weight[k] * corner.slope
        displacing = sliding_weight[k] * comes_to_rest(
            corner, linear[k], means[k], (first, what.normal), by_others[k]
        )
        displacing = displacing + weight * normal * settles(corner, resting[k].gained)
        found.append(Turn(added, 0.5 * (share + apart), slope, displacing))
    return found


def _acts_with(until: Array, other: Array) -> Array:
    """Which share of a friction's jump after the share `other` of the step adds to J of a corner
    whose friction jumps after the share `until` (see above)."""
    later = other >= until
    rest = jnp.where(later & (until < 1), 1 - until, 1.0)
    return jnp.where(later, (1 - other) / rest, other / jnp.where(later, 1.0, until))


def _acts_before_rest(until: Array, other: Array) -> Array:
    """A friction that jumps after the share `other` of the step is larger before that than in its
    mean over the step: which share of the difference acts until a corner comes to rest at
    `until`."""
    sooner = other < until
    without = (until - other) / jnp.where(sooner, until, 1.0) / jnp.where(sooner, 1 - other, 1.0)
    return jnp.where(sooner, 1 - without, 1.0)


class _Coupled(NamedTuple):
    """How corners that slide on one surface act on each other.

    `rest` is the share of the step after which each comes to rest by its own friction. `across`
    [m/s] is the change of the first corner's sliding speed, in a whole step, by friction of mu = 1
    at the second corner of a pair. Both are empty for a single corner.
    """

    rest: dict[int, Array]
    across: dict[tuple[int, int], Array]


def _coupled(
    mechanics: Mechanics, forces: Forces, corners: dict[int, Corner], changes: dict[int, Array]
) -> _Coupled:
    """The coupling of corners; `changes` of friction at the reversal, as shares of normal
    forces."""
    across = {}
    for k, j in itertools.permutations(corners, 2):
        one, other = forces.meetings[k].touch, forces.meetings[j].touch
        share = mechanics.lightness(one, other) / mechanics.lightness(other)
        across[k, j] = share * corners[j].gain
    rest = {}
    if across:
        for k, corner in corners.items():
            rest[k] = _time_of_rest(corner, corner.gain * jnp.abs(changes[k])).until
    return _Coupled(rest, across)


def _by_others(
    coupled: _Coupled, changes: dict[int, Array], counts: Callable[[Array, Array], Array]
) -> dict[int, Array | float]:
    """The change of each corner's sliding speed in a whole step [m/s] by frictions of the other
    corners that are larger by `changes`, as shares of their normal forces. `counts` gives the share
    of a change that acts, from the instants at which the corner and the other one come to rest."""
    found: dict[int, Array | float] = dict.fromkeys(changes, 0.0)
    for (k, j), across in coupled.across.items():
        share = counts(coupled.rest[k], coupled.rest[j])
        found[k] = found[k] + share * across * changes[j]
    return found


def shares(forces: Forces, turns: list[Turn | None]) -> list[Array]:
    """The derivative [1] of each contact's friction, as the step's equations have it, in the normal
    force at the step's end."""
    return [
        meeting.response.share + (0.0 if turn is None else turn.share)
        for meeting, turn in zip(forces.meetings, turns, strict=True)
        if meeting.response is not None
    ]


def _acceleration_by(
    mechanics: Mechanics, forces: Forces, pushes: list[Array | None]
) -> Acceleration | None:
    """The acceleration by the forces `pushes` [N] along the surfaces; `None` without any."""
    total = None
    for (_, parts, _, _), push in zip(forces.meetings, pushes, strict=True):
        if push is not None:
            extra = [push * t for t in parts.tangent]
            total = extra if total is None else [q + f for q, f in zip(total, extra, strict=True)]
    return None if total is None else mechanics.acceleration(*total)


def turned(
    mechanics: Mechanics, forces: Forces, turns: list[Turn | None], end: Acceleration
) -> Acceleration:
    """The acceleration at the `end` of a step with that by the forces that reversals add."""
    extra = _acceleration_by(mechanics, forces, [turn and turn.added for turn in turns])
    return end if extra is None else Acceleration(*map(jnp.add, end, extra))


def extra_motion(
    mechanics: Mechanics,
    forces: Forces,
    turns: list[Turn | None],
    sticking_change: list[Array] | None,
    step: Array,
) -> Acceleration | None:
    """What is added to the parcel's displacement by the step's cubic (x, y [m], angle [rad]): in a
    step in which corners come to rest or reverse, and in one in which corners stick and the
    acceleration by their friction changes by `sticking_change`. `None` where no corner has
    friction."""
    if sticking_change is None:
        return None
    further = [f / 6 for f in sticking_change]
    extra = _acceleration_by(mechanics, forces, [turn and turn.displacing for turn in turns])
    if extra is not None:
        further = map(jnp.add, further, extra)
    return Acceleration(*(step**2 * a for a in further))
