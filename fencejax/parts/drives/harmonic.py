"""A harmonic cycle."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ... import _check
from ..._check import Bounds
from .abstract import CYCLE_TIME, AbstractDrive
from .segments import within


class HarmonicDrive(AbstractDrive):
    """alpha_w = 1/2 alpha_max (1 - cos(2 pi t / t_c)) for 0 <= t <= t_c, at rest afterwards, with
    alpha_max = alphadot_max t_c / pi.

    The default has the paper's top speed and cycle time and sweeps the tip to y = 0.738 m.

    >>> motion = fj.HarmonicDrive().motion(0.34)
    >>> f"{motion.angle:.4f} rad, {motion.speed:.2f} rad/s"
    '0.3312 rad, 1.53 rad/s'
    """

    top_speed: Array
    cycle_time: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "top_speed": Bounds("rad/s", least=0, size=1.0),
        "cycle_time": Bounds("s", above=0, size=1.0),
    }

    def __init__(self, top_speed: ArrayLike = 1.53, cycle_time: ArrayLike = CYCLE_TIME):
        """**Arguments:** `top_speed`: alphadot_max [rad/s], at least 0. `cycle_time`: t_c [s]."""
        _check.fields(self, top_speed=top_speed, cycle_time=cycle_time)

    def angle(self, time: Array) -> Array:
        phase = within(time * (1 / self.cycle_time))
        return 0.5 * self.amplitude * (1.0 - jnp.cos(2.0 * jnp.pi * phase))

    @property
    def amplitude(self) -> Array:
        """alpha_max [rad], where the drive turns back."""
        return self.top_speed * self.cycle_time / jnp.pi

    @property
    def cycle(self) -> Array:
        return self.cycle_time

    @property
    def turning_time(self) -> Array:
        return 0.5 * self.cycle_time
