"""Friction at sticking corners, and how the equations of a step treat it.

Where a corner is nearly at rest on a surface, smoothed friction is a stiff damper: its slope with
the sliding speed outweighs the inertia over half a step, tens of times under a large force. Under
the trapezoidal rule a friction force that stops the corner within a step would act on into the next
step, and the sliding speed or its derivative would oscillate from step to step or change its sign.
So the friction of a sticking corner counts with its value at the step's end alone (the backward
Euler rule), and that of a sliding corner by the trapezoidal rule. What is taken at the end is the
friction as a share of the normal force, and this share acts on the mean normal force. With the
normal force at the end, too, a corner under a growing normal force would be held by more than its
surface can give, which is mu_s (N_0 + N_1) / 2 in the mean over the step. The belt's friction
counts by a rule between the two while the parcel sticks to it (`belt_lag`): with the backward Euler
rule a parcel would let go of the belt late.
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

# Stiffness k of a friction [1], its slope with the motion relative to that of the inertia over half
# a step, above which a corner sticks. Up to 1 the trapezoidal rule does not oscillate. The limit is
# lower where friction is monotone in the sliding speed, as `friction_turn` then accounts for the
# rest: there the rule's (1 - k) / (1 + k) is within 2 % of exp(-2 k), the decay of the sliding
# speed.
_STIFF, _SMALL = 1.0, 0.3
# Weight of the belt's friction beyond the trapezoidal rule where it is stiff. An oscillation from
# step to step decays by (1 - 0.2) / (1 + 0.2) a step, to 1 % after eleven steps.
_BELT_LAG = 0.2
# Largest excess L of static over kinetic friction [1], in (eps / w_s)^2, with which smoothed
# friction still rises with the sliding speed everywhere: with z = (w / w_s)^2 and r = eps / w_s the
# logarithm of (1 + L exp(-z)) / sqrt(1 + r^2 / z) rises where L < r^2 exp(z) / (2 z^2), least at z
# = 2.
_LEVEL = math.exp(2) / 8


def monotone(friction: AbstractFriction, sliding: Array, smoothing: Smoothing) -> Array:
    """1.0 where friction at rest is no larger than sliding friction, 0.0 where the jump from static
    to kinetic friction gives the equations of a step a second root."""
    scales = friction.scales(sliding)
    level = _LEVEL * (smoothing.slip_speed / smoothing.static_speed) ** 2
    return (scales.largest <= (1 + level) * scales.sliding).astype(sliding.dtype)


def _sticks(stiffness: Array, level: Array) -> Array:
    """1.0 where a corner with friction of this `stiffness` [1] sticks, 0.0 where it slides."""
    return (stiffness > _STIFF + level * (_SMALL - _STIFF)).astype(stiffness.dtype)


class BeltLag(NamedTuple):
    """By how much the belt's friction at a step's end outweighs that at its start, `weight` [1],
    and the parcel's `acceleration` by it at the start."""

    weight: Array
    acceleration: Acceleration


def belt_lag(mechanics: Mechanics, body: Body, step: Array) -> BeltLag | None:
    """The lag of the belt's friction for a step from `body`; `None` without a belt. The weight is
    `_BELT_LAG` for a stiff friction and falls to 0 as the stiffness falls to 1."""
    if mechanics.belt is None:
        return None
    force, (grip, grip_slope) = mechanics.belt.force(body, mechanics.fidelity.smoothing)
    slope = belt_slope(grip, grip_slope, mechanics.belt.slip(body).squared)
    stiffness = 0.5 * step * slope / mechanics.mass
    weight = _BELT_LAG * jnp.maximum(stiffness - _STIFF, 0.0) / jnp.maximum(stiffness, _STIFF)
    return BeltLag(weight, mechanics.acceleration(*force[:3]))


def corner_count(mechanics: Mechanics) -> int:
    """Number of corners with friction."""
    return sum(friction is not None for friction in mechanics.frictions)


def sticking_weights(mechanics: Mechanics, forces: Forces, step: Array) -> tuple[Array, ...]:
    """Weights of the contacts that have friction: 1.0 where the corner sticks, 0.0 where it
    slides."""
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
    """The weights of all contacts, 0 where there is no friction."""
    remaining = iter(sticking)
    return [0.0 if f is None else next(remaining) for f in mechanics.frictions]


def sticking_acceleration(
    mechanics: Mechanics,
    forces: Forces,
    sticking: tuple[Array, ...],
    normals: tuple[Array | None, ...] | None = None,
    steady: bool = False,
) -> Acceleration | None:
    """The acceleration by the friction at sticking corners; `None` where no corner has friction.

    `normals` [N], if given, replace the contacts' own normal forces. With `steady`, the friction
    has derivatives with the normal force alone, and none with the sliding speed.
    """
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
    """The acceleration that the next step begins with, and the part of it by friction at sticking
    corners, with the weights `sticking` now and `sticking_before`.

    The next step counts this friction by its value at the step's own end; the value at its start
    only moves the first guess of the displacement. Where a corner has just come to rest, to within
    some eps, the value at the start has a thousand times the slope with the sliding speed that a
    sticking corner has. So the friction of corners that newly stick is carried over as `steady`.
    """
    sticking_part = sticking_acceleration(mechanics, forces, sticking)
    if sticking_part is None:
        return forces.acceleration, None
    newly_sticking = tuple(
        now * (1 - before) for now, before in zip(sticking, sticking_before, strict=True)
    )
    steady = sticking_acceleration(mechanics, forces, newly_sticking, steady=True)
    varying = sticking_acceleration(mechanics, forces, newly_sticking)
    assert steady is not None
    assert varying is not None
    correction = [a - b for a, b in zip(steady, varying, strict=True)]
    begin, sticking_part = (
        Acceleration(*map(jnp.add, each, correction))
        for each in (forces.acceleration, sticking_part)
    )
    return begin, sticking_part


def sliding_velocities(
    mechanics: Mechanics, forces: Forces, sticking: tuple[Array, ...]
) -> tuple[Array, Array, Array]:
    """The part of the parcel's velocities by which sticking corners still slide: less these, the
    corners with the weights `sticking` are at rest."""
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
    outside of (0, 1), or where s is not `sliding` but nearly at rest."""
    turns = sliding & (ahead > 0) & (ahead < square)
    return jnp.where(turns, ahead / jnp.where(turns, square, 1.0), 1.0)


def reversal(
    mechanics: Mechanics,
    forces: Forces,
    change: tuple[Array, ...],
    drifts: list[list[Array]],
) -> Array:
    """Largest share of a Newton step, `-change`, in which no friction force passes its jump, which
    is where a sliding speed, or the slip on the belt, changes its sign. `drifts` [m/s/N], if given,
    are the sliding speeds of the corners by the normal forces at the fence."""
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
