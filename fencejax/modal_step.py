"""One step of the package's own integrator: exact in the beam, implicit in contact and friction.

Forces are taken to vary linearly over the step. The modes then advance exactly, whatever their
frequency, and the parcel's motion is a cubic. Unknown at the step's end are the parcel's three
velocities and one normal force a corner at the fence; everything else follows from these. Newton's
method finds them, and their derivative comes from the converged equations.

The foot of each corner on the fence is tracked: one Newton step on (C - U).t = 0 from the place
that the sliding speed predicts. The gap is stationary at the foot, so that the error of that place
enters it squared. The error of a step is of the third order, that of a solution of the second.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from . import newton
from .clock import Clock
from .drive import DriveMotion
from .explicit import at_state
from .fence_end import FenceEnd
from .instant import FenceState, Instant, describe
from .kinematics import Acceleration, Body
from .link import Vibration
from .mechanics import FenceFrame, Mechanics


class Memory(NamedTuple):
    """The state of the integrator at a sample.

    `fence` holds the vibration, its modal forces and the rates of the loads that the modes left
    out carry, and nothing else; `before` is the acceleration and `normals_before` the forces one
    step back, for the first guess alone; `gone` is 1 for a corner that has left over the tip.
    """

    body: Body
    acceleration: Acceleration
    before: Acceleration
    fence: FenceState | None
    places: tuple[Array, ...]
    sliding: tuple[Array, ...]
    normals: tuple[Array, ...]
    normals_before: tuple[Array, ...]
    gone: tuple[Array, ...]


def _rotated(arm, turn):
    """An arm turned on by a small angle, to the second order (it is of the third in the step)."""
    x, y = arm
    half = 1 - 0.5 * turn * turn
    return half * x - turn * y, half * y + turn * x


class _End(eqx.Module):
    """What the equations at the end of a step are made of."""

    mechanics: Mechanics
    body: Body
    acceleration: Acceleration
    predicted: Array
    arms: dict[int, tuple[Array, Array]]
    frame: FenceFrame | None
    fence: FenceEnd | None
    step: float = eqx.field(static=True)

    def body_at(self, rates) -> Body:
        """The parcel at the end with the velocities `rates`, its acceleration linear between."""
        h = self.step
        moved = (
            q + h * (2 * v0 + v1) / 3 + h * h * a0 / 6
            for q, v0, v1, a0 in zip(
                self.body[:3], self.body[3:], rates, self.acceleration, strict=True
            )
        )
        return Body(*moved, *rates)

    def evaluate(self, unknowns):
        """Residual of the step's equations, their derivative at frozen directions and arms, the
        largest unbalanced force against what is tolerated, and the forces with that unbalance [N].

        Unknown are three velocities and a normal force a corner at a flexible fence.
        """
        h, mechanics = self.step, self.mechanics
        rates, normals = unknowns[:3], unknowns[3:]
        after = self.body_at(rates)
        arms = {k: _rotated(arm, after.angle - self.predicted) for k, arm in self.arms.items()}
        points = () if self.fence is None else self.fence.points(normals)
        forces = mechanics.forces(after, arms, self.frame, points, normals or None)
        residual = [
            v1 - v0 - 0.5 * h * (a0 + a1)
            for v1, v0, a0, a1 in zip(
                rates, self.body[3:], self.acceleration, forces.acceleration, strict=True
            )
        ]
        scales = (0.5 * h / mechanics.mass, 0.5 * h / mechanics.mass, 0.5 * h / mechanics.inertia)
        block = mechanics.rate_matrix(forces, h, bool(normals))
        matrix = [[float(i == j) + scales[i] * block[i][j] for j in range(3)] for i in range(3)]
        for k, normal in enumerate(normals):
            assert self.fence is not None
            parts, response = forces.touches[k], forces.responses[k]
            residual.append(normal - forces.laws[k])
            press = response.gap * h / 3 + response.gap_rate
            row = [press * parts.normal[j] for j in range(3)]
            for other in range(len(normals)):
                give, give_rate = self.fence.compliance(k, other)
                row.append(float(k == other) + response.gap * give + response.gap_rate * give_rate)
            matrix.append(row)
            for i in range(3):
                along = parts.normal[i] + response.share * parts.tangent[i]
                matrix[i].append(-scales[i] * along)
        unbalance = jnp.maximum(jnp.abs(residual[0]), jnp.abs(residual[1])) / scales[0]
        unbalance = jnp.maximum(unbalance, jnp.abs(residual[2]) / (scales[2] * mechanics.size))
        scale = mechanics.force_scale(forces)
        for defect in residual[3:]:
            unbalance = jnp.maximum(unbalance, jnp.abs(defect))
        size = unbalance / (tolerance(scale.dtype) * scale)
        return tuple(residual), matrix, size, (forces, unbalance)

    def shorten(self, extra, change):
        """Share of a Newton step that stops a reversal of sliding, or of slip on the belt, at rest.

        The friction force there is a smoothed jump, convex on either side: from rest Newton's
        method climbs to the root without overshooting, from beyond it would jump to and fro.
        """
        return self.mechanics.reversal(extra[0], change[:3])


def tolerance(dtype) -> float:
    """Unbalanced force that is let be, relative to the forces: 5e-7 in double precision, 2e-3 in
    single precision."""
    return float(jnp.finfo(dtype).eps) ** 0.4


def step(mechanics: Mechanics, clock: Clock, memory: Memory, index: Array):
    """Advance from sample `index` to the next.

    Returns the new memory, its sample and the largest force [N] that the solved equations leave
    unbalanced.
    """
    h = clock.step
    body, was = memory.body, memory.acceleration
    time = clock.time(index + 1)
    drive = None if mechanics.drive is None else mechanics.drive.motion(clock.start + time)
    places = tuple(p + h * w for p, w in zip(memory.places, memory.sliding, strict=True))
    fence = None
    if mechanics.link is not None:
        assert drive is not None
        assert memory.fence is not None
        fence = FenceEnd(mechanics.link, clock, drive, memory.fence, memory.normals, places)
    guess = tuple(
        rate + h * (1.5 * now - 0.5 * before)
        for rate, now, before in zip(body[3:], was, memory.before, strict=True)
    )
    if fence is not None and fence.flexible:
        guess = guess + tuple(
            jnp.maximum(2 * now - before, 0.0)
            for now, before in zip(memory.normals, memory.normals_before, strict=True)
        )
    frame = mechanics.frame(drive, places, memory.gone)
    predicted = body.angle + h * (body.spin + 0.5 * h * was.angle)
    end = _End(mechanics, body, was, predicted, mechanics.arms(predicted), frame, fence, h)
    root, (forces, unbalance) = newton.solve(
        _End.evaluate, _End.shorten, end, guess, clock.iterations
    )
    after = end.body_at(root[:3])
    normals = tuple(c.normal for c in forces.fence)

    state = None if fence is None else fence.state(normals)
    touches = forces.touches[: len(places)]
    feet = tuple(p + t.foot_offset for p, t in zip(places, touches, strict=True))
    memory = Memory(
        body=after,
        acceleration=forces.acceleration,
        before=was,
        fence=_kept(state),
        places=feet,
        sliding=tuple(c.sliding for c in forces.fence),
        normals=normals,
        normals_before=memory.normals,
        gone=tuple(
            mechanics.gone(g, p, t.gap) for g, p, t in zip(memory.gone, feet, touches, strict=True)
        ),
    )
    return memory, describe(mechanics, time, after, forces, state), unbalance


def first(
    mechanics: Mechanics,
    body: Body,
    vibration: Vibration | None,
    drive: DriveMotion | None,
) -> tuple[Memory, Instant]:
    """The memory and the sample at the start, from the motion of parcel and fence there."""
    forces, fence = at_state(mechanics, body, vibration, drive)
    normals = tuple(c.normal for c in forces.fence)
    memory = Memory(
        body=body,
        acceleration=forces.acceleration,
        before=forces.acceleration,
        fence=_kept(fence),
        places=tuple(c.place for c in forces.fence),
        sliding=tuple(c.sliding for c in forces.fence),
        normals=normals,
        normals_before=normals,
        gone=tuple(jnp.zeros_like(n) for n in normals),
    )
    return memory, describe(mechanics, jnp.zeros_like(body.x), body, forces, fence)


def _kept(fence: FenceState | None) -> FenceState | None:
    """What the next step needs of the fence's state."""
    if fence is None:
        return None
    corrected = any(shape.residual is not None for shape in fence.shapes)
    rates = fence.lagged_rate if corrected else ()
    return fence._replace(drive=None, shapes=(), lagged=(), lagged_rate=rates)
