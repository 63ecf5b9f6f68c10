"""What a step hands on to the next one."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from ..model import Acceleration, FenceState, Lean, Mechanics, Vibration
from ..parts import DriveMotion
from ..scenes import Body
from . import friction_tangent
from .step_control import Control
from .step_size import StepSize, stride_counts


class Leans(NamedTuple):
    """How a corner loads the fence: now, one step back, and as it was foreseen for now."""

    now: Lean
    before: Lean
    foreseen: Lean


class Memory(NamedTuple):
    """The state of the integrator at a sample.

    `body` is where the forces at the sample are those of; `way` (x, y [m], angle [rad]) how much
    further the parcel has gone by friction on corners (`friction_turn.way`), absent without it;
    `fence` holds the vibration, its modal forces, the rates of the loads that the modes left out
    carry and their residual mode, and nothing else; `before` is the acceleration and
    `normals_before` the forces one step back, for the first guess alone; `normals_still` those of
    still surfaces that have friction;
    `drifts`, under error control, is how much faster [m/s] each corner's foot moves along the fence
    than the corner does: steps of different lengths must find the same foot;
    `held` is the acceleration by the frictions that hold a corner, by the weights `sticking`, both
    absent without friction; `gone` is 1 for a corner that has left over the tip. Where the tip may
    carry a contact, `leans` say how each corner loads the fence.
    """

    body: Body
    way: Acceleration | None
    acceleration: Acceleration
    before: Acceleration
    fence: FenceState | None
    places: tuple[Array, ...]
    sliding: tuple[Array, ...]
    drifts: tuple[Array, ...]
    normals: tuple[Array, ...]
    normals_before: tuple[Array, ...]
    normals_still: tuple[Array | None, ...]
    held: Acceleration | None
    sticking: tuple[Array, ...]
    gone: tuple[Array, ...]
    leans: tuple[Leans, ...]
    step_size: StepSize | None

    @property
    def parcel(self) -> Body:
        """Where the next step begins."""
        body, way = self.body, self.way
        if way is None:
            return body
        return body._replace(x=body.x + way.x, y=body.y + way.y, angle=body.angle + way.angle)

    @classmethod
    def at_rest(
        cls,
        mechanics: Mechanics,
        body: Body,
        vibration: Vibration | None,
        drive: DriveMotion | None,
    ) -> "Memory":
        """The memory before a scene's first step, which has no length and finds the forces.

        The feet of the corners are those on the straight fence: right where a scene begins with a
        fence at rest, and else wrong by the bending times the gap, which that first step mends.
        """
        zero = jnp.zeros_like(body.x)
        arms = mechanics.arms(body.angle)
        fence, places = None, ()
        if mechanics.link is not None:
            assert vibration is not None
            assert drive is not None
            cosine, sine = jnp.cos(drive.angle), jnp.sin(drive.angle)
            places = tuple(
                (body.x + arms[k][0]) * cosine + (body.y + arms[k][1]) * sine
                for k in mechanics.fence_corners
            )
            fence = FenceState.unloaded(mechanics.link, vibration, len(places))
        none = tuple(zero for _ in places)
        still = Acceleration(zero, zero, zero)
        upright = Lean(zero + 1, zero)
        leans = tuple(Leans(upright, upright, upright) for _ in places) if mechanics.sides else ()
        size = StepSize(zero, zero + 1) if stride_counts(mechanics.fidelity)[-1] > 1 else None
        if mechanics.fidelity.step_tolerance is not None:
            size = StepSize(zero, zero + 1, Control.start(mechanics.frictions, len(places), zero))
        sticking = tuple(zero for _ in range(friction_tangent.count(mechanics)))
        held = way = still if sticking else None
        drifts = () if mechanics.fidelity.step_tolerance is None else none
        rubbing = tuple(
            None if friction is None else zero for friction in mechanics.frictions[len(places) :]
        )
        return cls(
            body, way, still, still, fence, places, none, drifts, none, none, rubbing, held,
            sticking, none, leans, size,
        )  # fmt: skip
