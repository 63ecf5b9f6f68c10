"""Drive laws: the angle of the rigid link over time, alpha_w(t).

A law gives the angle alone. Speed and acceleration follow from it by differentiation, so the
three are consistent by construction.
"""

import abc
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from . import _check
from ._check import Bounds

_ROUNDING = 1e-6

CYCLE_TIME = 1.36
"""t_c of Piatkowski (2010) [s]."""


class DriveMotion(NamedTuple):
    """Angle [rad], angular speed [rad/s] and angular acceleration [rad/s^2] of the drive."""

    angle: Array
    speed: Array
    acceleration: Array


class AbstractDrive(eqx.Module):
    """A law alpha_w(t), with alpha_w = 0 and the fence at rest at t = 0."""

    bounds: ClassVar[dict[str, Bounds]] = {}

    @property
    def feasible(self) -> Array | None:
        """Whether the law's numbers fit together; `None` where each stands for itself."""
        return None

    @abc.abstractmethod
    def angle(self, time: Array) -> Array:
        """alpha_w [rad] at `time` [s]."""

    @property
    @abc.abstractmethod
    def cycle(self) -> Array:
        """Time [s] from the start until the drive is home again (or has done all it does)."""

    @property
    @abc.abstractmethod
    def turning_time(self) -> Array:
        """End [s] of the way out: until then alpha_w does not decrease."""

    def motion(self, time: ArrayLike) -> DriveMotion:
        """Angle, speed and acceleration at `time` [s], the last two by differentiation."""
        time = 1.0 * jnp.asarray(time)
        one = jnp.ones_like(time)

        def speed(t):
            return jax.jvp(self.angle, (t,), (one,))

        (angle, rate), (_, acceleration) = jax.jvp(speed, (time,), (one,))
        return DriveMotion(angle, rate, acceleration)

    def time_at(self, angle: ArrayLike) -> Array:
        """The time [s] on the way out at which alpha_w equals `angle` [rad].

        Bisection on [0, `turning_time`], which ends at a bound where the angle is never reached,
        followed by one Newton step, which carries the derivative.
        """
        angle = 1.0 * jnp.asarray(angle)
        frozen = jax.lax.stop_gradient(self)
        target = jax.lax.stop_gradient(angle)
        low = jnp.zeros_like(frozen.turning_time + target)
        high = frozen.turning_time + low

        def halve(_, bracket):
            low, high = bracket
            middle = 0.5 * (low + high)
            beyond = frozen.angle(middle) > target
            return jnp.where(beyond, low, middle), jnp.where(beyond, middle, high)

        low, high = jax.lax.fori_loop(0, 60, halve, (low, high))
        time = 0.5 * (low + high)
        speed = frozen.motion(time).speed
        moving = (speed > 0) & (low > 0) & (high < frozen.turning_time)
        return time - jnp.where(
            moving, (self.angle(time) - angle) / jnp.where(moving, speed, 1.0), 0.0
        )


class HarmonicDrive(AbstractDrive):
    """alpha_w = 1/2 alpha_max (1 - cos(2 pi t / t_c)) for 0 <= t <= t_c, at rest afterwards, with
    alpha_max = alphadot_max t_c / pi.

    The default has the paper's top speed and cycle time and sweeps the tip to y = 0.738 m.
    """

    top_speed: Array
    cycle_time: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "top_speed": Bounds("rad/s", least=0, size=1.0),
        "cycle_time": Bounds("s", above=0, size=1.0),
    }

    def __init__(self, top_speed: ArrayLike = 1.53, cycle_time: ArrayLike = CYCLE_TIME):
        """**Arguments:** `top_speed`: alphadot_max [rad/s], at least 0. `cycle_time`: t_c [s]."""
        self.top_speed = _check.field(self, "top_speed", top_speed)
        self.cycle_time = _check.field(self, "cycle_time", cycle_time)

    def angle(self, time: Array) -> Array:
        phase = _within(time / self.cycle_time)
        amplitude = self.top_speed * self.cycle_time / jnp.pi
        return 0.5 * amplitude * (1.0 - jnp.cos(2.0 * jnp.pi * phase))

    @property
    def cycle(self) -> Array:
        return self.cycle_time

    @property
    def turning_time(self) -> Array:
        return 0.5 * self.cycle_time


class HeldDrive(AbstractDrive):
    """alpha_w = constant [rad]: the fence stands still."""

    held_angle: Array
    hold_time: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "held_angle": Bounds("rad", least=-1.5, most=1.5),
        "hold_time": Bounds("s", above=0, size=1.0),
    }

    def __init__(self, held_angle: ArrayLike = 0.3, hold_time: ArrayLike = CYCLE_TIME):
        """**Arguments:** `held_angle` [rad]. `hold_time` [s]: how long a scene lasts by default."""
        self.held_angle = _check.field(self, "held_angle", held_angle)
        self.hold_time = _check.field(self, "hold_time", hold_time)

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


