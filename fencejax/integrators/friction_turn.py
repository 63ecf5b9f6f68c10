"""Friction that turns round within a step, and from when on it counts the other way.

Where a corner's sliding comes to rest within a step and goes on the other way, dry friction jumps
then from -mu N s to +mu N s, with s the sign of the sliding before. The trapezoidal rule counts
half of each whenever that is: an error of the first order in the step, and a derivative that lacks
the instant's own. So friction counts with its value at the start for the share theta [1] of the
step before the corner comes to rest, and with that at the end for the rest. With the sliding speed
w straight on either side of rest, w_0 = a s at the start, w_1 = -b s at the end, and J [m/s] what
the jump of friction changes the sliding by in a whole step,

    J theta (1 - theta) = a (1 - theta) - b theta.

A corner that comes to rest at the end has b = 0, and theta = min(a / J, 1). A corner that slides on
has no jump, and nothing is added.

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

    h^2 G / m (theta - 1 / 3) / 2.

A corner that is held from a step's start on is so by the friction at its end, whatever was there at
its start: h^2 / 6 times what that changes the acceleration by.

Static friction above the kinetic one gives the equations a second root, at which the corner is
held. There friction counts as it did: by the trapezoidal rule, or by the step's end alone.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from .._elementary import arctan
from ..model import Acceleration, Forces, Mechanics, corner_share
from . import friction_tangent


class Turn(NamedTuple):
    """What a turn within the step adds to twice the mean friction over it, as a share of the normal
    force at its end: the `share` [1], and its `slope` with the sliding speed [s/m]. And the share
    `early` [1]: the acceleration by it, times h^2, is how much further the parcel goes for it."""

    share: Array
    slope: Array
    early: Array


class _Corner(NamedTuple):
    """The sliding speeds before and after the step [m/s], the coefficient of friction mu at its
    end, what friction of mu = 1 changes the sliding by in a whole step [m/s], and eps [m/s]; the
    friction before it `was`, and at its end, as a `share` of the normal force [1]."""

    before: Array
    after: Array
    mu: Array
    gain: Array
    eps: float
    was: Array
    share: Array


class _Added(NamedTuple):
    """A turn's share, its slope, and that with the law's own slope of the share."""

    share: Array
    slope: Array
    by_share: Array | float = 0.0


def _from_sliding(corner: _Corner) -> _Added:
    """Of a corner that slides at the start: theta."""
    before, after, gain = corner.before, corner.after, corner.gain
    sign, fast, eps = jnp.sign(before), jnp.abs(before), corner.eps
    onward = jnp.maximum(sign * after, 0.0)
    # None of it where the corner slides on: there the trapezoidal rule is right.
    ends = eps * eps / (onward * onward + eps * eps)
    # What friction changes by, as a share of the normal force.
    drop = ends * jnp.maximum(sign * (corner.share - corner.was), 0.0)
    jump = gain * drop
    back = jnp.maximum(-sign * after, 0.0)
    root = jnp.sqrt((jump - fast + back) ** 2 + 4 * fast * back + eps * eps)
    whole = jump + fast + back + root
    until = 2 * fast / whole
    by_jump = -until / whole * (1 + (jump - fast + back) / root)
    by_back = jnp.where(back > 0, -until / root, 0.0)
    some = jnp.abs(sign)
    return _Added(
        -sign * (2 * until - 1) * drop,
        some * 2 * drop * by_back,
        some * ends * (1 - 2 * until - 2 * jump * by_jump),
    )


def _from_hold(corner: _Corner) -> _Added:
    """Of a corner near rest at the start: G, the step's end counting by itself."""
    before, after, mu, gain, eps = corner[:5]
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
    return _Added(2 * ahead * mu * added, 2 * slope)


def _early(before: Array, after: Array, change: Array) -> Array:
    """(theta - 1 / 3) / 2 of a corner that slides at the speeds `before` and `after` a step [m/s],
    whose sliding friction changes that by `change` [m/s] more than its mean one; 0 where it slides
    on."""
    slows = before - after - change
    rests = (slows * before > 0) & (jnp.abs(before) < jnp.abs(slows))
    return jnp.where(rests, 0.5 * (before / jnp.where(rests, slows, 1.0) - 1 / 3), 0.0)


def turns(
    mechanics: Mechanics,
    forces: Forces,
    sticking: tuple[Array, ...],
    before: tuple[Array, ...],
    step: Array,
) -> list[Turn | None]:
    """Of each contact, what the turn of its friction adds; `None` where there is no friction or the
    sliding speeds `before`, those at the step's start [m/s] of the first contacts, do not tell.
    The weights `sticking` tell which corners friction held at the start."""
    found: list[Turn | None] = []
    smoothing = mechanics.fidelity.smoothing
    weights = friction_tangent.spread(mechanics, sticking)
    for k, (meeting, friction, weight) in enumerate(
        zip(forces.meetings, mechanics.frictions, weights, strict=True)
    ):
        if friction is None or k >= len(before):
            found.append(None)
            continue
        what, parts, _, response = meeting
        assert response is not None
        mu, _ = friction.coefficient(what.sliding * what.sliding, smoothing.static_speed)
        gain = step * mechanics.lightness(parts) * what.normal
        was, _ = corner_share(friction, before[k], smoothing)
        corner = _Corner(
            before[k], what.sliding, mu, gain, smoothing.slip_speed, was, response.share
        )
        sliding, held = _from_sliding(corner), _from_hold(corner)
        share = (1 - weight) * sliding.share + weight * held.share
        slope = (1 - weight) * response.sliding * sliding.by_share
        slope = slope + (1 - weight) * sliding.slope + weight * held.slope
        counts = friction_tangent.monotone(friction, what.sliding, smoothing)
        share, slope = counts * share, counts * slope
        more = 0.5 * (was - response.share - share)
        early = (1 - weight) * more * _early(before[k], what.sliding, gain * more)
        found.append(Turn(share, slope, early))
    return found


def shares(
    mechanics: Mechanics, forces: Forces, sticking: tuple[Array, ...], turns: list[Turn | None]
) -> list[Array]:
    """Of each contact, the friction's share of N as it counts at a step's end."""
    weights = friction_tangent.spread(mechanics, sticking)
    return [
        (1 + weight) * meeting.response.share + (0.0 if turn is None else turn.share)
        for meeting, weight, turn in zip(forces.meetings, weights, turns, strict=True)
        if meeting.response is not None
    ]


def _pushed(
    mechanics: Mechanics, forces: Forces, shares: list[Array | None]
) -> Acceleration | None:
    """The acceleration by these `shares` of the normal forces along the surfaces; `None` without
    any."""
    total = None
    for (what, parts, _, _), share in zip(forces.meetings, shares, strict=True):
        if share is not None:
            more = [what.normal * share * t for t in parts.tangent]
            total = more if total is None else [q + f for q, f in zip(total, more, strict=True)]
    return None if total is None else mechanics.acceleration(*total)


def turned(
    mechanics: Mechanics, forces: Forces, turns: list[Turn | None], end: Acceleration
) -> Acceleration:
    """The acceleration at the `end` of a step with what the turns add to it."""
    more = _pushed(mechanics, forces, [turn and turn.share for turn in turns])
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
