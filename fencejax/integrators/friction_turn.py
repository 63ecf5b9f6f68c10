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
        least = smoothing.slip_speed**2
        sign, fast = jnp.sign(before[k]), jnp.abs(before[k])
        mu, _ = friction.coefficient(what.sliding * what.sliding, smoothing.static_speed)
        ahead = fast / jnp.sqrt(fast * fast + least)
        after = sign * what.sliding / jnp.sqrt(what.sliding * what.sliding + least)
        # What friction changes by, as a share of the normal force.
        drop = mu * jnp.maximum(ahead - after, 0.0)
        gain = step * mechanics.lightness(parts) * what.normal
        jump = gain * drop
        back = jnp.maximum(-sign * what.sliding, 0.0)
        root = jnp.sqrt((jump - fast + back) ** 2 + 4 * fast * back + least)
        whole = jump + fast + back + root
        until = 2 * fast / whole
        by_jump = -until / whole * (1 + (jump - fast + back) / root)
        by_back = -until / root
        # Friction that held the corner counts by its end alone, if it goes on to hold it.
        beyond = jnp.maximum(-after, 0.0)
        free, held = (1 - weight) * jnp.abs(sign), weight * jnp.abs(sign)
        passed = free + held * beyond
        share = free * (2 * until - 1) + 2 * held * until * beyond
        slope = free * (1 - 2 * until) - 2 * passed * jump * by_jump
        slope = slope - 2 * held * until * jnp.where(back > 0, beyond + ahead - after, 0.0)
        slope = response.sliding * slope + 2 * passed * jnp.where(back > 0, drop * by_back, 0.0)
        found.append(Turn(-sign * share * drop, slope))
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
