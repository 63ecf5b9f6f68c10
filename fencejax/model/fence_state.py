"""The fence at an instant: its vibration, the loads on it, and those on the modes left out."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from ..parts import DriveMotion
from .flexible_link import FlexibleLink
from .hinge import ClutchState
from .mechanics import Forces
from .mode_shapes import Blocks
from .pad import PadState
from .shape import Shape
from .vibration import Vibration


def bending_loads(shares: tuple[Array, ...], normals: tuple[Array, ...]) -> tuple[Array, ...]:
    """The parts of the contact forces [N] that bend the fence, `shares` [1] of them; by default
    all."""
    if not shares:
        return normals
    return tuple(share * n for share, n in zip(shares, normals, strict=True))


class ResidualMode(NamedTuple):
    """The modes left out as one load sees them: a massless mode of the shape lambda = sqrt(G), with
    G the static compliance [m/N] under the load that they lack. Its amplitude q [J^0.5] follows
    q + beta qdot = lambda N, beta the lag of all modes.

    A load that moves along the fence so finds their deflection lambda q, its rate lambda qdot and
    their slope q dlambda/dsigma, and no energy is gained or lost on the way. `force` is lambda N
    [J^0.5], `rate` qdot [J^0.5/s].
    """

    force: Array
    rate: Array


class FenceState(NamedTuple):
    """The fence at an instant: the drive's motion (`None` where it is not kept), the vibration with
    its modal forces, the shapes where it is loaded, the contact loads as the modes left out carry
    them (lagged force r [N] and its rate [N/s]), their residual mode under each, the `shares` [1]
    of the contact forces that bend it (empty where they do so whole), its cover under each
    (empty without one), its clutch (`None` without one), and the part of the modal forces by
    friction at sticking corners, `sticking_load`."""

    drive: DriveMotion | None
    vibration: Vibration
    modal_force: Blocks
    shapes: tuple[Shape, ...]
    lagged: tuple[Array, ...]
    lagged_rate: tuple[Array, ...]
    residual: tuple[ResidualMode, ...] = ()
    shares: tuple[Array, ...] = ()
    pads: tuple[PadState, ...] = ()
    clutch: ClutchState | None = None
    sticking_load: Blocks | None = None

    @classmethod
    def unloaded(cls, link: FlexibleLink, vibration: Vibration, places: int) -> "FenceState":
        """The state for a first step, without a load at any of the `places`."""
        zero = jnp.zeros_like(link.mass_scale)
        rates = (zero,) * places if link.corrected else ()
        residual = tuple(ResidualMode(zero, zero) for _ in rates)
        still = tuple(jnp.zeros_like(q) for q in vibration.amplitude)
        pads = () if link.cover is None else (PadState(zero, zero),) * places
        clutch = None
        if link.hinge is not None and link.hinge.clutch is not None:
            clutch = ClutchState(zero, zero)
        return cls(None, vibration, still, (), (), rates, residual, (), pads, clutch)

    def loads(self, forces: Forces) -> tuple[Array, ...]:
        """The parts of the contact forces that bend the fence [N]."""
        return bending_loads(self.shares, tuple(meeting.contact.normal for meeting in forces.fence))

    def kept(self) -> "FenceState":
        """The part of the state that the next step needs."""
        rates = self.lagged_rate if self.residual else ()
        force = self.modal_force
        if self.sticking_load is not None:
            force = tuple(f - load for f, load in zip(force, self.sticking_load, strict=True))
        return self._replace(
            drive=None, modal_force=force, shapes=(), lagged=(), lagged_rate=rates, shares=(),
            sticking_load=None,
        )  # fmt: skip
