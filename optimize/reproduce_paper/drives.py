"""Drive laws with the paper's cycle time and top speed, in one program."""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

import fencejax as fj
from fencejax.parts import AbstractDrive

LAWS = ("harmonic", "trapezoid", "S-curve")
TOP_SPEED = 1.53
CYCLE_TIME = 1.36
_SHARPER = 1.3


class FittedDrive(AbstractDrive):
    """alpha_w(t) = sum_k share_k alpha_k(t) over the harmonic law, the trapezoid and the S-curve.

    All three have the same top speed, cycle time and stroke and reverse in the middle of the cycle.
    A share of 1 selects a law. As the shares are numbers, one compiled program serves every law.
    """

    laws: tuple[AbstractDrive, ...]
    shares: Array

    def __init__(self, law: str = "harmonic"):
        """**Arguments:** `law`: one of `LAWS`.

        Raises `ValueError` for any other name.
        """
        if law not in LAWS:
            raise ValueError(f"Argument `law` must be one of {LAWS}, but is {law!r}.")
        stroke = TOP_SPEED * CYCLE_TIME / jnp.pi
        # Half the cycle is stroke / v + v / a, and a jerk's time a / j more for the S-curve.
        ramps = CYCLE_TIME / 2 - stroke / TOP_SPEED
        gentle = TOP_SPEED / ramps
        sharp = _SHARPER * gentle
        jerk = sharp / (ramps - TOP_SPEED / sharp)
        self.laws = (
            fj.HarmonicDrive(TOP_SPEED, CYCLE_TIME),
            fj.TrapezoidDrive(stroke, TOP_SPEED, gentle),
            fj.SCurveDrive(stroke, TOP_SPEED, sharp, jerk),
        )
        self.shares = jnp.asarray([float(name == law) for name in LAWS])

    def angle(self, time: ArrayLike) -> Array:
        time = jnp.asarray(time, dtype=float)
        total = jnp.zeros_like(time)
        for index, law in enumerate(self.laws):
            total = total + self.shares[index] * law.angle(time)
        return total

    @property
    def cycle(self) -> Array:
        return self.laws[0].cycle

    @property
    def turning_time(self) -> Array:
        return self.laws[0].turning_time
