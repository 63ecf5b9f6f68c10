"""Drives that give a torque; the hinge's angle follows from it."""

import abc
from collections.abc import Callable
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ... import _check
from ..._check import Bounds
from .abstract import CYCLE_TIME, AbstractDrive, DriveMotion
from .segments import span_at

AT_HINGE = {
    "inertia": Bounds("kg m^2", above=0, size=1.0),
    "damping": Bounds("N m s/rad", least=0, size=100.0),
    "stiffness": Bounds("N m/rad", least=0, size=1e3),
}
"""Bounds of what every torque drive has at the hinge."""
_STEPS = 64
_SEARCH = 256


class AbstractTorqueDrive(AbstractDrive):
    """A law T(t) of the torque that drives the hinge, which is free to turn:

        (J_d + J) phi'' + c phi' + k phi = T(t) + (what parcel and bending do),

    phi [rad] the hinge's angle, a state; J_d, c and k the drive's `inertia`, `damping` and
    `stiffness` at the hinge, J the inertia of the fence. The fence starts at rest at phi = 0. There
    is no stop: the torque and the spring return the fence.

    A fence on such a drive has no flexible shaft. A result's `history.drive` is the hinge's motion;
    its torque, `peak_torque` and `Ledger.drive_work` are those of T(t); the ledger's fence and
    strain energies include those of the drive's inertia and spring, and its damping loss includes
    the drive's.

    A law is a subclass with `torque`, `largest`, `cycle` and `turning_time`; the latter ends the
    search for the time at which an angle is reached.

    >>> isinstance(fj.TorqueDrive([40.0, 40.0, -40.0]), fj.AbstractTorqueDrive)
    True
    """

    inertia: eqx.AbstractVar[Array]
    damping: eqx.AbstractVar[Array]
    stiffness: eqx.AbstractVar[Array]

    @abc.abstractmethod
    def torque(self, time: Array) -> Array:
        """T [N m] at `time` [s]."""

    @property
    @abc.abstractmethod
    def largest(self) -> Array:
        """A bound of |T| [N m]."""

    def angle(self, time: Array) -> Array:
        """Raises `TypeError`: the angle of a torque drive is a state."""
        raise TypeError(
            f"Argument `drive` must be a law of the angle here, but is a {type(self).__name__}, "
            "whose angle is a state. Read `result.history.drive.angle`, or write "
            "fj.HarmonicDrive()."
        )

    def motion(self, time: ArrayLike) -> DriveMotion:
        """The torque at `time` [s], in a frame that stands still at 0 rad."""
        time = 1.0 * jnp.asarray(time)
        still = jnp.zeros_like(time)
        return DriveMotion(still, still, still, self.torque(time))

    def _acceleration(self, inertia: ArrayLike) -> Callable[[Array, Array, Array], Array]:
        """phi'' [rad/s^2] by time, phi and phi' of a rigid fence that nothing meets."""
        whole = self.inertia + inertia
        return lambda time, angle, speed: (
            (self.torque(time) - self.damping * speed - self.stiffness * angle) / whole
        )

    def unloaded(self, time: ArrayLike, inertia: ArrayLike) -> DriveMotion:
        """The motion at `time` [s] of a rigid fence of an `inertia` J [kg m^2] that nothing meets:
        by the classical Runge-Kutta method in 64 steps, of the fourth order."""
        time, acceleration = 1.0 * jnp.asarray(time), self._acceleration(inertia)
        step = time / _STEPS

        def advance(state, index):
            return _runge_kutta(acceleration, state, index * step, step), None

        indices = jnp.arange(_STEPS, dtype=step.dtype)
        zero = jnp.zeros_like(step + self.inertia + inertia)
        (angle, speed), _ = jax.lax.scan(advance, (zero, zero), indices)
        return DriveMotion(angle, speed, acceleration(time, angle, speed), self.torque(time))

    def time_at(self, angle: ArrayLike, inertia: ArrayLike = 0.0) -> Array:
        """The first time [s] at which a rigid fence of an `inertia` J [kg m^2] that nothing meets
        is at an `angle` [rad]; `turning_time` where it is not until then.

        Two Newton steps, which carry the first and the second derivative, after a search in 256
        steps.
        """
        angle = 1.0 * jnp.asarray(angle)
        frozen, target, carried = jax.lax.stop_gradient(
            (self, angle + 0.0 * jnp.asarray(inertia), inertia)
        )
        acceleration = frozen._acceleration(carried)
        step = (frozen.turning_time + 0.0 * (target + frozen.inertia)) / _SEARCH

        def advance(carry, index):
            state, found = carry
            after = _runge_kutta(acceleration, state, index * step, step)
            (before, now), reached = (state[0], after[0]), found >= 0
            crosses = (now >= target) & ~reached
            rise = jnp.where(crosses, now - before, 1.0)
            crossed = step * (index + (target - before) / rise)
            return (after, jnp.where(crosses, crossed, found)), None

        zero = jnp.zeros_like(step)
        begin = (zero, zero), jnp.where(target <= 0, 0.0, zero - 1)
        (_, found), _ = jax.lax.scan(advance, begin, jnp.arange(_SEARCH, dtype=step.dtype))
        never = found < 0
        time = jnp.where(never, step * _SEARCH, found)
        speed = frozen.unloaded(time, carried).speed
        moving = (speed > 0) & ~never & (time > 0)
        rate = jnp.where(moving, 1 / jnp.where(moving, speed, 1.0), 0.0)
        for _ in range(2):
            time = time - rate * (self.unloaded(time, inertia).angle - angle)
        return time


