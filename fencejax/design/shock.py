"""A blow in the parcel's own terms: as a load in g, and as the drop that hits as hard."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ..parts import Parcel

_GRAVITY = 9.81


def g_load(force: ArrayLike, mass: ArrayLike, gravity: float = _GRAVITY) -> Array:
    """F / (m g) [1] of a force [N] on a mass [kg]."""
    return jnp.asarray(force) / (jnp.asarray(mass) * gravity)


def wall_force(speed: ArrayLike, parcel: Parcel) -> Array:
    """N_stiff [N], the peak force of a parcel that meets a rigid wall with a corner at `speed`
    [m/s], above 0: `wall_force` of its contact law."""
    return parcel.contact_law.wall_force(speed, parcel.mass)


def drop_height(force: ArrayLike, parcel: Parcel, gravity: float = _GRAVITY) -> Array:
    """The height [m] from which the parcel, dropped with a corner onto a rigid floor, sees the
    same peak force [N]: v^2 / (2 g) with `wall_force`(v) = F, by Newton's method in ln v.

    The parcel's contact law holds for the floor as it does for the fence. A force of 0 is a height
    of 0.
    """
    force = jnp.asarray(force)
    none = force <= 0
    wanted = jnp.log(jnp.where(none, 1.0, force))

    def closer(wanted, parcel, log_speed):
        # Of every power law ln F is all but straight in ln v, so that few steps do.
        value, slope = jax.jvp(
            lambda at: jnp.log(wall_force(jnp.exp(at), parcel)),
            (log_speed,),
            (jnp.ones_like(log_speed),),
        )
        return log_speed - (value - wanted) / slope

    fixed = jax.lax.stop_gradient((wanted, parcel))
    begin = jnp.zeros_like(fixed[0] + parcel.mass)
    log_speed = jax.lax.fori_loop(0, 10, lambda _, at: closer(*fixed, at), begin)
    # One more step carries the derivative.
    log_speed = closer(wanted, parcel, jax.lax.stop_gradient(log_speed))
    return jnp.where(none, 0.0, jnp.exp(2 * log_speed) / (2 * gravity))
