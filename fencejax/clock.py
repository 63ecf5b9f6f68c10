"""Time in a scene: where the drive's clock stands, and what advances with the step."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from .mechanics import Mechanics
from .propagation import Propagator, relaxation


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
            self.lag_decay = relaxation(mechanics.link.lag, step)

    def time(self, index: Array) -> Array:
        """Time [s] of a sample since the scene's start."""
        return self.step * index
