"""A fence that stands still."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ... import _check
from ..._check import Bounds
from .abstract import CYCLE_TIME, AbstractDrive


class HeldDrive(AbstractDrive):
    """alpha_w = constant [rad]: the fence stands still.

    >>> fj.scenes.oblique_impact(drive=fj.HeldDrive(held_angle=0.3)).drive
    HeldDrive(held_angle=0.3 rad, hold_time=1.36 s)
    """

    held_angle: Array
    hold_time: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "held_angle": Bounds("rad", least=-1.5, most=1.5),
        "hold_time": Bounds("s", above=0, size=1.0),
    }

    def __init__(self, held_angle: ArrayLike = 0.3, hold_time: ArrayLike = CYCLE_TIME):
        """**Arguments:** `held_angle` [rad]. `hold_time` [s]: how long a scene lasts by default."""
        _check.fields(self, held_angle=held_angle, hold_time=hold_time)

    def angle(self, time: Array) -> Array:
        return self.held_angle + 0.0 * time

    @property
    def cycle(self) -> Array:
        return self.hold_time

    @property
    def turning_time(self) -> Array:
        return self.hold_time

    def time_at(self, angle: ArrayLike) -> Array:
        """0: a fence that stands still is at its angle from the start."""
        return jnp.zeros_like(self.held_angle + jnp.asarray(angle))