class ConstantSpeedDrive(AbstractDrive):
    """alpha_w = alphadot t, up to an end angle, where the drive stops dead.

    The fence is taken to move at that speed from the start, undeformed.
    """

    speed: Array
    end_angle: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "speed": Bounds("rad/s", above=0, size=1.0),
        "end_angle": Bounds("rad", above=0, most=3.1, size=1.0),
    }

    def __init__(self, speed: ArrayLike = 1.53, end_angle: ArrayLike = 0.6623):
        """**Arguments:** `speed` [rad/s], above 0. `end_angle` [rad], above 0."""
        self.speed = _check.field(self, "speed", speed)
        self.end_angle = _check.field(self, "end_angle", end_angle)

    def angle(self, time: Array) -> Array:
        return jnp.minimum(self.speed * time, self.end_angle)

    @property
    def cycle(self) -> Array:
        return self.end_angle / self.speed

    @property
    def turning_time(self) -> Array:
        return self.end_angle / self.speed


def _out_and_back(time, dwell, stroke, impulses, power):
    """Sum of c (t - t_k)_+^power over the knots of the way out, and the same reversed for the way
    back after the dwell."""
    total = jnp.zeros_like(time)
    for start, sign in ((0.0, 1.0), (stroke + dwell, -1.0)):
        for knot, weight in impulses:
            since = time - start - knot
            total = total + sign * weight * jnp.where(since < 0, 0.0, since) ** power
    return total


def _within(phase):
    """Clip to [0, 1] with the derivative from within at both ends (`jnp.clip` halves it there)."""
    return jnp.where(phase < 0, 0.0, jnp.where(phase > 1, 1.0, phase))


class TrapezoidDrive(AbstractDrive):
    """Constant acceleration, constant speed, constant deceleration; a dwell; the same way back.

    The acceleration jumps four times a stroke: use `SCurveDrive` where that must not be.
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
        self.end_angle = _check.field(self, "end_angle", end_angle)
        self.top_speed = _check.field(self, "top_speed", top_speed)
        self.acceleration = _check.field(self, "acceleration", acceleration)
        self.dwell = _check.field(self, "dwell", dwell)
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
        return self.end_angle * (1 + _ROUNDING) >= self.top_speed**2 / self.acceleration

    def angle(self, time: Array) -> Array:
        ramp = self.top_speed / self.acceleration
        cruise = self.end_angle / self.top_speed
        half = 0.5 * self.acceleration
        impulses = ((0.0, half), (ramp, -half), (cruise, -half), (cruise + ramp, half))
        return _out_and_back(time, self.dwell, self._stroke, impulses, 2)

    @property
    def cycle(self) -> Array:
        return 2 * self._stroke + self.dwell

    @property
    def turning_time(self) -> Array:
        return self._stroke


class SCurveDrive(AbstractDrive):
    """The trapezoid with limited jerk: seven segments a stroke, a dwell, the same way back."""

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
        self.end_angle = _check.field(self, "end_angle", end_angle)
        self.top_speed = _check.field(self, "top_speed", top_speed)
        self.acceleration = _check.field(self, "acceleration", acceleration)
        self.jerk = _check.field(self, "jerk", jerk)
        self.dwell = _check.field(self, "dwell", dwell)
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
        return (rise * (1 + _ROUNDING) >= ramp) & (cruise * (1 + _ROUNDING) >= rise + ramp)

    def angle(self, time: Array) -> Array:
        ramp, rise, cruise = self._segments
        sixth = self.jerk / 6
        ramp_up = ((0.0, sixth), (ramp, -sixth), (rise, -sixth), (rise + ramp, sixth))
        ramp_down = tuple((cruise + knot, -weight) for knot, weight in ramp_up)
        return _out_and_back(time, self.dwell, self._stroke, ramp_up + ramp_down, 3)

    @property
    def cycle(self) -> Array:
        return 2 * self._stroke + self.dwell

    @property
    def turning_time(self) -> Array:
        return self._stroke


class SplineDrive(AbstractDrive):
    """A free-form motion: a uniform cubic B-spline with traced control points.

    alpha_w(t) = sum_k c_k B(t / dt - k), with B the cubic B-spline. The spline starts and ends at
    alpha_w = 0 with no speed and no acceleration: three control points at each end are zero and
    the given ones lie between them. The acceleration is continuous and piecewise linear.
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
        self.cycle_time = _check.field(self, "cycle_time", cycle_time)
        self.turn = _check.field(self, "turn", turn)

    def angle(self, time: Array) -> Array:
        padded = jnp.pad(self.control_angles, (3, 3))
        spans = self.control_angles.shape[0] + 3
        place = _within(time / self.cycle_time) * spans
        floor = jnp.clip(jnp.floor(jax.lax.stop_gradient(place)), 0.0, spans - 1.0)
        index, s = floor.astype(int), place - floor
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
