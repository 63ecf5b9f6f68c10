"""The force between a corner of the parcel and what it presses on."""

import jax.numpy as jnp
from jaxtyping import Array

from .parcel import Parcel


def normal_force(parcel: Parcel, gap: Array, gap_rate: Array) -> Array:
    """Modified Kelvin model (2.2): N = max(0, b_p m_p^0.4 Ddot D^2 + k_p D^4) for D > 0, else 0.

    `gap` is D [m], positive where the corner has gone in; `gap_rate` is its rate [m/s]; returns
    N [N]. The law is continuously differentiable at D = 0, so that the onset needs no smoothing.
    """
    depth = jnp.maximum(gap, 0.0)
    viscous = parcel.damping * parcel.mass**0.4 * gap_rate
    return jnp.maximum(depth**2 * (viscous + parcel.stiffness * depth**2), 0.0)


def stored_energy(parcel: Parcel, gap: Array) -> Array:
    """Energy held by the elastic part, k_p D^5 / 5 [J]."""
    return parcel.stiffness * jnp.maximum(gap, 0.0) ** 5 / 5


def fade(distance: Array, length: float) -> Array:
    """1 while `distance` <= 0, 0 from `length` on, a cubic with level ends between them.

    The force of a corner that runs over the end of the fence ends by this, over `length` [m]
    beyond the end, so that value and gradient stay continuous.
    """
    s = jnp.clip(distance / length, 0.0, 1.0)
    return 1 - s * s * (3 - 2 * s)
