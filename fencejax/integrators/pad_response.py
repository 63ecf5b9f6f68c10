"""The fence's cover under one load at the end of a step, as a function of that load."""

from typing import NamedTuple

from jaxtyping import Array

from ..model import Cover, PadState
from .step_size import Stride


class PadResponse(NamedTuple):
    """A cover at the end of a step, with the state `before` at its start.

    Its settled strain e_s is taken as linear over the step. e + tau edot = e_s is then solved
    exactly, and stably for any tau:

        edot_1 = exp(-h / tau) edot_0 + (1 - exp(-h / tau)) (e_s1 - e_s0) / h.

    The compression is of the second order in the step, its rate too where tau is as long as a step;
    with a shorter one the rate is that of the step's middle.
    """

    cover: Cover
    before: PadState
    decay: Array
    gain: Array

    @classmethod
    def of(cls, cover: Cover, before: PadState, stride: Stride) -> "PadResponse":
        """Over a stride."""
        assert stride.pad_decay is not None
        assert stride.pad_gain is not None
        return cls(cover, before, stride.pad_decay, stride.pad_gain)

    def at(self, settled: Array) -> PadState:
        """The state at the end with the settled strain e_s [1] there."""
        change = settled - self.before.settled
        return PadState(settled, self.decay * self.before.rate + self.gain * change)

    def state(self, load: Array) -> PadState:
        """The state at the end under a load [N]."""
        return self.at(self.cover.settled(load))

    def compression(self, load: Array) -> tuple[Array, Array]:
        """The compression of the cover [m] and its rate [m/s] under a load [N]."""
        return self.cover.compression(self.state(load))

    def compliance(self, load: Array) -> tuple[Array, Array]:
        """The derivatives of both in the load [m/N], [m/s/N]."""
        slope = self.cover.pad.thickness * self.cover.settled_slope(load)
        return slope * (1 - self.cover.lag * self.gain), slope * self.gain
