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

The way goes with that share, too. Were friction all along what it is while the corner slides, it
would be larger by G in the mean than the F_m which the step's equations have found, and the sliding
speed change by w_1 - w_0 + h lambda G, with the corner's lightness lambda [1/kg]. So theta is the
share of that which takes w_0 away. And a parcel that is pushed early in a step goes further than by
the same push later: than by the step's cubic, for which a push in the mean acts at a third of it,

    h^2 G / m [N_1 (3 t - 1) + (N_1 - N_0) (1 - t) (1 - 2 t)] / [3 (N_t + N_1)].

The cubic begins with the friction at the step's very start, though, and the jump is that from the
mean on the way to rest, which static friction near rest makes larger: by F more the parcel goes
h^2 F / m (1 - t) / 6 further.

A corner that is held from a step's start on is so by the friction's share of the normal force at
its end, whatever it was at its start: h^2 / 6 times what that changes the acceleration by.

A step passes the fall from static to kinetic friction, over w_s, in a small part of its time, and
what friction is at the step's very end may say little of the rest. So the two frictions above are
means over the speeds between w_0 and rest, and between rest and w_1 (`mean_coefficient`). Where a
corner slides on, coefficient and direction are means over a speed that goes straight,

    mu_k + [w_1 d(w_1) - w_0 d(w_0)] / (w_1 - w_0),   (w_0 + w_1) / (r_0 + r_1),

with d what static friction adds in the mean from rest to w, and r^2 = w^2 + eps^2.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .._elementary import arctan
from ..fidelity import Smoothing
from ..model import (
    Acceleration,
    Coefficient,
    Forces,
    Mechanics,
    corner_share,
    mean_coefficient,
)
from ..parts import AbstractFriction
from . import friction_tangent


class Turn(NamedTuple):
    """What a turn within the step adds to twice the mean friction over it: the force `added` [N],
    the `share` [1] of the normal force at the step's end by which it grows with that, and its
    `slope` with the sliding speed [N s/m]. And the force `early` [N]: the acceleration by it, times
    h^2, is how much further the parcel goes for it."""

    added: Array
    share: Array
    slope: Array
    early: Array


class _Friction(NamedTuple):
    """A coefficient of friction, the `direction` of the sliding, -1 to 1, and its `turn` with the
    sliding speed [s/m]."""

    of: Coefficient
    direction: Array
    turn: Array

    @property
    def mu(self) -> Array:
        """The coefficient [1]."""
        return self.of.smooth + self.of.near_rest

    @property
    def mu_slope(self) -> Array:
        """That of the coefficient with the sliding speed [s/m]."""
        return self.of.smooth_slope + self.of.near_rest_slope

    @property
    def share(self) -> Array:
        """The friction as a share of the normal force [1]."""
        return -self.mu * self.direction

    @property
    def slope(self) -> Array:
        """That of the share [s/m]."""
        return -(self.mu_slope * self.direction + self.mu * self.turn)


def _mean(friction: AbstractFriction, sliding: Array, smoothing: Smoothing) -> _Friction:
    """In the mean from rest to a sliding speed; its direction is that at the speed itself, so that
    a corner at rest has the friction that holds it."""
    of = mean_coefficient(friction, sliding, smoothing)
    inverse = jax.lax.rsqrt(sliding * sliding + smoothing.slip_speed**2)
    turn = (smoothing.slip_speed * inverse) ** 2 * inverse
    return _Friction(of, sliding * inverse, turn)


class Start(NamedTuple):
    """A corner at a step's start: the sliding speed [m/s], the friction there as a `share` of the
    normal force [1], and in the mean on the way from there to rest."""

    speed: Array
    share: Array
    mean: _Friction


def starts(mechanics: Mechanics, sliding: tuple[Array, ...]) -> tuple[Start | None, ...]:
    """Of each contact, the first of which slide at these speeds [m/s]; `None` where there is no
    friction, or no speed. They are the same for all of Newton's iterations."""
    smoothing = mechanics.fidelity.smoothing
    speeds = (*sliding, *[None] * (len(mechanics.frictions) - len(sliding)))
    return tuple(
        None if friction is None or speed is None else Start(
            speed, corner_share(friction, speed, smoothing)[0], _mean(friction, speed, smoothing)
        )
        for friction, speed in zip(mechanics.frictions, speeds, strict=True)
    )  # fmt: skip


class _Corner(NamedTuple):
    """The corner at the step's `start`, and at its end: the sliding speed `after` [m/s], the
    friction as a `share` of the normal force [1] with its `slope` [s/m], and that in the mean on
    the way from rest (`end`); and what friction of mu = 1 changes the sliding by in a whole step
    [m/s], and eps [m/s]."""

    start: Start
    after: Array
    share: Array
    slope: Array
    end: _Friction
    gain: Array
    eps: float


class _Added(NamedTuple):
    """A turn's share, and its slope with the sliding speed [s/m]."""

    share: Array
    slope: Array


