"""Dry friction: of a corner along the fence or the border, and of the parcel on the belt."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .._elementary import gaussian_mean
from ..fidelity import Smoothing
from ..parts import AbstractFriction


def corner_share(
    friction: AbstractFriction, sliding: Array, smoothing: Smoothing
) -> tuple[Array, Array]:
    """Friction on a corner along the tangent as a share of its normal force:
    -mu(w) w / sqrt(w^2 + eps^2) [1], with w the sliding speed [m/s]; and its derivative in w.

    Paper: (2.19)_4. There with the sign of w, unsmoothed.
    """
    square = sliding * sliding
    mu, slope = friction.coefficient(square, smoothing.static_speed)
    inverse = jax.lax.rsqrt(square + smoothing.slip_speed**2)
    relative_slope = 2 * slope * square + mu * (smoothing.slip_speed * inverse) ** 2
    return -mu * sliding * inverse, -relative_slope * inverse


class Coefficient(NamedTuple):
    """A coefficient of friction [1] in two parts, with their slopes with the sliding speed [s/m]:
    what is `smooth` in the speed, and how much static friction adds `near_rest`."""

    smooth: Array
    smooth_slope: Array
    near_rest: Array
    near_rest_slope: Array


def mean_coefficient(
    friction: AbstractFriction, sliding: Array, smoothing: Smoothing
) -> Coefficient:
    """The coefficient of friction at the sliding speed w, and what static friction adds to it near
    rest in the mean over a speed that goes straight from rest to w,

        (mu_0 - mu_k) sqrt(pi) / 2 erf(z) / z,   z = |w| / w_s,

    where the law jumps from mu_0 to mu_k and the jump is smoothed over w_s. A law that does not
    jump has no such part.
    """
    square = sliding * sliding
    mu, slope = friction.coefficient(square, smoothing.static_speed)
    at_rest, _ = friction.coefficient(jnp.zeros_like(square), smoothing.static_speed)
    scales = friction.scales(sliding)
    excess = jnp.where(scales.jump > 0, at_rest - scales.sliding, 0.0)
    z = jnp.abs(sliding) / smoothing.static_speed
    falling = excess * jnp.exp(-z * z)
    mean, of_mean = gaussian_mean(z)
    scale = 1 / smoothing.static_speed**2
    return Coefficient(
        mu - falling,
        2 * (slope + scale * falling) * sliding,
        excess * mean,
        scale * excess * of_mean * sliding,
    )


def belt_grip(
    friction: AbstractFriction, weight: Array, speed_squared: Array, smoothing: Smoothing
) -> tuple[Array, Array]:
    """Goyal's limit surface as a viscosity [N s/m]: grip = F_max / S, with F_max = mu_1 m_p g and
    S = sqrt(s^2 + eps^2), s^2 = |u|^2 + c^2 phidot^2; and its derivative in s^2.

    The belt then acts on the parcel with F_1 = grip u and T = -grip c^2 phidot, where u is the
    belt's velocity less the parcel's [m/s], phidot the parcel's spin [rad/s] and c the mean
    distance of its points from the centre of gravity [m]. `weight` is m_p g [N] and
    `speed_squared` s^2, which is also what mu_1 is taken at. The belt dissipates grip s^2 [W].

    Paper: (2.19)_1-3, (2.20).
    """
    mu, slope = friction.coefficient(speed_squared, smoothing.static_speed)
    inverse = jax.lax.rsqrt(speed_squared + smoothing.slip_speed**2)
    grip = weight * inverse
    return grip * mu, grip * (slope - 0.5 * mu * inverse * inverse)


def belt_slope(grip: Array, grip_slope: Array, speed_squared: Array) -> Array:
    """Slope of the belt's friction grip s with the slip s [N s/m], below 0 where it falls: grip + 2
    s^2 d grip / d s^2, with `grip` and `grip_slope` of `belt_grip`."""
    return grip + 2 * grip_slope * speed_squared
