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
import jax
import jax.numpy as jnp
from jaxtyping import Array

from . import newton
from .drive import DriveMotion
from .instant import FenceState, Instant, describe
from .link import Blocks, FencePoint, FlexibleLink, Shape, Vibration, dot, propagate
from .mechanics import Acceleration, Body, FenceFrame, Mechanics
from .propagation import Propagator


class Memory(NamedTuple):
    """The state of the integrator at a sample.

    `before` is the acceleration and `normals_before` the forces one step back, for the first guess
    alone; `lagged_rate` is the rate of the load that the modes left out carry.
    """

    body: Body
    acceleration: Acceleration
    before: Acceleration
    vibration: Vibration | None
    modal_force: Blocks
    places: tuple[Array, ...]
    sliding: tuple[Array, ...]
    normals: tuple[Array, ...]
    normals_before: tuple[Array, ...]
    lagged_rate: tuple[Array, ...]


class Clock(eqx.Module):
    """The start time [s] on the drive's clock, the step [s], the modes' maps over it and the number
    of Newton iterations."""

    start: Array
    maps: tuple[Propagator, ...]
    lag_decay: Array
    iterations: Array
    step: float = eqx.field(static=True)

    def __init__(self, mechanics: Mechanics, start: Array, step: float):
        self.start = start
        self.step = step
        self.iterations = jnp.full_like(start, mechanics.fidelity.iterations)
        self.maps = ()
        self.lag_decay = jnp.zeros_like(start)
        if mechanics.link is not None:
            self.maps = mechanics.link.propagators(step)
            lag = mechanics.link.lag
            slow = lag > 1e-2 * step
            decay = jnp.exp(-step / jnp.where(slow, lag, 1.0))
            self.lag_decay = jnp.where(slow, decay, 0.0)

    def time(self, index: Array) -> Array:
        """Time [s] of a sample since the scene's start."""
        return self.step * index


def contact_load(shapes: tuple[Shape, ...], normals, mass: Array, inertia: Blocks) -> Blocks:
    """Modal forces [m/s^2]: those of the swing, less the contact forces shared out by the shapes."""
    force = list(inertia)
    for shape, normal in zip(shapes, normals, strict=True):
        share = normal / mass
        force = [f - phi * share for f, phi in zip(force, shape.load, strict=True)]
    return tuple(force)


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
    fence: "FenceEnd | None"
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
        block = mechanics.rate_matrix(after, forces, h, bool(normals))
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
        size = unbalance / (_tolerance(scale.dtype) * scale)
        return tuple(residual), matrix, size, (forces, unbalance)

    def shorten(self, extra, change):
        """Share of a Newton step that stops a reversal of sliding, or of slip on the belt, at rest.

        The friction force there is a smoothed jump, convex on either side: from rest Newton's
        method climbs to the root without overshooting, from beyond it would jump to and fro.
        """
        return self.mechanics.reversal(extra[0], change[:3])


def _tolerance(dtype) -> float:
    """Unbalanced force that is let be, relative to the forces: 5e-7 in double precision."""
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
        fence = FenceEnd(mechanics, clock, memory, drive, places)
    guess = tuple(
        rate + h * (1.5 * now - 0.5 * before)
        for rate, now, before in zip(body[3:], was, memory.before, strict=True)
    )
    if fence is not None and fence.flexible:
        guess = guess + tuple(
            jnp.maximum(2 * now - before, 0.0)
            for now, before in zip(memory.normals, memory.normals_before, strict=True)
        )
    frame = mechanics.frame(drive, places)
    predicted = body.angle + h * (body.spin + 0.5 * h * was.angle)
    end = _End(mechanics, body, was, predicted, mechanics.arms(predicted), frame, fence, h)
    root, (forces, unbalance) = newton.solve(
        _End.evaluate, _End.shorten, end, guess, clock.iterations
    )
    after = end.body_at(root[:3])
    normals = tuple(c.normal for c in forces.fence)

    state, lagged_rate = None, ()
    if fence is not None:
        state = fence.state(normals)
        lagged_rate = state.lagged_rate if fence.link.residual is not None else ()
    feet = zip(places, forces.touches[: len(places)], strict=True)
    memory = Memory(
        body=after,
        acceleration=forces.acceleration,
        before=was,
        vibration=None if state is None else state.vibration,
        modal_force=() if state is None else state.modal_force,
        places=tuple(place + touch.foot_offset for place, touch in feet),
        sliding=tuple(c.sliding for c in forces.fence),
        normals=normals,
        normals_before=memory.normals,
        lagged_rate=lagged_rate,
    )
    return memory, describe(mechanics, time, after, forces, state), unbalance


