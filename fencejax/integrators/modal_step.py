"""One step of the package's own integrator: exact in the beam, implicit in contact and friction.

Forces are taken to vary linearly over the step. The modes then advance exactly, whatever their
frequency, and the parcel's motion is a cubic. Unknown at the step's end are the parcel's three
velocities and one normal force a corner at the fence; everything else follows from these. Newton's
method finds them, and their derivatives come from the converged equations.

The foot of each corner on the fence is tracked: one Newton step on (C - U).t = 0 from the place
that the sliding speed predicts. The gap is stationary at the foot, so that the error of that place
enters the gap squared. The error of a step is of the third order, that of a solution of the second.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..model import (
    Acceleration,
    FenceFrame,
    FencePoint,
    Forces,
    Mechanics,
    SceneState,
    bending_loads,
    force_tolerance,
)
from ..scenes import Body
from . import friction_tangent, friction_turn, newton, newton_matrix
from .fence_response import FenceEnd
from .sliding_corner import Start, starts
from .step_control import contacts, controlled
from .step_defect import Pair
from .step_memory import Leans, Memory
from .step_size import Clock, Stride, next_step_size


def _rotated(arm, turn):
    """An arm turned by a small angle, to the second order (the angle is of the third in the
    step)."""
    x, y = arm
    half = 1 - 0.5 * turn * turn
    return half * x - turn * y, half * y + turn * x


class _End(eqx.Module):
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
    fence: FenceEnd | None
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


def step(mechanics: Mechanics, clock: Clock, memory: Memory, begin: Array, end: Array):
    """Advance from sample `begin` to sample `end`, counted in the clock's steps.

    Returns the new memory, the scene's state at `end`, the length of the step [s] and the largest
    force [N] by which the solved equations are out of balance.
    """
    stride = clock.stride(end - begin)
    h = stride.length
    body, start = memory.parcel, memory.acceleration
    time = clock.time(end)
    drive = None if mechanics.drive is None else mechanics.drive.motion(clock.start + time)
    speeds = memory.sliding
    if memory.drifts:
        speeds = tuple(w + drift for w, drift in zip(speeds, memory.drifts, strict=True))
    places = tuple(p + h * w for p, w in zip(memory.places, speeds, strict=True))
    ratio = 1.0
    if memory.step_size is not None:
        ratio = (end - begin) / jnp.maximum(memory.step_size.last, 1.0)
    leans = tuple(lean.now.ahead(lean.before, ratio) for lean in memory.leans)
    expected = tuple(
        jnp.maximum(now + ratio * (now - before), 0.0)
        for now, before in zip(memory.normals, memory.normals_before, strict=True)
    )
    fence, loaded = None, places
    if mechanics.link is not None:
        assert drive is not None
        assert memory.fence is not None
        loads = bending_loads(tuple(q.foreseen.share for q in memory.leans), memory.normals)
        if leans:
            loaded = tuple(map(mechanics.loaded, places, leans))
        shapes = tuple(map(mechanics.link.shape, loaded))
        shares = tuple(lean.share for lean in leans)
        friction_forces = sticking_before = ()
        if mechanics.link.second_order is not None:
            friction_forces = tuple(
                n * mechanics.drag(w) for n, w in zip(expected, memory.sliding, strict=True)
            )
            sticking_before = tuple(friction_tangent.by_contact(mechanics, memory.sticking))
        fence = FenceEnd(
            mechanics.link, stride, drive, memory.fence, loads, shapes, shares, expected,
            friction_forces, sticking_before,
        )  # fmt: skip
    guess = tuple(
        rate + h * (a + 0.5 * ratio * (a - before))
        for rate, a, before in zip(body[3:], start, memory.before, strict=True)
    )
    if fence is not None and fence.flexible:
        guess = guess + expected + fence.friction_forces
    frame = mechanics.frame(drive, places, loaded, memory.gone)
    predicted = body.angle + h * (body.spin + 0.5 * h * start.angle)
    arms = mechanics.arms(predicted)
    equations = _End(
        mechanics, body, start, memory.sticking_acceleration,
        friction_tangent.belt_lag(mechanics, memory.body, h), memory.sticking,
        (*memory.normals, *memory.normals_still),
        starts(mechanics, memory.sliding), predicted, arms, frame, fence, stride,
    )  # fmt: skip
    guess = equations.at_rest(jax.lax.stop_gradient(guess))
    root, (forces, unbalance, sticking, carried, extra_motion) = newton.solve(
        _End.evaluate,
        _End.shorten,
        equations,
        guess,
        clock.iterations,
        lambda extra: (extra[0].outcome(), *extra[1:-1]),
        mechanics.fidelity.gradient == "forward",
    )
    acceleration, sticking_acceleration = carried
    after = equations.body_at(root[:3])
    normals = tuple(meeting.contact.normal for meeting in forces.fence)
    frictions = sticking_now = ()
    if fence is not None and fence.friction_forces:
        frictions = tuple(mechanics.drag(meeting.contact.sliding) for meeting in forces.fence)
        sticking_now = friction_tangent.by_contact(mechanics, sticking)
    state = None if fence is None else fence.state(normals, frictions, sticking_now)
    size = None
    if memory.step_size is not None:
        jump = equations.force_jump(guess, root, forces)
        size = next_step_size(mechanics, clock, end - begin, jump, forces, memory.normals)
        control = memory.step_size.control
        if control is not None:
            tolerance = mechanics.fidelity.step_tolerance
            assert tolerance is not None
            pair = Pair(
                mechanics.law, mechanics.viscosity, mechanics.mass, mechanics.frictions,
                mechanics.fidelity.smoothing,
            )  # fmt: skip
            now = contacts(
                forces, () if frame is None else frame.shares, mechanics.frictions
            )
            was = memory.fence
            if fence is not None and was is not None and frictions:
                was = fence.state_before(was, normals, frictions)
            prediction_errors = tuple(
                normal * (meeting.touch.lean.share - lean.share)
                for normal, meeting, lean in zip(normals, forces.fence, leans, strict=False)
            )
            scale = mechanics.force_scale(forces)
            unsolved = unbalance > 2 * force_tolerance(scale.dtype) * scale
            size = controlled(
                pair, tolerance, clock, control, size, end, stride, now, fence, was, state,
                unsolved, mechanics.belt_defect(body, after), prediction_errors,
            )  # fmt: skip
    touches = tuple(meeting.touch for meeting in forces.fence)
    sliding = tuple(meeting.contact.sliding for meeting in forces.fence)
    feet = tuple(p + t.foot_offset for p, t in zip(loaded, touches, strict=True))
    drifts = ()
    if memory.drifts:
        drifts = tuple(
            jnp.where(stride.begins, 0.0, stride.rate * (new - old) - 0.5 * (was + now))
            for new, old, was, now in zip(feet, memory.places, memory.sliding, sliding, strict=True)
        )
    memory = Memory(
        body=after,
        extra_motion=extra_motion,
        acceleration=acceleration,
        before=memory.acceleration,
        fence=None if state is None else state.kept(),
        places=feet,
        sliding=sliding,
        drifts=drifts,
        normals=normals,
        normals_before=memory.normals,
        normals_still=tuple(
            None if friction is None else meeting.contact.normal
            for meeting, friction in zip(
                forces.still, mechanics.frictions[len(forces.fence) :], strict=True
            )
        ),
        sticking_acceleration=sticking_acceleration,
        sticking=sticking,
        gone=tuple(
            mechanics.gone(g, p, t) for g, p, t in zip(memory.gone, feet, touches, strict=True)
        ),
        leans=tuple(
            Leans(touch.lean, lean.now, foreseen)
            for touch, lean, foreseen in zip(touches, memory.leans, leans, strict=False)
        ),
        step_size=size,
    )
    return memory, SceneState(time, after, forces, state), h, unbalance
