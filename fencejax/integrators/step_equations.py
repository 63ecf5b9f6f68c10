"""The equations of a step for the unknowns at its end, for forces linear in time.

Unknown are the parcel's three velocities, one normal force a corner at a flexible fence and, where
friction loads the fence, the friction there. Newton's method (`newton`) solves them.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..model import Acceleration, FenceFrame, FencePoint, Forces, Mechanics, force_tolerance
from ..scenes import Body
from . import friction_tangent, friction_turn, newton_matrix
from .fence_response import FenceResponse
from .sliding_corner import Start
from .step_size import Stride


def _rotated(arm, turn):
    """An arm turned by a small angle, to the second order (the angle is of the third in the
    step)."""
    x, y = arm
    half = 1 - 0.5 * turn * turn
    return half * x - turn * y, half * y + turn * x


class StepEquations(eqx.Module):
    """The equations of a step for the unknowns at its end."""

    mechanics: Mechanics
    body: Body
    acceleration: Acceleration
    sticking_acceleration: Acceleration | None
    belt_lag: friction_tangent.BeltLag | None
    sticking: tuple[Array, ...]
    pressed: tuple[Array | None, ...]
    starts: tuple[Start | None, ...]
    predicted: Array
    arms: dict[int, tuple[Array, Array]]
    frame: FenceFrame | None
    fence: FenceResponse | None
    stride: Stride

    def body_at(self, rates) -> Body:
        """The parcel at the end with the velocities `rates`, for an acceleration linear over the
        step."""
        h = self.stride.length
        moved = (
            q + h * (2 * v0 + v1) / 3 + h * h * a0 / 6
            for q, v0, v1, a0 in zip(
                self.body[:3], self.body[3:], rates, self.acceleration, strict=True
            )
        )
        return Body(*moved, *rates)

    def split(self, unknowns) -> tuple[tuple[Array, ...], tuple[Array, ...], tuple[Array, ...]]:
        """The velocities, the normal forces at the fence and, where friction loads it, the
        friction."""
        end = 3 + len(self.mechanics.fence_corners)
        return unknowns[:3], unknowns[3:end], unknowns[end:]

    def points(self, unknowns) -> tuple[FencePoint, ...]:
        """The points of the fence at the end."""
        return () if self.fence is None else self.fence.points(*self.split(unknowns)[1:])

    def forces(self, unknowns, points: tuple[FencePoint, ...]) -> Forces:
        """The forces at the end."""
        rates, normals, _ = self.split(unknowns)
        after = self.body_at(rates)
        arms = {k: _rotated(arm, after.angle - self.predicted) for k, arm in self.arms.items()}
        return self.mechanics.forces(after, arms, self.frame, points, normals or None)

    def evaluate(self, unknowns):
        """Residual of the step's equations; its derivative at fixed directions and arms; the
        largest unbalanced force over the tolerated one; and the forces with that unbalance [N], and
        the state to carry over.

        The unknowns are three velocities, one normal force a corner at a flexible fence and, where
        friction loads the fence, the friction there.
        """
        h, mechanics = self.stride.length, self.mechanics
        rates, normals, frictions = self.split(unknowns)
        points = self.points(unknowns)
        forces = self.forces(unknowns, points)
        begin, end = self.acceleration, forces.acceleration
        at_start, sticking_change = self.sticking_acceleration, None
        at_end = friction_tangent.sticking_acceleration(
            mechanics, forces, self.sticking, self.pressed
        )
        if at_end is not None and at_start is not None:
            sticking_change = [b - a for a, b in zip(at_start, at_end, strict=True)]
            begin = [a - f for a, f in zip(begin, at_start, strict=True)]
            end = Acceleration(*map(jnp.add, end, at_end))
        belt_weight = 1.0
        if self.belt_lag is not None and forces.belt is not None:
            lag, was = self.belt_lag
            belt_weight = 1 + lag
            now = mechanics.acceleration(*forces.belt[:3])
            begin = [a - lag * f for a, f in zip(begin, was, strict=True)]
            end = Acceleration(*(a + lag * f for a, f in zip(end, now, strict=True)))
        turns = friction_turn.turns(
            mechanics, forces, self.sticking, self.pressed, self.starts, h
        )
        extra_motion = friction_turn.extra_motion(mechanics, forces, turns, sticking_change, h)
        end = friction_turn.turned(mechanics, forces, turns, end)
        residual = [
            v1 - v0 - 0.5 * h * (a0 + a1)
            for v1, v0, a0, a1 in zip(rates, self.body[3:], begin, end, strict=True)
        ]
        scales = (0.5 * h / mechanics.mass, 0.5 * h / mechanics.mass, 0.5 * h / mechanics.inertia)
        shares = friction_turn.shares(forces, turns)
        slopes = newton_matrix.friction_slopes(
            mechanics, forces, h, self.sticking, self.pressed, turns
        )
        block = newton_matrix.rate_matrix(
            mechanics, forces, h, bool(normals), shares, slopes, belt_weight
        )
        matrix = [[float(i == j) + scales[i] * block[i][j] for j in range(3)] for i in range(3)]
        drifts = self.drifts(points)
        for k, normal in enumerate(normals):
            assert self.fence is not None
            _, parts, law, response = forces.fence[k]
            assert law is not None
            assert response is not None
            residual.append(normal - law)
            stiffness = response.gap * h / 3 + response.gap_rate
            row = [stiffness * parts.normal[j] for j in range(3)]
            for other in range(len(normals + frictions)):
                give, give_rate = self.fence.compliance(k, other, normal)
                row.append(float(k == other) + response.gap * give + response.gap_rate * give_rate)
            matrix.append(row)
            for i in range(3):
                along = parts.normal[i] + shares[k] * parts.tangent[i]
                for drag, drift, other in zip(slopes, drifts, forces.fence, strict=False):
                    along = along + drag * drift[k] * other.touch.tangent[i]
                matrix[i].append(-scales[i] * along)
        if frictions:
            newton_matrix.add_frictions(matrix, residual, forces, frictions, scales, slopes, drifts)
        unbalance = mechanics.mass * jnp.maximum(jnp.abs(residual[0]), jnp.abs(residual[1]))
        turning = mechanics.inertia * jnp.abs(residual[2]) / mechanics.size
        unbalance = 2 * self.stride.rate * jnp.maximum(unbalance, turning)
        scale = mechanics.force_scale(forces)
        for defect in residual[3:]:
            unbalance = jnp.maximum(unbalance, jnp.abs(defect))
        size = unbalance / (force_tolerance(scale.dtype) * scale)
        sticking = friction_tangent.sticking_weights(mechanics, forces, h)
        carried = friction_tangent.carried_over(mechanics, forces, self.sticking, sticking)
        extra = (forces, unbalance, sticking, carried, extra_motion, drifts)
        return tuple(residual), matrix, size, extra

    def drifts(self, points: tuple[FencePoint, ...]) -> list[list[Array]]:
        """The sliding speed of each corner by each force, as the fence moves along itself [m/s/N];
        empty for a rigid fence or one without friction."""
        if self.fence is None or not self.fence.flexible or self.mechanics.fence_friction is None:
            return []
        loads = range(len(self.fence.loadings))
        return [[self.fence.drift(k, j, p.slope) for j in loads] for k, p in enumerate(points)]

    def force_jump(self, guess, root, forces: Forces) -> Array:
        """The largest difference of the forces from those of the guess [1]: of each normal force
        relative to itself and a twentieth of the size of all forces, and of the force that the
        parcel's motion corresponds to, relative to that size."""
        mechanics, scale = self.mechanics, self.mechanics.force_scale(forces)
        x, y, turn = (jnp.abs(a - b) for a, b in zip(guess[:3], root[:3], strict=True))
        turn = mechanics.inertia * turn / mechanics.size
        moved = jnp.maximum(mechanics.mass * jnp.maximum(x, y), turn)
        off = 2 * self.stride.rate * moved / scale
        for a, b in zip(self.split(guess)[1], self.split(root)[1], strict=True):
            off = jnp.maximum(off, jnp.abs(a - b) / (jnp.maximum(a, b) + 0.05 * scale))
        return jax.lax.stop_gradient(off)

    def at_rest(self, guess):
        """The guess with the sticking corners at rest.

        From there Newton's method finds the root with the corners at rest, if there is one. With a
        static friction above the kinetic one the equations have a second root, with sliding
        corners.
        """
        if not self.sticking:
            return guess
        forces = self.forces(guess, self.points(guess))
        slides = friction_tangent.sliding_velocities(self.mechanics, forces, self.sticking)
        rates = (v - w for v, w in zip(guess[:3], slides, strict=True))
        return (*rates, *guess[3:])

    def shorten(self, extra, change, last):
        """Share of a Newton step that stops at rest where the sliding of a corner, or the slip on
        the belt, would reverse.

        The friction force is a smoothed jump there, convex on either side: from rest Newton's
        method goes to the root without overshooting; from beyond it would alternate between the two
        sides. It would do so on the fall from static to kinetic friction too, which has an
        inflection: a step back by more than half the `last` one goes where the secant through the
        two points has its root.
        """
        share = friction_tangent.reversal(self.mechanics, extra[0], change, extra[-1])
        mass, inertia = self.mechanics.mass, self.mechanics.inertia
        work, square, last_square = (
            mass * (a[0] * b[0] + a[1] * b[1]) + inertia * a[2] * b[2]
            for a, b in ((change, last), (change, change), (last, last))
        )
        back = (work < 0) & (4 * square > last_square)
        ratio = jnp.sqrt(square / jnp.where(back, last_square, 1.0))
        return jnp.where(back, jnp.minimum(share, 1 / (1 + ratio)), share)
