"""Speed, acceleration and jerk of a free-form motion, exactly, span by span."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from ..parts import SplineDrive


class Extremes(NamedTuple):
    """For a spline with K control angles and K + 3 spans of equal length dt: the largest |speed| in
    each span [rad/s], the acceleration at each of the K + 4 knots [rad/s^2], linear between them,
    and the constant jerk in each span [rad/s^3]."""

    speed: Array
    acceleration: Array
    jerk: Array


def extremes(drive: SplineDrive) -> Extremes:
    """With c the control angles, padded by three zeros on both sides: at knot i the speed is
    (c_{i+2} - c_i) / (2 dt) and the acceleration (c_i - 2 c_{i+1} + c_{i+2}) / dt^2; in span i the
    jerk is (c_{i+3} - 3 c_{i+2} + 3 c_{i+1} - c_i) / dt^3. Where the acceleration changes its sign
    within a span, from a to b, the speed has an extremum there, a^2 dt / (2 (a - b)) from the
    span's first. Differentiable."""
    c = jnp.pad(drive.control_angles, (3, 3))
    dt = drive.cycle_time / (drive.control_angles.shape[0] + 3)
    speed = (c[2:] - c[:-2]) / (2 * dt)
    acceleration = (c[:-2] - 2 * c[1:-1] + c[2:]) / dt**2
    first, last = acceleration[:-1], acceleration[1:]
    turns = first * last < 0
    rise = jnp.where(turns, first**2 / (2 * jnp.where(turns, first - last, 1.0)), 0.0) * dt
    inner = speed[:-1] + rise
    largest = jnp.maximum(jnp.maximum(jnp.abs(speed[:-1]), jnp.abs(speed[1:])), jnp.abs(inner))
    return Extremes(largest, acceleration, (last - first) / dt)
