"""The state that a step hands on to the next one."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from ..model import Acceleration, FenceState, Mechanics, TipLoad, Vibration
from ..parts import DriveMotion
from ..scenes import Body
from . import friction_tangent
from .step_control import Control
from .step_size import StepSize, stride_counts


class TipLoads(NamedTuple):
    """How a corner loads the fence: now, one step back, and as predicted for now."""

    now: TipLoad
    before: TipLoad
    foreseen: TipLoad


class Memory(NamedTuple):
    """The state of the integrator at a sample.

    - `body`: the position at which the forces at the sample are computed;
    - `extra_motion` (x, y [m], angle [rad]): what friction on corners that come to rest within the
      step adds to the parcel's displacement (`friction_turn`), `None` without friction;
    - `acceleration`, at the sample, and `acceleration_before`, one step back;
    - `fence`: the vibration, its modal forces, the rates of the loads that the modes left out carry
      and their residual mode, and nothing else;
    - `places`, `sliding`: the corners' feet on the fence [m] and their sliding speeds [m/s];
    - `drifts`, under error control: how much faster [m/s] each corner's foot moves along the fence
      than the corner does, so that steps of different lengths find the same foot;
    - `normals` and `normals_before`: the normal forces at the fence [N] now and one step back;
      like `acceleration_before`, the latter serves the first guess alone;
    - `normals_still`: those at still surfaces that have friction;
    - `sticking_acceleration`: the parcel's acceleration by static friction at sticking corners,
      each weighted by `sticking` [1]; `None` and `()` without friction;
    - `gone`: 1 for a corner that has left over the tip;
    - `tip_loads`: how each corner loads the fence, where the tip may carry a contact;
    - `step_size`: the length of the next step and what decides it; `None` for fixed steps.
    """

    body: Body
    extra_motion: Acceleration | None
    acceleration: Acceleration
    acceleration_before: Acceleration
    fence: FenceState | None
    places: tuple[Array, ...]
    sliding: tuple[Array, ...]
    drifts: tuple[Array, ...]
    normals: tuple[Array, ...]
    normals_before: tuple[Array, ...]
    normals_still: tuple[Array | None, ...]
    sticking_acceleration: Acceleration | None
    sticking: tuple[Array, ...]
    gone: tuple[Array, ...]
    tip_loads: tuple[TipLoads, ...]
    step_size: StepSize | None

    @property
    def parcel(self) -> Body:
        """The parcel at the start of the next step."""
        body, extra = self.body, self.extra_motion
        if extra is None:
            return body
        return body._replace(x=body.x + extra.x, y=body.y + extra.y, angle=body.angle + extra.angle)

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
        zeros = tuple(zero for _ in places)
        still = Acceleration(zero, zero, zero)
        upright = TipLoad(zero + 1, zero)
        tip_loads = (TipLoads(upright, upright, upright),) * len(places) if mechanics.sides else ()
        size = StepSize(zero, zero + 1) if stride_counts(mechanics.fidelity)[-1] > 1 else None
        if mechanics.fidelity.step_tolerance is not None:
            size = StepSize(zero, zero + 1, Control.start(mechanics.frictions, len(places), zero))
        sticking = tuple(zero for _ in range(friction_tangent.corner_count(mechanics)))
        at_rest = still if sticking else None
        drifts = () if mechanics.fidelity.step_tolerance is None else zeros
        normals_still = tuple(
            None if friction is None else zero for friction in mechanics.frictions[len(places) :]
        )
        return cls(
            body, at_rest, still, still, fence, places, zeros, drifts, zeros, zeros, normals_still,
            at_rest, sticking, zeros, tip_loads, size,
        )  # fmt: skip
