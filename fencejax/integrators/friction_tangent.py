"""Friction that holds a corner, and how the equations of a step count it.

Where a corner is all but at rest on a surface, smoothed friction is a stiff damper: its slope with
the sliding speed outweighs the inertia over half a step, tens of times under a large force. The
trapezoidal rule would hand a force that stopped the corner within a step on to the next, and the
sliding speed, or its derivative, would ring from step to step, or turn its sign. So friction that
holds counts with its value at a step's end alone (the backward Euler rule), and friction that
slides by the trapezoidal rule. It is the share of the normal force that counts so: with the end's
normal force, too, a corner that is pressed harder and harder would be held on by more than its
surface gives, mu_s (N_0 + N_1) / 2 in the mean over the step. The belt's counts by a rule between
the two while it holds (`belt_lag`): the backward Euler rule would be late where a parcel lets go of
the belt.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Smoothing
from ..model import Acceleration, Forces, Mechanics, belt_slope
from ..parts import AbstractFriction
from ..scenes import Body

# Stiffness of a friction [1], its slope with the motion relative to that of the inertia over half a
# step, above which it holds. Up to 1 the trapezoidal rule does not ring. Where what it adds beside
# holding is known (`friction_turn`) it is less: there the rule's (1 - k) / (1 + k) is within 2 % of
# exp(-2 k), by which the sliding speed decays.
_STIFF, _SMALL = 1.0, 0.3
# Weight of the belt's friction beyond the trapezoidal rule where it is stiff: of what rings from
# step to step (1 - 0.2) / (1 + 0.2) is left, 1 % after eleven steps.
_BELT_LAG = 0.2
# Static friction above the kinetic one [1], in (eps / w_s)^2, up to which smoothed friction still
# rises with the sliding speed everywhere: with z = (w / w_s)^2 and r = eps / w_s the logarithm of
# (1 + L exp(-z)) / sqrt(1 + r^2 / z) rises where L < r^2 exp(z) / (2 z^2), which is least at z = 2.
_LEVEL = math.exp(2) / 8


def monotone(friction: AbstractFriction, sliding: Array, smoothing: Smoothing) -> Array:
    """1.0 where a corner at rest takes no more friction than one that slides, 0.0 where the jump
    from static to kinetic friction gives the equations of a step another root."""
    scales = friction.scales(sliding)
    level = _LEVEL * (smoothing.slip_speed / smoothing.static_speed) ** 2
    return (scales.largest <= (1 + level) * scales.sliding).astype(sliding.dtype)


def _sticks(stiffness: Array, level: Array) -> Array:
    """1.0 where friction of a stiffness [1] holds a corner, 0.0 where it leaves it free."""
    return (stiffness > _STIFF + level * (_SMALL - _STIFF)).astype(stiffness.dtype)


class BeltLag(NamedTuple):
    """How much more the belt's friction counts at a step's end than at its start, `weight` [1],
    and its `acceleration` of the parcel at the start."""

    weight: Array
    acceleration: Acceleration


def belt_lag(mechanics: Mechanics, body: Body, step: Array) -> BeltLag | None:
    """Of the belt's friction, for a step from `body`; `None` without a belt. The weight is that of
    a stiff friction, and goes to 0 with the stiffness down to 1."""
    if mechanics.belt is None:
        return None
    force, (grip, bend) = mechanics.belt.force(body, mechanics.fidelity.smoothing)
    slope = belt_slope(grip, bend, mechanics.belt.slip(body).squared)
    stiffness = 0.5 * step * slope / mechanics.mass
    weight = _BELT_LAG * jnp.maximum(stiffness - _STIFF, 0.0) / jnp.maximum(stiffness, _STIFF)
    return BeltLag(weight, mechanics.acceleration(*force[:3]))


def corner_count(mechanics: Mechanics) -> int:
    """Number of corners with friction."""
    return sum(friction is not None for friction in mechanics.frictions)


def sticking_weights(mechanics: Mechanics, forces: Forces, step: Array) -> tuple[Array, ...]:
    """Whether friction holds [1], of each contact that has any."""
    found = []
    for meeting, friction in zip(forces.meetings, mechanics.frictions, strict=True):
        what, parts, _, response = meeting
        if friction is not None:
            assert response is not None
            slope = -what.normal * response.sliding * mechanics.lightness(parts)
            level = monotone(friction, what.sliding, mechanics.fidelity.smoothing)
            found.append(_sticks(0.5 * step * slope, level))
    return tuple(found)


def by_contact(mechanics: Mechanics, sticking: tuple[Array, ...]) -> list[Array | float]:
    """The weights by contact, 0 where there is no friction."""
    remaining = iter(sticking)
    return [0.0 if f is None else next(remaining) for f in mechanics.frictions]


def sticking_acceleration(
    mechanics: Mechanics,
    forces: Forces,
    sticking: tuple[Array, ...],
    normals: tuple[Array | None, ...] | None = None,
    steady: bool = False,
) -> Acceleration | None:
    """The acceleration by the frictions that hold, of contacts pressed by `normals` [N], if given,
    in place of their own; `None` where no corner has friction. `steady` ones go with the normal
    force, and not with the sliding speed."""
    if not sticking:
        return None
    total = [jnp.zeros_like(forces.acceleration.x)] * 3
    of_contacts = by_contact(mechanics, sticking)
    for k, (meeting, weight, friction) in enumerate(
        zip(forces.meetings, of_contacts, mechanics.frictions, strict=True)
    ):
        if friction is not None:
            what, parts, _, response = meeting
            assert response is not None
            normal = None if normals is None else normals[k]
            normal = what.normal if normal is None else normal
            share = jax.lax.stop_gradient(response.share) if steady else response.share
            drag = weight * normal * share
            total = [q + drag * t for q, t in zip(total, parts.tangent, strict=True)]
    return mechanics.acceleration(*total)


def carried_over(
    mechanics: Mechanics,
    forces: Forces,
    sticking_before: tuple[Array, ...],
    sticking: tuple[Array, ...],
) -> tuple[Acceleration, Acceleration | None]:
    """The acceleration that the next step begins with, and what of it is by frictions that hold, by
    the weights `sticking` now and `sticking_before`.

    That step counts these frictions by their values at its end; only the first guess of its way
    goes with those at its start. Where a corner has just come to rest, to within some eps, these
    have a thousand times the slope with the sliding speed that those of a held corner have. So
    what holds from now on is carried on as `steady`.
    """
    sticking_part = sticking_acceleration(mechanics, forces, sticking)
    if sticking_part is None:
        return forces.acceleration, None
    newly_sticking = tuple(now * (1 - was) for now, was in zip(sticking, sticking_before, strict=True))
    steady = sticking_acceleration(mechanics, forces, newly_sticking, steady=True)
    varying = sticking_acceleration(mechanics, forces, newly_sticking)
    assert steady is not None
    assert varying is not None
    correction = [a - b for a, b in zip(steady, varying, strict=True)]
    begin, sticking_part = (
        Acceleration(*map(jnp.add, each, correction)) for each in (forces.acceleration, sticking_part)
    )
    return begin, sticking_part


def sliding_velocities(
    mechanics: Mechanics, forces: Forces, sticking: tuple[Array, ...]
) -> tuple[Array, Array, Array]:
    """The velocities of the parcel by which corners slide that friction held by the weights
    `sticking`: without these they are at rest."""
    x = y = angle = jnp.zeros_like(forces.acceleration.x)
    of_contacts = by_contact(mechanics, sticking)
    for (what, parts, _, _), weight, friction in zip(
        forces.meetings, of_contacts, mechanics.frictions, strict=True
    ):
        if friction is not None:
            impulse = weight * what.sliding / mechanics.lightness(parts)
            change = mechanics.acceleration(*(impulse * t for t in parts.tangent))
            x, y, angle = x + change.x, y + change.y, angle + change.angle
    return x, y, angle


def _stop(ahead: Array, square: Array, sliding: Array) -> Array:
    """Share t <= 1 at which s - t d is nearest to rest, given s.d and d.d; 1 where that lies
    beyond the step, or behind, or where s is not `sliding` but all but at rest."""
    turns = sliding & (ahead > 0) & (ahead < square)
    return jnp.where(turns, ahead / jnp.where(turns, square, 1.0), 1.0)


def reversal(
    mechanics: Mechanics,
    forces: Forces,
    change: tuple[Array, ...],
    drifts: list[list[Array]],
) -> Array:
    """Share of a change of the unknowns, `-change`, up to which no friction passes its jump: where
    a sliding speed, or the slip on the belt, would turn round. Normal forces at the fence let its
    corners slide by `drifts` [m/s/N], if these are given."""
    share = jnp.ones_like(forces.acceleration.x)
    rest = (0.3 * mechanics.fidelity.slip_speed) ** 2
    velocities, normals = change[:3], change[3:]
    for k, (what, parts, _, _) in enumerate(forces.meetings):
        x, y, turning = (t * c for t, c in zip(parts.tangent, velocities, strict=True))
        turn = x + y + turning
        if k < len(drifts):
            for drift, normal in zip(drifts[k], normals, strict=True):
                turn = turn + drift * normal
        share = jnp.minimum(share, _stop(what.sliding * turn, turn**2, what.sliding**2 > rest))
    if mechanics.belt is not None and forces.slip is not None:
        x, y, turning, arm, lever = forces.slip
        turned, moved = arm * change[2], change[0]
        if lever is not None:
            moved = moved + lever * change[2]
        ahead = x * moved + y * change[1] + turning * turned
        square = moved**2 + change[1] ** 2 + turned**2
        slipping = x**2 + y**2 + turning**2 > rest
        share = jnp.minimum(share, _stop(ahead, square, slipping))
    return share
