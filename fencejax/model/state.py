"""A scene at one instant, as an integrator passes it to its observer."""

from typing import NamedTuple

from jaxtyping import Array

from ..scenes import Body
from .fence_state import FenceState
from .mechanics import Forces


class SceneState(NamedTuple):
    """A scene at one instant: the `time` since its start [s], the parcel's motion, the forces on
    it, and the fence (`None` where there is none)."""

    time: Array
    body: Body
    forces: Forces
    fence: FenceState | None


class NormalState(NamedTuple):
    """A scene of the normal direction at one instant: the `time` since its start [s], the parcel's
    `advance` [m] beyond the fence at rest and its `rate` [m/s], the contact `force` [N], the `gap`
    D [m] and its rate [m/s], and the fence (`None` for a rigid wall)."""

    time: Array
    advance: Array
    rate: Array
    force: Array
    gap: Array
    gap_rate: Array
    fence: FenceState | None
