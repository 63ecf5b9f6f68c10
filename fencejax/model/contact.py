"""The force between a corner of the parcel and what it presses on."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from ..parts import Parcel


def viscosity(parcel: Parcel) -> Array:
    """b_p m_p^0.4 [N s / m^3], the coefficient of Ddot D^2 in `kelvin`."""
    return parcel.damping * parcel.mass**0.4


class Kelvin(NamedTuple):
    """Normal force [N] and its derivatives in the gap [N/m] and in the gap's rate [N s/m]."""

    force: Array
    by_gap: Array
    by_rate: Array


def kelvin(stiffness: Array, viscosity: Array, gap: Array, gap_rate: Array) -> Kelvin:
    """Modified Kelvin model: N = max(0, b_p m_p^0.4 Ddot D^2 + k_p D^4) for D > 0, else 0.

    `stiffness` is k_p [N/m^4], `viscosity` b_p m_p^0.4 [N s/m^3], `gap` D [m], positive where the
    corner has gone in, `gap_rate` its rate [m/s]. The law is continuously differentiable at D = 0,
    so that the onset needs no smoothing.

    Paper: (2.2).
    """
    depth = jnp.maximum(gap, 0.0)
    square = depth * depth
    viscous, elastic = viscosity * gap_rate, stiffness * square
    force = square * (viscous + elastic)
    pushing = force > 0
    return Kelvin(
        force=jnp.maximum(force, 0.0),
        by_gap=jnp.where(pushing, depth * (2 * viscous + 4 * elastic), 0.0),
        by_rate=jnp.where(pushing, square * viscosity, 0.0),
    )


def stored_energy(stiffness: Array, gap: Array) -> Array:
    """Energy held by the elastic part, k_p D^5 / 5 [J]."""
    return stiffness * jnp.maximum(gap, 0.0) ** 5 / 5


def fade(distance: Array, length: float) -> Array:
    """1 while `distance` <= 0, 0 from `length` on, a cubic with level ends between them.

    The force of a corner that runs over the end of the fence ends by this, over `length` [m]
    beyond the end, so that value and gradient stay continuous.
    """
    s = jnp.clip(distance / length, 0.0, 1.0)
    return 1 - s * s * (3 - 2 * s)
