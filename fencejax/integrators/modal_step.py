"""One step of the package's own integrator: exact in the beam, implicit in contact and friction.

Forces are taken to vary linearly over the step. The modes then advance exactly, whatever their
frequency, and the parcel's motion is a cubic. Unknown at the step's end are the parcel's three
velocities and one normal force a corner at the fence; everything else follows from these. Newton's
method finds them, and their derivatives come from the converged equations (`step_equations`).

The foot of each corner on the fence is tracked: one Newton step on (C - U).t = 0 from the place
that the sliding speed predicts. The gap is stationary at the foot, so that the error of that place
enters the gap squared. The error of a step is of the third order, that of a solution of the second.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..model import (
    FenceFrame,
    FenceState,
    Forces,
    Mechanics,
    SceneState,
    TipLoad,
    bending_loads,
    force_tolerance,
)
from ..parts import DriveMotion
from ..scenes import Body
from . import friction_tangent, newton
from .fence_response import FenceResponse
from .sliding_corner import starts
from .step_control import contacts, controlled
from .step_defect import ContactData
from .step_equations import StepEquations
from .step_memory import Memory, TipLoads
from .step_size import Clock, StepSize, Stride, next_step_size


class _Prediction(NamedTuple):
    """What is known of the end of a step before its equations are solved.

    `places`: of the corners along the fence [m], and `loaded`, those at which they load it, where
    they load its tip by `tip_loads`. `fence`: the fence there, loaded by the forces to be found.
    `guess`: the first values of the unknowns.
    """

    places: tuple[Array, ...]
    loaded: tuple[Array, ...]
    tip_loads: tuple[TipLoad, ...]
    fence: FenceResponse | None
    guess: tuple[Array, ...]


def _predicted(
    mechanics: Mechanics, memory: Memory, stride: Stride, drive: DriveMotion | None, steps: Array
) -> _Prediction:
    """The end of a step of so many of the clock's steps, continued from the one before."""
    h, start = stride.length, memory.acceleration
    speeds = memory.sliding
    if memory.drifts:
        speeds = tuple(w + drift for w, drift in zip(speeds, memory.drifts, strict=True))
    places = tuple(p + h * w for p, w in zip(memory.places, speeds, strict=True))
    ratio = 1.0
    if memory.step_size is not None:
        ratio = steps / jnp.maximum(memory.step_size.last, 1.0)
    tip_loads = tuple(tip_load.now.ahead(tip_load.before, ratio) for tip_load in memory.tip_loads)
    normals = tuple(
        jnp.maximum(now + ratio * (now - before), 0.0)
        for now, before in zip(memory.normals, memory.normals_before, strict=True)
    )
    fence, loaded = None, places
    if mechanics.link is not None:
        assert drive is not None
        if tip_loads:
            loaded = tuple(map(mechanics.loaded, places, tip_loads))
        fence = _loaded_fence(mechanics, memory, stride, drive, loaded, tip_loads, normals)
    guess = tuple(
        rate + h * (a + 0.5 * ratio * (a - before))
        for rate, a, before in zip(memory.body[3:], start, memory.acceleration_before, strict=True)
    )
    if fence is not None and fence.flexible:
        guess = guess + normals + fence.friction_forces
    return _Prediction(places, loaded, tip_loads, fence, guess)


def _loaded_fence(
    mechanics: Mechanics,
    memory: Memory,
    stride: Stride,
    drive: DriveMotion,
    loaded: tuple[Array, ...],
    tip_loads: tuple[TipLoad, ...],
    normals: tuple[Array, ...],
) -> FenceResponse:
    """The fence at the end of a step, loaded at the places `loaded` [m], as far as it is known
    before the forces are; `normals` [N] are the expected ones."""
    assert mechanics.link is not None
    assert memory.fence is not None
    foreseen = tuple(tip_load.foreseen.share for tip_load in memory.tip_loads)
    loads = bending_loads(foreseen, memory.normals)
    shapes = tuple(map(mechanics.link.shape, loaded))
    shares = tuple(tip_load.share for tip_load in tip_loads)
    friction_forces = sticking = ()
    if mechanics.link.second_order is not None:
        friction_forces = tuple(
            n * mechanics.drag(w) for n, w in zip(normals, memory.sliding, strict=True)
        )
        sticking = tuple(friction_tangent.by_contact(mechanics, memory.sticking))
    return FenceResponse(
        mechanics.link, stride, drive, memory.fence, loads, shapes, shares, normals,
        friction_forces, sticking,
    )  # fmt: skip


def _equations(
    mechanics: Mechanics,
    memory: Memory,
    stride: Stride,
    predicted: _Prediction,
    frame: FenceFrame | None,
) -> StepEquations:
    """The equations of a step."""
    h, body, start = stride.length, memory.parcel, memory.acceleration
    angle = body.angle + h * (body.spin + 0.5 * h * start.angle)
    arms = mechanics.arms(angle)
    return StepEquations(
        mechanics, body, start, memory.sticking_acceleration,
        friction_tangent.belt_lag(mechanics, memory.body, h), memory.sticking,
        (*memory.normals, *memory.normals_still),
        starts(mechanics, memory.sliding), angle, arms, frame, predicted.fence, stride,
    )  # fmt: skip


