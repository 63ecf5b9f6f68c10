"""Friction that turns round within a step, and from when on it counts the other way.

Where a corner's sliding comes to rest within a step and goes on the other way, dry friction jumps
then from -mu N s to +mu N s, with s the sign of the sliding before. The trapezoidal rule counts
half of each whenever that is: an error of the first order in the step, and a derivative that lacks
the instant's own. So friction counts with its value at the start for the share theta [1] of the
step before the corner comes to rest, and with that at the end for the rest. With the sliding speed
w straight on either side of rest, w_0 = a s at the start, w_1 = -b s at the end, and J [m/s] what
the jump of friction changes the sliding by in a whole step,

    J theta (1 - theta) = a (1 - theta) - b theta.

This is so for b >= 0, and a corner that friction then holds has b = 0, theta = a / J. Up to the
share theta = 1 friction does not turn. J is that of the smoothed jump, so that nothing happens
where friction changes as little as the smoothing makes it.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from ..model import Acceleration, Forces, Mechanics
from . import friction_tangent


class Turn(NamedTuple):
    """What a turn within the step adds to twice the mean friction over it, as a share of the normal
    force at its end: the `share` [1], and its `slope` with the sliding speed [s/m]."""

    share: Array
    slope: Array


class _Corner(NamedTuple):
    """The sliding speeds before and after the step [m/s], the coefficient of friction mu at its
    end, what friction of mu = 1 changes the sliding by in a whole step [m/s], and eps [m/s]."""

    before: Array
    after: Array
    mu: Array
    gain: Array
    eps: float


class _Added(NamedTuple):
    """A turn's share, its slope, and that with the law's own slope of the share."""

    share: Array
    slope: Array
    by_share: Array | float = 0.0


def _from_sliding(corner: _Corner) -> _Added:
    """Of a corner that slides at the start: the first two equations."""
    before, after, mu, gain, eps = corner
    sign, fast = jnp.sign(before), jnp.abs(before)
    ahead = fast / jnp.sqrt(fast * fast + eps * eps)
    left = sign * after / jnp.sqrt(after * after + eps * eps)
    # What friction changes by, as a share of the normal force.
    drop = mu * jnp.maximum(ahead - left, 0.0)
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
        some * (1 - 2 * until - 2 * jump * by_jump),
    )


def _from_hold(corner: _Corner) -> _Added:
    """Of a corner that friction held at the start: the last two equations."""
    before, after, mu, gain, eps = corner
    ahead = jnp.where(after < 0, -1.0, 1.0)
    slow, fast = ahead * before, ahead * after
    least = 1e-3 * eps
    jump, back = 2 * mu * gain, jnp.maximum(-slow, 0.0)
    on = jnp.maximum(fast - jnp.maximum(slow, 0.0), least)
    root = jnp.sqrt((jump - back - on) ** 2 + 4 * on * jump + least * least)
    # beta + J is never far from 0 where it is taken as beta (beta + J) = on J + ...
    pull = jnp.maximum(0.5 * (root - jump + back + on), least)
    both = pull + jump
    ending = jnp.sqrt(fast * fast + eps * eps)
    z0, z1 = jnp.sqrt(slow * slow + eps * eps) - slow, ending - fast
    apart = jnp.maximum(z0 - z1, 0.0)
    mean = jnp.sqrt(pull * both)
    angle = jnp.arctan(mean * eps * apart / (pull * eps * eps + both * z0 * z1))
    added = (apart + jump * eps / mean * angle) / both
    still = 0.5 * z1 / ending * jump
    slope = still / (pull + still) - 0.5 * jump * added / root
    slope = jnp.where((apart > 0) & (gain > 0), slope / jnp.where(gain > 0, gain, 1.0), 0.0)
    return _Added(2 * ahead * mu * added, 2 * slope)


def turns(
    mechanics: Mechanics,
    forces: Forces,
    sticking: tuple[Array, ...],
    before: tuple[Array, ...],
    step: Array,
) -> list[Turn | None]:
    """Of each contact, what the turn of its friction adds; `None` where there is no friction or the
    sliding speeds `before`, those at the step's start [m/s] of the first contacts, do not tell.
    Friction that held the corner at the start, by the weights `sticking`, counts without."""
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
        corner = _Corner(before[k], what.sliding, mu, gain, smoothing.slip_speed)
        sliding, held = _from_sliding(corner), _from_hold(corner)
        share = (1 - weight) * sliding.share + weight * held.share
        slope = (1 - weight) * response.sliding * sliding.by_share
        slope = slope + (1 - weight) * sliding.slope + weight * held.slope
        found.append(Turn(share, slope))
    return found


def turned(
    mechanics: Mechanics, forces: Forces, turns: list[Turn | None], end: Acceleration
) -> Acceleration:
    """The acceleration at the `end` of a step with what the turns add to it."""
    total = None
    for (what, parts, _, _), turn in zip(forces.meetings, turns, strict=True):
        if turn is not None:
            more = [what.normal * turn.share * t for t in parts.tangent]
            total = more if total is None else [q + f for q, f in zip(total, more, strict=True)]
    if total is None:
        return end
    return Acceleration(*map(jnp.add, end, mechanics.acceleration(*total)))
