"""How long the next step may be: long in free flight and where forces change smoothly, one step
where something is about to touch, to part or to turn round."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from .instant import Instant

# What the rate of a gap may change by in free flight [m/s^2]: the drive's swing, friction and the
# ringing of the fence, with room to spare.
_CHANGE = 50.0


class Pace(NamedTuple):
    """What the length of the next step is chosen by.

    `steps` is how many steps [1] the last one stood for; `surprise` [1] how far the forces at its
    end were from their straight continuation, relative to their size. It grows with the square of
    the length.
    """

    steps: Array
    surprise: Array


def next_count(
    pace: Pace,
    instant: Instant,
    normals_before: tuple[Array, ...],
    counts: tuple[int, ...],
    step: float,
    tolerance: float,
    ends: tuple[tuple[float, Array], ...],
) -> Array:
    """The largest of `counts` steps [1] that may be taken in one, each of `step` [s].

    - The forces are expected to leave their straight continuation by no more than `tolerance`, and
      the step is at most twice the last one.
    - A corner that is free stays free: D + 3 |Ddot| h + a h^2 / 2 < 0, or it stays off the fence,
      between whose `ends`, arc coordinates [m] for each corner, it can be met.
    - A corner at the fence that is being let go is not gone by the end of the step.
    """
    best = jnp.ones_like(pace.steps)
    corners = (*instant.fence, *instant.border)
    changes = [
        (now.normal - before) / jnp.maximum(pace.steps, 1.0)
        for now, before in zip(instant.fence, normals_before, strict=True)
    ]
    changes += [0.0 * corner.normal for corner in instant.border]
    for count in counts:
        length, ratio = count * step, count / jnp.maximum(pace.steps, 1.0)
        fine = (pace.surprise * ratio**2 <= tolerance) & (ratio <= 2)
        for k, change in enumerate(changes):
            corner = corners[k]
            reach = corner.gap + 3 * jnp.abs(corner.gap_rate) * length + 0.5 * _CHANGE * length**2
            free = reach < 0
            if k < len(instant.fence):
                slide = 3 * jnp.abs(corner.sliding) * length
                near, far = ends[k]
                free = free | (corner.place - slide > far) | (corner.place + slide < near)
            stays = corner.normal + 2 * count * change > 0
            fine = fine & jnp.where(corner.normal > 0, stays, free)
        best = jnp.where(fine, float(count), best)
    return best