def _runge_kutta(acceleration, state, time, step):
    """One step of the classical Runge-Kutta method for angle and speed."""
    angle, speed = state
    half = 0.5 * step
    a1 = acceleration(time, angle, speed)
    v2 = speed + half * a1
    a2 = acceleration(time + half, angle + half * speed, v2)
    v3 = speed + half * a2
    a3 = acceleration(time + half, angle + half * v2, v3)
    v4 = speed + step * a3
    a4 = acceleration(time + step, angle + step * v3, v4)
    angle = angle + step * (speed + 2 * v2 + 2 * v3 + v4) / 6
    return angle, speed + step * (a1 + 2 * a2 + 2 * a3 + a4) / 6


class TorqueDrive(AbstractTorqueDrive):
    """A torque that is given: straight lines between traced values at even times,

        T(j t_c / (K - 1)) = T_j,  j = 0 ... K - 1;

    one value alone is a constant torque. After the cycle it stays at the last value. With a
    constant torque T on a rigid fence that nothing meets, phi = T t^2 / (2 (J_d + J)).

    >>> drive = fj.TorqueDrive([60.0, 0.0, -60.0, 0.0, 60.0], inertia=5.0)
    >>> f"{drive.torque(0.17):.1f} N m", fj.scenes.whole_sort(drive=drive).duration
    ('30.0 N m', 1.36)
    """

    torques: Array
    cycle_time: Array
    turn: Array
    inertia: Array
    damping: Array
    stiffness: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "torques": Bounds("N m", size=100.0),
        "cycle_time": Bounds("s", above=0, size=1.0),
        "turn": Bounds(above=0, most=1),
        **AT_HINGE,
    }

    def __init__(
        self,
        torques: ArrayLike,
        cycle_time: ArrayLike = CYCLE_TIME,
        turn: ArrayLike = 0.5,
        inertia: ArrayLike = 1.0,
        damping: ArrayLike = 0.0,
        stiffness: ArrayLike = 0.0,
    ):
        """**Arguments:**

        - `torques`: T_j [N m] at the hinge, shape (K,).
        - `cycle_time`: t_c [s], above 0.
        - `turn`: the end of the way out as a share of the cycle [1]; used to find when an angle is
          reached, and nowhere else.
        - `inertia`: J_d [kg m^2] of motor and gear as the hinge feels it, above 0.
        - `damping`: c [N m s/rad], at least 0.
        - `stiffness`: k [N m/rad] of a spring towards 0 rad, at least 0.
        """
        limits = self.bounds["torques"]._asdict()
        self.torques = _check.vector("torques", torques, **limits)
        _check.fields(
            self, cycle_time=cycle_time, turn=turn, inertia=inertia, damping=damping,
            stiffness=stiffness,
        )  # fmt: skip

    def torque(self, time: Array) -> Array:
        spans = self.torques.shape[-1] - 1
        if spans == 0:
            return self.torques[0] + 0.0 * time
        index, share = span_at(time / self.cycle_time, spans)
        return (1 - share) * self.torques[index] + share * self.torques[index + 1]

    @property
    def largest(self) -> Array:
        return jnp.max(jnp.abs(self.torques))

    @property
    def cycle(self) -> Array:
        return self.cycle_time

    @property
    def turning_time(self) -> Array:
        return self.turn * self.cycle_time
