"""The end of a contact force at the ends of a surface."""

import jax.numpy as jnp
from jaxtyping import Array


def fade(distance: Array, length: float) -> Array:
    """1 while `distance` <= 0, 0 from `length` on, a cubic with level ends between them.

    The force of a corner that runs over the end of the fence ends by this, over `length` [m]
    beyond the end, so that value and gradient stay continuous.
    """
    s = jnp.clip(distance / length, 0.0, 1.0)
    return 1 - s * s * (3 - 2 * s)
