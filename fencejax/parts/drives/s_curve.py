"""The trapezoid with limited jerk."""

from typing import ClassVar

from jaxtyping import Array, ArrayLike

from ... import _check
from ..._check import Bounds
from .segments import ROUNDING, AbstractSegmentDrive, out_and_back


class SCurveDrive(AbstractSegmentDrive):
    """The trapezoid with limited jerk: seven segments a stroke, a dwell, the same way back.

    >>> f"{fj.SCurveDrive(jerk=100.0, dwell=0.1).cycle:.3f} s"
    '1.508 s'
    """

    end_angle: Array
    top_speed: Array
    acceleration: Array
    jerk: Array
    dwell: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "end_angle": Bounds("rad", above=0, most=3.1, size=1.0),
        "top_speed": Bounds("rad/s", above=0, size=1.0),
        "acceleration": Bounds("rad/s^2", above=0, size=10.0),
        "jerk": Bounds("rad/s^3", above=0, size=100.0),
        "dwell": Bounds("s", least=0, size=1.0),
    }

    def __init__(
        self,
        end_angle: ArrayLike = 0.6623,
        top_speed: ArrayLike = 1.53,
        acceleration: ArrayLike = 8.0,
        jerk: ArrayLike = 80.0,
        dwell: ArrayLike = 0.0,
    ):
        """**Arguments:**

        - `end_angle`: the stroke [rad], at least v (v / a + a / j).
        - `top_speed`: v [rad/s]. `acceleration`: a [rad/s^2], at most sqrt(v j).
        - `jerk`: j [rad/s^3].
        - `dwell` [s] at the end of the stroke, at least 0.
        """
        _check.fields(
            self, end_angle=end_angle, top_speed=top_speed, acceleration=acceleration, jerk=jerk,
            dwell=dwell,
        )  # fmt: skip
        ramp, rise, cruise = self._segments
        _check.scalar(
            "top_speed / acceleration - acceleration / jerk", rise - ramp, least=0, unit="s",
            remedy="Lower `acceleration` or raise `jerk`: the top speed is reached before it.",
        )
        _check.scalar(
            "end_angle / top_speed - top_speed / acceleration - acceleration / jerk",
            cruise - rise - ramp, least=0, unit="s",
            remedy="Lower `top_speed`: the stroke is too short to reach it.",
        )

    @property
    def _segments(self):
        """a / j, v / a and alpha / v [s]: the jerk's, the acceleration's and the speed's time."""
        return (
            self.acceleration / self.jerk,
            self.top_speed / self.acceleration,
            self.end_angle / self.top_speed,
        )

    @property
    def _stroke(self):
        ramp, rise, cruise = self._segments
        return ramp + rise + cruise

    @property
    def feasible(self) -> Array:
        """Whether the acceleration and the top speed are reached, within rounding."""
        ramp, rise, cruise = self._segments
        return (rise * (1 + ROUNDING) >= ramp) & (cruise * (1 + ROUNDING) >= rise + ramp)

    def angle(self, time: Array) -> Array:
        ramp, rise, cruise = self._segments
        sixth = self.jerk / 6
        ramp_up = ((0.0, sixth), (ramp, -sixth), (rise, -sixth), (rise + ramp, sixth))
        ramp_down = tuple((cruise + knot, -weight) for knot, weight in ramp_up)
        return out_and_back(time, self.dwell, self._stroke, ramp_up + ramp_down, 3)