def _passed(corner: _Corner) -> tuple[Array, _Friction]:
    """Whether the sliding speed changes at all, and the coefficient in its mean as it goes straight
    from one end of the step to the other, with the direction at the end. What static friction adds
    is a quotient of differences, of numbers that far from rest do not go with the speed: so it has
    no roundings of theirs. Where the speed does not change, the end tells instead."""
    before, after = corner.start.speed, corner.after
    here, there = corner.start.mean.of, corner.end.of
    change = after - before
    some = jnp.abs(change) > 1e-4 * corner.eps
    change = jnp.where(some, change, 1.0)
    near_rest = (after * there.near_rest - before * here.near_rest) / change
    slope = (there.near_rest + after * there.near_rest_slope - near_rest) / change
    smooth = 0.5 * (here.smooth + there.smooth)
    mean = Coefficient(smooth, 0.5 * there.smooth_slope, near_rest, slope)
    return some, corner.end._replace(of=mean)


def _straight(corner: _Corner) -> _Added:
    """Twice the mean friction of a corner whose sliding speed goes straight from one end of the
    step to the other."""
    before, after, eps = corner.start.speed, corner.after, corner.eps
    some, end = _passed(corner)
    # The mean of w / sqrt(w^2 + eps^2), which goes with the root.
    both = jnp.sqrt(before * before + eps * eps) + jnp.sqrt(after * after + eps * eps)
    direction = (before + after) / both
    mean = end._replace(direction=direction, turn=(1 - direction * end.direction) / both)
    return _Added(
        jnp.where(some, 2 * mean.share, corner.start.share + corner.share),
        jnp.where(some, 2 * mean.slope, corner.slope),
    )


def _from_sliding(corner: _Corner) -> _Added:
    """Of a corner that slides at the start: theta."""
    before, after, gain = corner.start.speed, corner.after, corner.gain
    sign, fast, eps = jnp.sign(before), jnp.abs(before), corner.eps
    onward = jnp.maximum(sign * after, 0.0)
    here, there = corner.start.mean, corner.end
    # What friction changes by, as a share of the normal force.
    drop = jnp.maximum(sign * (there.share - here.share), 0.0)
    jump = gain * drop
    back = jnp.maximum(-sign * after, 0.0)
    root = jnp.sqrt((jump - fast + back) ** 2 + 4 * fast * back + eps * eps)
    whole = jump + fast + back + root
    until = 2 * fast / whole
    by_jump = -until / whole * (1 + (jump - fast + back) / root)
    by_back = jnp.where(back > 0, -until / root, 0.0)
    twice = 2 * (until * here.share + (1 - until) * there.share)
    by_drop = gain * by_jump * jnp.where(drop > 0, sign * there.slope, 0.0)
    slope = 2 * (1 - until) * there.slope - 2 * sign * drop * (by_drop - sign * by_back)
    # None of it where the corner slides on, nor where it hardly slows down.
    near = onward * onward + eps * eps
    slowed = jnp.maximum(1 - onward / jnp.where(fast > 0, fast, 1.0), 0.0)
    rests = eps * eps / near
    ends = rests * slowed * slowed
    fades = -2 * rests * slowed * (slowed * onward / near + 1 / jnp.where(fast > 0, fast, 1.0))
    fades = jnp.where(onward > 0, sign * fades, 0.0)
    on = _straight(corner)
    slope = on.slope + ends * (slope - on.slope) + fades * (twice - on.share)
    twice = on.share + ends * (twice - on.share)
    some = jnp.abs(sign)
    return _Added(
        some * (twice - corner.start.share - corner.share), some * (slope - corner.slope)
    )


def _from_hold(corner: _Corner) -> _Added:
    """Of a corner near rest at the start: G, the step's end counting by itself."""
    before, after, gain, eps = corner.start.speed, corner.after, corner.gain, corner.eps
    some, there = _passed(corner)
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
    return _Added(2 * (ahead * mu * added + falls), 2 * (slope + steeper))


def _until_rest(before: Array, after: Array, change: Array) -> Array:
    """theta of a corner that slides at the speeds `before` and `after` a step [m/s], whose sliding
    friction changes that by `change` [m/s] more than its mean one; 1 where it slides on."""
    slows = before - after - change
    rests = (slows * before > 0) & (jnp.abs(before) < jnp.abs(slows))
    return jnp.where(rests, before / jnp.where(rests, slows, 1.0), 1.0)


def _early(corner: _Corner, mean: Array, pressed: tuple[Array, Array]) -> Array:
    """How much further the parcel goes for a corner that comes to rest, as a force [N] (`Turn`),
    with the `mean` friction over the step as a share [1] of the normal force, which is `pressed`
    [N] at the start and at the end."""
    start, (first, last) = corner.start, pressed
    more = start.mean.share - mean
    until = _until_rest(start.speed, corner.after, corner.gain * more)
    until, rests = jnp.where(until < 1, until, 0.0), until < 1
    square = first * first + until * (last * last - first * first)
    some = rests & (square > 0)
    then = jnp.sqrt(jnp.where(some, square, 1.0))
    at = (first + last) * until / (first + then)
    lever = last * (3 * at - 1) + (last - first) * (1 - at) * (1 - 2 * at)
    further = more * (first + last) * lever / (6 * (then + last))
    further = further + (start.mean.share - start.share) * first * (1 - at) / 6
    return jnp.where(some, further, 0.0)


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
        corner = _Corner(
            start, what.sliding, response.share, response.sliding,
            _mean(friction, what.sliding, smoothing), gain, smoothing.slip_speed,
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
        early = _early(
            corner, 0.5 * (start.share + response.share + share), (first, what.normal)
        )
        found.append(Turn(added, 0.5 * (share + apart), slope, free * early))
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