class FenceEnd(eqx.Module):
    """The fence at the end of a step as a function of the contact forces there.

    With the small-deflection geometry the deflection, its rate and the slope at each place are
    affine in the forces, and Newton's method sees these few numbers instead of the modes.
    """

    link: FlexibleLink
    clock: Clock
    drive: DriveMotion
    places: tuple[Array, ...]
    normals_before: tuple[Array, ...]
    lagged_before: tuple[Array, ...]
    shapes: tuple[Shape, ...]
    inertia: Blocks
    free: Vibration
    affine: tuple
    geometry: str = eqx.field(static=True)

    def __init__(self, mechanics, clock, memory, drive, places):
        self.link = link = mechanics.link
        self.clock, self.drive, self.places = clock, drive, places
        self.normals_before, self.lagged_before = memory.normals, memory.lagged_rate
        self.geometry = mechanics.fidelity.geometry
        self.shapes = tuple(link.shape(place) for place in places)
        self.inertia = link.inertia_force(drive)
        self.free = propagate(clock.maps, memory.vibration, memory.modal_force, self.inertia)
        self.affine = tuple(self._affine(k) for k in range(len(places)))

    @property
    def flexible(self) -> bool:
        """Whether there are modes: a rigid fence does not answer to the forces."""
        return len(self.link.frequency_squared) > 0

    def _affine(self, k: int):
        """Deflection, its rate and slope at one place: at no contact force, and per newton [1/N]
        of each contact's force at the step's end."""
        shape, link = self.shapes[k], self.link
        free = (
            dot(shape.deflection, self.free.amplitude),
            dot(shape.deflection, self.free.rate),
            dot(shape.slope, self.free.amplitude),
        )
        gains = []
        for other in self.shapes:
            pushed = [m.q_end * b for m, b in zip(self.clock.maps, other.load, strict=True)]
            struck = [m.v_end * b for m, b in zip(self.clock.maps, other.load, strict=True)]
            gains.append(
                (
                    dot(shape.deflection, pushed) / link.mass_scale,
                    dot(shape.deflection, struck) / link.mass_scale,
                    dot(shape.slope, pushed) / link.mass_scale,
                )
            )
        return free, tuple(gains)

    def compliance(self, k: int, other: int):
        """How far [m/N] and how fast [m/s/N] place k gives way at the step's end for a force at
        another place there."""
        give, give_rate, _ = self.affine[k][1][other]
        own = self.shapes[k].residual
        if own is not None and k == other:
            by_rate = (1 - self.clock.lag_decay) / self.clock.step
            give = give + own * (1 - self.link.lag * by_rate)
            give_rate = give_rate + own * by_rate
        return give, give_rate

    def points(self, normals) -> tuple[FencePoint, ...]:
        """The point of the fence under each corner."""
        if not self.flexible:
            zero = jnp.zeros_like(self.drive.angle)
            return tuple(FencePoint(place, zero, zero, zero, zero) for place in self.places)
        return tuple(self._point(k, normals) for k in range(len(self.places)))

    def _point(self, k: int, normals) -> FencePoint:
        link, shape = self.link, self.shapes[k]
        extra, extra_rate = self._residual(k, normals[k])
        if self.geometry == "chord":
            return link.chord_point(shape, self._vibration(normals), extra, extra_rate)
        (deflection, rate, slope), gains = self.affine[k]
        for normal, (give, give_rate, lean) in zip(normals, gains, strict=True):
            deflection = deflection - give * normal
            rate = rate - give_rate * normal
            slope = slope - lean * normal
        if self.geometry == "arc":
            return link.arc_point(shape, self.free, deflection + extra, rate + extra_rate, slope)
        return link.small_point(shape, deflection + extra, rate + extra_rate, slope)

    def _residual(self, k: int, normal):
        """Deflection [m] of the modes left out and its rate: G r with r + beta rdot = N."""
        compliance = self.shapes[k].residual
        if compliance is None:
            return jnp.zeros_like(normal), jnp.zeros_like(normal)
        rate = self._lagged_rate(k, normal)
        return -compliance * (normal - self.link.lag * rate), -compliance * rate

    def _lagged_rate(self, k: int, normal):
        """rdot at the step's end, exact for a force linear over the step; finite as beta -> 0."""
        decay = self.clock.lag_decay
        slope = (normal - self.normals_before[k]) / self.clock.step
        return decay * self.lagged_before[k] + (1 - decay) * slope

    def _vibration(self, normals) -> Vibration:
        """The modes at the step's end."""
        amplitude, rate = list(self.free.amplitude), list(self.free.rate)
        for shape, normal in zip(self.shapes, normals, strict=True):
            share = normal / self.link.mass_scale
            for i, (phi, m) in enumerate(zip(shape.load, self.clock.maps, strict=True)):
                amplitude[i] = amplitude[i] - m.q_end * phi * share
                rate[i] = rate[i] - m.v_end * phi * share
        return Vibration(tuple(amplitude), tuple(rate))

    def state(self, normals) -> FenceState:
        """The fence under the solved forces."""
        load = contact_load(self.shapes, normals, self.link.mass_scale, self.inertia)
        lagged, rates = normals, tuple(jnp.zeros_like(n) for n in normals)
        if self.link.residual is not None:
            rates = tuple(self._lagged_rate(k, n) for k, n in enumerate(normals))
            lagged = tuple(n - self.link.lag * r for n, r in zip(normals, rates, strict=True))
        vibration = self._vibration(normals)
        return FenceState(self.drive, vibration, load, self.shapes, lagged, rates)


