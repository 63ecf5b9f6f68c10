"""Constant acceleration, constant speed, constant deceleration."""

from typing import ClassVar

from jaxtyping import Array, ArrayLike

from ... import _check
from ..._check import Bounds
from .segments import ROUNDING, AbstractSegmentDrive, out_and_back


class TrapezoidDrive(AbstractSegmentDrive):
    """Constant acceleration, constant speed, constant deceleration; a dwell; the same way back.

    The acceleration jumps four times a stroke: use `SCurveDrive` where that must not be.

    >>> f"{fj.TrapezoidDrive(acceleration=8.0).turning_time:.3f} s"
    '0.624 s'
    """

    end_angle: Array
    top_speed: Array
    acceleration: Array
    dwell: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "end_angle": Bounds("rad", above=0, most=3.1, size=1.0),
        "top_speed": Bounds("rad/s", above=0, size=1.0),
        "acceleration": Bounds("rad/s^2", above=0, size=10.0),
        "dwell": Bounds("s", least=0, size=1.0),
    }

    def __init__(
        self,
        end_angle: ArrayLike = 0.6623,
        top_speed: ArrayLike = 1.53,
        acceleration: ArrayLike = 6.0,
        dwell: ArrayLike = 0.0,
    ):
        """**Arguments:**

        - `end_angle`: the stroke [rad], above top_speed^2 / acceleration.
        - `top_speed` [rad/s], `acceleration` [rad/s^2], above 0.
        - `dwell` [s] at the end of the stroke, at least 0.
        """
        _check.fields(
            self, end_angle=end_angle, top_speed=top_speed, acceleration=acceleration, dwell=dwell,
        )  # fmt: skip
        _check.scalar(
            "end_angle - top_speed^2 / acceleration",
            self.end_angle - self.top_speed**2 / self.acceleration,
            least=0,
            unit="rad",
            remedy="Raise `acceleration` or lower `top_speed`: the stroke is too short for it.",
        )

    @property
    def _stroke(self):
        return self.end_angle / self.top_speed + self.top_speed / self.acceleration

    @property
    def feasible(self) -> Array:
        """Whether the stroke is long enough for the top speed, within rounding."""
        return self.end_angle * (1 + ROUNDING) >= self.top_speed**2 / self.acceleration

    def angle(self, time: Array) -> Array:
        ramp = self.top_speed / self.acceleration
        cruise = self.end_angle / self.top_speed
        half = 0.5 * self.acceleration
        impulses = ((0.0, half), (ramp, -half), (cruise, -half), (cruise + ramp, half))
        return out_and_back(time, self.dwell, self._stroke, impulses, 2)
