"""Dry friction: of a corner sliding along the fence or the border, and of the parcel on the belt."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from . import _check
from .parcel import Parcel


class Friction(eqx.Module):
    """Coefficients of a pair of surfaces, kinetic and static."""

    kinetic: Array
    static: Array

    def __init__(self, kinetic: ArrayLike, static: ArrayLike):
        """**Arguments:** `kinetic`: mu_k [1], at least 0. `static`: mu_s [1], at least 0."""
        self.kinetic = _check.scalar("kinetic", kinetic, least=0)
        self.static = _check.scalar("static", static, least=0)


class Smoothing(NamedTuple):
    """How the jump of dry friction at rest is smoothed: `slip_speed` eps [m/s], below which the
    force falls off, and `static_speed` w_s [m/s], over which the coefficient goes from static to
    kinetic. True stick is what eps -> 0, with eps << w_s, tends to."""

    slip_speed: float
    static_speed: float


def coefficient(friction: Friction, speed_squared: Array, smoothing: Smoothing) -> Array:
    """mu(w) = mu_k + (mu_s - mu_k) exp(-(w / w_s)^2) [1] at w^2 = `speed_squared`."""
    static_share = jnp.exp(-speed_squared / smoothing.static_speed**2)
    return friction.kinetic + (friction.static - friction.kinetic) * static_share


def corner_friction(
    friction: Friction, normal: Array, sliding: Array, smoothing: Smoothing
) -> Array:
    """Friction force [N] on a corner along the tangent, (2.19)_4 smoothed:
    -N mu(w) w / sqrt(w^2 + eps^2), with w the sliding speed [m/s] and N the `normal` force [N]."""
    square = sliding**2
    share = sliding / jnp.sqrt(square + smoothing.slip_speed**2)
    return -normal * coefficient(friction, square, smoothing) * share


class BeltForce(NamedTuple):
    """Force [N] and moment [N m] of the belt on the parcel, and what they dissipate [W]."""

    x: Array
    y: Array
    moment: Array
    dissipated: Array


def belt_friction(
    friction: Friction,
    parcel: Parcel,
    weight: Array,
    slip_x: Array,
    slip_y: Array,
    spin: Array,
    smoothing: Smoothing,
) -> BeltForce:
    """Goyal's limit surface (2.19)_1-3: F_1 = F_max u / S, T = -F_max c^2 phidot / S with
    S = sqrt(|u|^2 + c^2 phidot^2 + eps^2), F_max = mu_1 m_p g (2.20).

    u = (`slip_x`, `slip_y`) [m/s] is the belt's velocity less the parcel's and `spin` = phidot
    [rad/s]; c is the mean distance of the parcel's points from its centre of gravity and `weight`
    is m_p g [N]. The coefficient is taken at the speed sqrt(|u|^2 + c^2 phidot^2).
    """
    arm = parcel.mean_distance
    square = slip_x**2 + slip_y**2 + (arm * spin) ** 2
    grip = weight * coefficient(friction, square, smoothing)
    grip = grip / jnp.sqrt(square + smoothing.slip_speed**2)
    return BeltForce(
        x=grip * slip_x,
        y=grip * slip_y,
        moment=-grip * arm**2 * spin,
        dissipated=grip * square,
    )
