"""Integration by a general solver of diffrax: much slower, and an independent check.

Forces follow from the state alone.
"""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..model import (
    FenceState,
    FlexibleLink,
    Forces,
    Mechanics,
    SceneState,
    TipLoad,
    Vibration,
)
from ..parts import DriveMotion
from ..scenes import Body
from .observer import Observer
from .step_size import Clock


def foot(
    link: FlexibleLink, x: Array, y: Array, vibration: Vibration, drive: DriveMotion
) -> Array:
    """Arc coordinate [m] of the foot of the perpendicular from the point (x, y) [m] to the fence.

    Newton's method from the foot on the straight fence: sigma += (C - U).t, four times; the error
    falls by the factor curvature x gap each time. The last two are differentiated, which leaves
    that factor squared in the derivative.
    """
    cosine, sine = jnp.cos(drive.angle), jnp.sin(drive.angle)
    along, across = x * cosine + y * sine, y * cosine - x * sine

    def closer(given, place):
        link, vibration, along, across = given
        point = link.point(link.shape(place), vibration)
        offset = (along - point.x) * jnp.cos(point.slope)
        return place + offset + (across - point.y) * jnp.sin(point.slope)

    given = (link, vibration, along, across)
    fixed = jax.lax.stop_gradient(given)
    near = jax.lax.fori_loop(0, 2, lambda _, place: closer(fixed, place), fixed[2])
    return closer(given, closer(given, near))


def at_state(
    mechanics: Mechanics, body: Body, vibration: Vibration | None, drive: DriveMotion | None
) -> tuple[Forces, FenceState | None]:
    """Forces on the parcel and the fence's state, every contact force from the contact law.

    The modes left out carry the contact forces without lag.
    """
    link, arms = mechanics.link, mechanics.arms(body.angle)
    if link is None:
        return mechanics.forces(body, arms, None, ()), None
    assert vibration is not None
    assert drive is not None
    corners = [arms[number] for number in mechanics.fence_corners]
    places = tuple(foot(link, body.x + x, body.y + y, vibration, drive) for x, y in corners)

    def forces_at(loaded):
        shapes = tuple(link.shape(place) for place in loaded)
        points = tuple(link.point(shape, vibration) for shape in shapes)
        frame = mechanics.frame(drive, places, loaded)
        return mechanics.forces(body, arms, frame, points), shapes

    forces, shapes = forces_at(places)
    shares = ()
    if mechanics.sides:
        tip_loads = _tip_loads(forces)
        forces, shapes = forces_at(tuple(map(mechanics.loaded, places, tip_loads)))
        shares = tuple(tip_load.share for tip_load in _tip_loads(forces))
    if link.second_order is not None:
        shapes = tuple(
            link.followed(shape, vibration.amplitude).with_friction(mechanics.drag(what.sliding))
            for shape, (what, *_) in zip(shapes, forces.fence, strict=True)
        )
    still = tuple(jnp.zeros_like(place) for place in places)
    fence = FenceState(drive, vibration, (), shapes, (), still, (), shares)
    loads = fence.loads(forces)
    load = link.loaded(link.drive_force(drive), shapes, loads)
    if link.hinge is not None:
        coupling = link.hinge.coupling(vibration.rate)
        load = tuple(f + g for f, g in zip(load, coupling, strict=True))
    return forces, fence._replace(modal_force=load, lagged=loads)


def _tip_loads(forces: Forces) -> tuple[TipLoad, ...]:
    """The `TipLoad` of each corner, where the fence's tip may carry a contact; empty otherwise."""
    tip_loads = (meeting.touch.tip_load for meeting in forces.fence)
    return tuple(tip_load for tip_load in tip_loads if tip_load is not None)


def run(
    mechanics: Mechanics,
    clock: Clock,
    body: Body,
    vibration: Vibration | None,
    steps: int,
    observer: Observer,
) -> tuple[Any, Any, Array]:
    """Integrate a scene as a plain ordinary differential equation by a solver of diffrax.

    Every mode is a state (all modes: the full finite-element model), the contact force follows from
    the state, and the foot of each corner is searched for at every state; there is no residual
    compliance of modes left out. The observer sees the states at every `step`. Returns the
    observer's record, the values that it saves at every sample, and whether the solver has
    succeeded.
    """
    fidelity = mechanics.fidelity
    link = mechanics.link

    def drive_at(time):
        return None if mechanics.drive is None else mechanics.drive.motion(clock.start + time)

    # Traced once, however often the stages and their Jacobians call it.
    @jax.jit
    def field(time, y, args):
        del args
        body, vibration = y
        forces, fence = at_state(mechanics, body, vibration, drive_at(time))
        moved = Body._make((*body[3:], *forces.acceleration))
        if link is None or fence is None:
            return moved, None
        return moved, Vibration(vibration.rate, link.acceleration(vibration, fence.modal_force))

    import diffrax

    times = clock.step * jnp.arange(steps + 1, dtype=body.x.dtype)
    tolerance = fidelity.tolerance
    solver = fidelity.integrator
    if isinstance(solver, str):
        solver = {"kvaerno5": diffrax.Kvaerno5, "tsit5": diffrax.Tsit5}[solver]()
    first_step, controller = clock.step, diffrax.ConstantStepSize()
    if isinstance(solver, diffrax.AbstractAdaptiveSolver):
        # A step to a non-finite state is rejected at every length: it ends at the shortest step.
        first_step, controller = 1e-6, diffrax.PIDController(
            rtol=tolerance, atol=1e-3 * tolerance, dtmin=1e-12, force_dtmin=False
        )
    if fidelity.gradient == "reverse":
        adjoint = diffrax.RecursiveCheckpointAdjoint()
    else:
        adjoint = diffrax.ForwardMode()
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(field),
        solver,
        t0=times[0],
        t1=times[-1],
        dt0=first_step,
        y0=(body, vibration),
        saveat=diffrax.SaveAt(ts=times),
        stepsize_controller=controller,
        adjoint=adjoint,
        max_steps=500_000,
        throw=False,
    )

    def state_at(time, y):
        body, vibration = y
        forces, fence = at_state(mechanics, body, vibration, drive_at(time))
        return SceneState(time, body, forces, fence)

    states = jax.vmap(state_at)(times, solution.ys)
    one = jax.tree.map(lambda x: x[0], states)

    def take(record, numbered):
        state, length = numbered
        record = observer.update(record, state, length, jnp.zeros_like(length))
        return record, observer.saved(record)

    lengths = jnp.full_like(times, clock.step).at[0].set(0.0)
    record, samples = jax.lax.scan(take, observer.begin(one, body), (states, lengths))
    done = (solution.result == diffrax.RESULTS.successful).astype(times.dtype)
    return record, samples, done
