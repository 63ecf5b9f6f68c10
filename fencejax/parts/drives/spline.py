"""A free-form motion."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ... import _check
from ..._check import Bounds
from .abstract import CYCLE_TIME, AbstractDrive
from .segments import span_at


class SplineDrive(AbstractDrive):
    """A free-form motion: a uniform cubic B-spline with traced control points.

    alpha_w(t) = sum_k c_k B(t / dt - k), with B the cubic B-spline. The spline starts and ends at
    alpha_w = 0 with no speed and no acceleration: three control points at each end are zero and
    the given ones lie between them. The acceleration is continuous and piecewise linear.

    >>> f"{fj.SplineDrive([0.1, 0.4, 0.66, 0.4, 0.1]).angle(0.68):.4f} rad"
    '0.5733 rad'
    """

    control_angles: Array
    cycle_time: Array
    turn: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "control_angles": Bounds("rad", least=-100.0, most=100.0),
        "cycle_time": Bounds("s", above=0, size=1.0),
        "turn": Bounds(above=0, most=1),
    }

    def __init__(
        self, control_angles: ArrayLike, cycle_time: ArrayLike = CYCLE_TIME, turn: ArrayLike = 0.5
    ):
        """**Arguments:**

        - `control_angles`: shape (K,), the free control points [rad].
        - `cycle_time`: t_c [s].
        - `turn`: the end of the way out as a share of the cycle [1]; used to find when an angle is
          reached, and nowhere else.
        """
        limits = self.bounds["control_angles"]._asdict()
        self.control_angles = _check.vector("control_angles", control_angles, **limits)
        _check.fields(self, cycle_time=cycle_time, turn=turn)

    def angle(self, time: Array) -> Array:
        padded = jnp.pad(self.control_angles, (3, 3))
        spans = self.control_angles.shape[0] + 3
        index, s = span_at(time / self.cycle_time, spans)
        weights = (
            (1 - s) ** 3 / 6,
            (3 * s**3 - 6 * s**2 + 4) / 6,
            (-3 * s**3 + 3 * s**2 + 3 * s + 1) / 6,
            s**3 / 6,
        )
        total = jnp.zeros_like(s)
        for k, weight in enumerate(weights):
            total = total + padded[index + k] * weight
        return total

    @property
    def cycle(self) -> Array:
        return self.cycle_time

    @property
    def turning_time(self) -> Array:
        return self.turn * self.cycle_time