class _Solved(NamedTuple):
    """The end of a step whose equations are solved: the unknowns, the parcel, the forces and the
    largest of them [N] out of balance, and the fence with its loads by friction."""

    root: tuple[Array, ...]
    body: Body
    forces: Forces
    unbalance: Array
    normals: tuple[Array, ...]
    frictions: tuple[Array, ...]
    state: FenceState | None


def _next_step_size(
    clock: Clock,
    memory: Memory,
    equations: StepEquations,
    predicted: _Prediction,
    guess: tuple[Array, ...],
    solved: _Solved,
    steps: Array,
    end: Array,
) -> StepSize | None:
    """The length of the next step, by how far the forces went off their straight continuation and,
    under error control, by the defect of this one."""
    if memory.step_size is None:
        return None
    mechanics, forces = equations.mechanics, solved.forces
    jump = equations.force_jump(guess, solved.root, forces)
    size = next_step_size(mechanics, clock, steps, jump, forces, memory.normals)
    control = memory.step_size.control
    if control is None:
        return size
    tolerance = mechanics.fidelity.step_tolerance
    assert tolerance is not None
    contact = ContactData(
        mechanics.law, mechanics.viscosity, mechanics.mass, mechanics.frictions,
        mechanics.fidelity.smoothing,
    )  # fmt: skip
    frame, fence, was = equations.frame, predicted.fence, memory.fence
    now = contacts(forces, () if frame is None else frame.shares, mechanics.frictions)
    if fence is not None and was is not None and solved.frictions:
        was = fence.state_before(was, solved.normals, solved.frictions)
    tip_loads = [meeting.touch.tip_load for meeting in forces.fence]
    prediction_errors = tuple(
        normal * (tip_load.share - expected.share)
        for normal, tip_load, expected in zip(
            solved.normals, tip_loads, predicted.tip_loads, strict=False
        )
        if tip_load is not None
    )
    scale = mechanics.force_scale(forces)
    unsolved = solved.unbalance > 2 * force_tolerance(scale.dtype) * scale
    return controlled(
        contact, tolerance, clock, control, size, end, equations.stride, now, fence, was,
        solved.state, unsolved, mechanics.belt_defect(equations.body, solved.body),
        prediction_errors,
    )  # fmt: skip


def step(mechanics: Mechanics, clock: Clock, memory: Memory, begin: Array, end: Array):
    """Advance from sample `begin` to sample `end`, counted in the clock's steps.

    Returns the new memory, the scene's state at `end`, the length of the step [s] and the largest
    force [N] by which the solved equations are out of balance.
    """
    steps = end - begin
    stride = clock.stride(steps)
    time = clock.time(end)
    drive = None if mechanics.drive is None else mechanics.drive.motion(clock.start + time)
    predicted = _predicted(mechanics, memory, stride, drive, steps)
    frame = mechanics.frame(drive, predicted.places, predicted.loaded, memory.gone)
    equations = _equations(mechanics, memory, stride, predicted, frame)
    guess = equations.at_rest(jax.lax.stop_gradient(predicted.guess))
    root, (forces, unbalance, sticking, carried, extra_motion) = newton.solve(
        StepEquations.evaluate,
        StepEquations.shorten,
        equations,
        guess,
        clock.iterations,
        lambda extra: (extra[0].outcome(), *extra[1:-1]),
    )
    acceleration, sticking_acceleration = carried
    after = equations.body_at(root[:3])
    fence, normals = predicted.fence, tuple(meeting.contact.normal for meeting in forces.fence)
    frictions = sticking_now = ()
    if fence is not None and fence.friction_forces:
        frictions = tuple(mechanics.drag(meeting.contact.sliding) for meeting in forces.fence)
        sticking_now = friction_tangent.by_contact(mechanics, sticking)
    state = None if fence is None else fence.state(normals, frictions, sticking_now)
    solved = _Solved(root, after, forces, unbalance, normals, frictions, state)
    size = _next_step_size(clock, memory, equations, predicted, guess, solved, steps, end)
    touches = tuple(meeting.touch for meeting in forces.fence)
    sliding = tuple(meeting.contact.sliding for meeting in forces.fence)
    feet = tuple(p + t.foot_offset for p, t in zip(predicted.loaded, touches, strict=True))
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
        acceleration_before=memory.acceleration,
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
        tip_loads=tuple(
            TipLoads(touch.tip_load, tip_load.now, foreseen)
            for touch, tip_load, foreseen in zip(
                touches, memory.tip_loads, predicted.tip_loads, strict=False
            )
        ),
        step_size=size,
    )
    return memory, SceneState(time, after, forces, state), stride.length, unbalance
