"""The fence's elastic cover under a load, in series with the contact."""

from typing import NamedTuple

import equinox as eqx
from jaxtyping import Array

from ..parts import Fence, Pad


class PadState(NamedTuple):
    """The cover under one load: the strain e_s [1] that it settles at under that load, and the rate
    edot [1/s] of its present strain e = e_s - tau edot."""

    settled: Array
    rate: Array


class Cover(eqx.Module):
    """A pad on a fence: the part and its force scale F_0 = E a z [N]."""

    pad: Pad
    scale: Array

    def __init__(self, fence: Fence):
        assert fence.pad is not None
        self.pad, self.scale = fence.pad, fence.pad.force_scale(fence.width)

    @property
    def lag(self) -> Array:
        """tau [s]."""
        return self.pad.retardation_time

    def settled(self, load: Array) -> Array:
        """e_s [1] under a load [N]."""
        return self.pad.strain(load, self.scale)

    def settled_slope(self, load: Array) -> Array:
        """The derivative of e_s in the load [1/N]."""
        return self.pad.strain_slope(load, self.scale)

    def compression(self, state: PadState) -> tuple[Array, Array]:
        """H e [m] and its rate [m/s]."""
        strain = state.settled - self.lag * state.rate
        return self.pad.thickness * strain, self.pad.thickness * state.rate

    def stored_energy(self, state: PadState) -> Array:
        """[J]."""
        return self.pad.stored_energy(state.settled - self.lag * state.rate, self.scale)
