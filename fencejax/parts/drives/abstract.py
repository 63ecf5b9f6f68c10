"""Drive laws: the angle of the rigid link over time, alpha_w(t).

A law gives the angle alone. Speed and acceleration follow from it by differentiation, so the
three are consistent by construction.
"""

import abc
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ...printing import Part

CYCLE_TIME = 1.36
"""t_c of Piatkowski (2010) [s]."""


class DriveMotion(NamedTuple):
    """Angle [rad], angular speed [rad/s] and angular acceleration [rad/s^2] of the drive, and the
    torque [N m] that it gives; `None` where the motion is given, and the torque follows."""

    angle: Array
    speed: Array
    acceleration: Array
    torque: Array | None = None


class AbstractDrive(Part):
    """A law alpha_w(t), with alpha_w = 0 and the fence at rest at t = 0.

    >>> class Swing(fj.AbstractDrive):
    ...     cycle, turning_time = jnp.array(1.0), jnp.array(0.5)
    ...     def angle(self, time):
    ...         return 0.33 * (1 - jnp.cos(2 * jnp.pi * time))
    >>> f"{Swing().motion(0.25).speed:.2f} rad/s", fj.scenes.oblique_impact(drive=Swing()).drive
    ('2.07 rad/s', Swing())
    """

    @property
    def feasible(self) -> Array | None:
        """Whether the law's numbers are consistent; `None` for a law whose numbers are
        independent."""
        return None

    @abc.abstractmethod
    def angle(self, time: Array) -> Array:
        """alpha_w [rad] at `time` [s]."""

    @property
    @abc.abstractmethod
    def cycle(self) -> Array:
        """Time [s] from the start until the drive is back at its start (or has ended its
        motion)."""

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
        followed by two Newton steps, which carry the first and the second derivative.
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
        rate = jnp.where(moving, 1 / jnp.where(moving, speed, 1.0), 0.0)
        for _ in range(2):
            time = time - rate * (self.angle(time) - angle)
        return time