def first_instant(
    mechanics: Mechanics, clock: Clock, body: Body, vibration: Vibration | None, drive
) -> tuple[Memory, Instant]:
    """The memory and the sample at the start, from the motion of parcel and fence there."""
    link = mechanics.link
    places, shapes, points = (), (), ()
    zero = jnp.zeros_like(body.x)
    if link is not None:
        assert vibration is not None
        places = tuple(
            foot(mechanics, body, number, vibration, drive) for number in mechanics.fence_corners
        )
        shapes = tuple(link.shape(place) for place in places)
        points = tuple(fence_point(mechanics, shape, vibration) for shape in shapes)
    frame = mechanics.frame(drive, places)
    forces = mechanics.forces(body, mechanics.arms(body.angle), frame, points)
    normals = tuple(c.normal for c in forces.fence)
    state, inertia = None, ()
    if link is not None:
        assert vibration is not None
        inertia = contact_load(shapes, normals, link.mass_scale, link.inertia_force(drive))
        still = tuple(zero for _ in normals)
        state = FenceState(drive, vibration, inertia, shapes, normals, still)
    memory = Memory(
        body=body,
        acceleration=forces.acceleration,
        before=forces.acceleration,
        vibration=vibration,
        modal_force=inertia,
        places=places,
        sliding=tuple(c.sliding for c in forces.fence),
        normals=normals,
        normals_before=normals,
        lagged_rate=()
        if link is None or link.residual is None
        else tuple(zero for _ in normals),
    )
    return memory, describe(mechanics, jnp.zeros_like(clock.start), body, forces, state)


def fence_point(mechanics: Mechanics, shape: Shape, vibration: Vibration) -> FencePoint:
    """The point of the fence at a shape's place, in the geometry of the fidelity."""
    link = mechanics.link
    assert link is not None
    if not link.frequency_squared:
        zero = jnp.zeros_like(shape.place)
        return link.small_point(shape, zero, zero, zero)
    if mechanics.fidelity.geometry == "chord":
        zero = jnp.zeros_like(shape.place)
        return link.chord_point(shape, vibration, zero, zero)
    deflection = dot(shape.deflection, vibration.amplitude)
    rate = dot(shape.deflection, vibration.rate)
    slope = dot(shape.slope, vibration.amplitude)
    if mechanics.fidelity.geometry == "arc":
        return link.arc_point(shape, vibration, deflection, rate, slope)
    return link.small_point(shape, deflection, rate, slope)


def foot(
    mechanics: Mechanics, body: Body, number: int, vibration: Vibration, drive: DriveMotion
) -> Array:
    """Arc coordinate [m] of the foot of the perpendicular from a corner to the fence.

    Newton's method from the foot on the straight fence: sigma += (C - U).t, four times; the error
    falls by the factor curvature x gap each time.
    """
    link = mechanics.link
    assert link is not None
    arm_x, arm_y = mechanics.arms(body.angle)[number]
    cos_drive, sin_drive = jnp.cos(drive.angle), jnp.sin(drive.angle)
    x = (body.x + arm_x) * cos_drive + (body.y + arm_y) * sin_drive
    y = (body.y + arm_y) * cos_drive - (body.x + arm_x) * sin_drive

    def closer(_, place):
        point = fence_point(mechanics, link.shape(place), vibration)
        offset = (x - point.x) * jnp.cos(point.slope) + (y - point.y) * jnp.sin(point.slope)
        return place + offset

    return jax.lax.fori_loop(0, 4, closer, x)
