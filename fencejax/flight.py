"""Free flight: when nothing touches and nothing can, so that a longer step does."""

import jax.numpy as jnp
from jaxtyping import Array

from .clock import Stride
from .instant import Instant

# What gap rates may change by in free flight, in m/s^2: the drive's swing, the belt's friction and
# the ringing of the fence, with room to spare.
_CHANGE = 50.0


def clear(instant: Instant, length: float) -> Array:
    """Whether no corner touches, nor can within `length` [s]: D + 3 |Ddot| h + a h^2 / 2 < 0."""
    free = instant.time >= 0
    for contact in (*instant.fence, *instant.border):
        reached = contact.gap + 3 * jnp.abs(contact.gap_rate) * length + 0.5 * _CHANGE * length**2
        free = free & (reached < 0) & (contact.normal <= 0)
    return free


def struck(instant: Instant, stride: Stride, step: float) -> Array:
    """Contact force [N] found at the end of a longer step that was to be free of any, else 0."""
    forces = sum((c.normal for c in (*instant.fence, *instant.border)), 0.0 * instant.time)
    return jnp.where(stride.length > 1.5 * step, forces, 0.0)
