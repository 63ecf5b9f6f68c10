"""A blow in the parcel's own terms: as a load in g, and as the drop that hits as hard."""

import functools

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from ..parts import Parcel

_GRAVITY = 9.81
_MOST, _POINTS = 60.0, 600


def g_load(force: ArrayLike, mass: ArrayLike, gravity: float = _GRAVITY) -> Array:
    """F / (m g) [1] of a force [N] on a mass [kg]."""
    return jnp.asarray(force) / (jnp.asarray(mass) * gravity)


@functools.cache
def _peak_table() -> tuple[np.ndarray, np.ndarray]:
    """f(beta) at beta = sinh of equally spaced numbers.

    With D = d delta, t = tau s, d = (m v^2 / k_p)^(1/5) and tau = d / v, a parcel that meets a
    rigid wall at v follows delta'' = -max(0, beta delta' delta^2 + delta^4), delta(0) = 0,
    delta'(0) = 1, with beta = b_p v^0.2 / k_p^0.6, and the peak force is k_p d^4 f(beta). By the
    classical Runge-Kutta method, all beta at once.
    """
    beta = np.sinh(np.linspace(0.0, np.arcsinh(_MOST), _POINTS))
    step, place, rate = 1e-3, np.zeros(_POINTS), np.ones(_POINTS)
    peak, before, now = np.zeros(_POINTS), np.zeros(_POINTS), np.zeros(_POINTS)

    def force(d, v):
        return np.maximum(0.0, beta * v * d**2 + d**4) * (d > 0)

    for _ in range(2500):
        slopes = []
        for share, scale in ((0.0, 0.0), (0.5, 0.5), (0.5, 0.5), (1.0, 1.0)):
            d = place + share * step * (slopes[-1][0] if slopes else 0.0)
            v = rate + scale * step * (slopes[-1][1] if slopes else 0.0)
            slopes.append((v, -force(d, v)))
        place = place + step / 6 * sum(w * s[0] for w, s in zip((1, 2, 2, 1), slopes, strict=True))
        rate = rate + step / 6 * sum(w * s[1] for w, s in zip((1, 2, 2, 1), slopes, strict=True))
        new = force(place, rate)
        bend = before - 2 * now + new
        inner = (now >= before) & (now > new) & (bend < 0)
        safe = np.where(inner, bend, -1.0)
        peak = np.maximum(peak, np.where(inner, now - (new - before) ** 2 / (8 * safe), new))
        before, now = now, new
    return beta, peak


def wall_force(speed: ArrayLike, parcel: Parcel) -> Array:
    """N_stiff [N], the peak force of a parcel that meets a rigid wall with a corner at `speed`
    [m/s]: k_p^0.2 (m v^2)^0.8 f(b_p v^0.2 / k_p^0.6), f tabulated; (5/2)^0.8 without damping."""
    speed = jnp.asarray(speed)
    return jnp.exp(_log_force(jnp.log(speed), parcel)[0])


def _log_force(log_speed, parcel: Parcel):
    """ln of the wall force, and its derivative in ln v."""
    nodes, peaks = _peak_table()
    beta = parcel.damping * jnp.exp(0.2 * log_speed) / parcel.stiffness**0.6
    grid, logs = np.arcsinh(nodes), np.log(peaks)
    slopes = np.gradient(logs, grid)
    place = jnp.arcsinh(jnp.minimum(beta, _MOST))
    factor = jnp.interp(place, jnp.asarray(grid), jnp.asarray(logs))
    bend = jnp.interp(place, jnp.asarray(grid), jnp.asarray(slopes))
    slope = 1.6 + 0.2 * bend * beta / jnp.sqrt(1 + beta**2)
    base = 0.2 * jnp.log(parcel.stiffness) + 0.8 * (jnp.log(parcel.mass) + 2 * log_speed)
    return base + factor, slope


def drop_height(force: ArrayLike, parcel: Parcel, gravity: float = _GRAVITY) -> Array:
    """The height [m] from which the parcel, dropped with a corner onto a rigid floor, sees the
    same peak force [N]: v^2 / (2 g) with `wall_force`(v) = F, by Newton's method in ln v.

    The parcel's contact law holds for the floor as it does for the fence. beta up to 60; the
    default parcel has 0.9 at 1 m/s. A force of 0 is a height of 0.
    """
    force = jnp.asarray(force)
    none = force <= 0
    wanted = jnp.log(jnp.where(none, 1.0, force))
    # Exact without damping; the slope hardly changes, so that few steps do.
    log_speed = (wanted - 0.2 * jnp.log(parcel.stiffness) - 0.8 * jnp.log(parcel.mass)) / 1.6
    for _ in range(8):
        value, slope = _log_force(log_speed, parcel)
        log_speed = log_speed - (value - wanted) / slope
    return jnp.where(none, 0.0, jnp.exp(2 * log_speed) / (2 * gravity))
