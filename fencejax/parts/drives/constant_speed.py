"""Constant speed up to an end angle."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ... import _check
from ..._check import Bounds
from .abstract import AbstractDrive


class ConstantSpeedDrive(AbstractDrive):
    """alpha_w = alphadot t, up to an end angle, where the drive stops dead.

    The fence is taken to move at that speed from the start, undeformed.

    >>> f"{fj.ConstantSpeedDrive(speed=1.2).time_at(0.6):.2f} s"
    '0.50 s'
    """

    speed: Array
    end_angle: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "speed": Bounds("rad/s", above=0, size=1.0),
        "end_angle": Bounds("rad", above=0, most=3.1, size=1.0),
    }

    def __init__(self, speed: ArrayLike = 1.53, end_angle: ArrayLike = 0.6623):
        """**Arguments:** `speed` [rad/s], above 0. `end_angle` [rad], above 0."""
        _check.fields(self, speed=speed, end_angle=end_angle)

    def angle(self, time: Array) -> Array:
        return jnp.minimum(self.speed * time, self.end_angle)

    @property
    def cycle(self) -> Array:
        return self.end_angle / self.speed

    @property
    def turning_time(self) -> Array:
        return self.end_angle / self.speed
