"""Quantities of many scenes as part of a differentiated program."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..design import Quantity, fields, measures
from ..fidelity import Fidelity
from ..lanes import each_lane
from ..scenes import AnyScene
from ..simulate import simulate


def measured(
    scene: Callable[[Any], AnyScene],
    lanes: Any,
    quantities: Sequence[Quantity],
    fidelity: Fidelity,
    chunk: int = 64,
) -> dict[str, Array]:
    """The quantities by name and `status`, one number a lane. Differentiable, and part of the
    program that calls it: for a problem of `fencejax.LaneProgram`.

    **Arguments:**

    - `scene`: the scene of one lane.
    - `lanes`: a pytree whose leaves have the lanes first.
    - `quantities`: those to compute; `fidelity`: of the simulation.
    - `chunk`: the most lanes in one vectorised call.
    """
    only, own = fields(quantities), measures(quantities)

    def one(lane) -> dict[str, Array]:
        made = scene(lane)
        result = simulate(made, fidelity=fidelity, history=False, only=only, measures=own)
        return {**{q.name: q(result, made) for q in quantities}, "status": result.status}

    numbers = jax.tree.map(jnp.asarray, lanes)
    total = jax.tree.leaves(numbers)[0].shape[0]
    if total <= chunk:
        return each_lane(one, numbers)
    # Chunks of one size, filled up with the first lane: one program for all of them.
    count = -(-total // chunk)
    size = -(-total // count)
    spare = count * size - total

    def chunked(part):
        filled = jnp.concatenate([part, jnp.broadcast_to(part[:1], (spare, *part.shape[1:]))])
        return filled.reshape(count, size, *part.shape[1:])

    found = jax.lax.map(jax.vmap(one), jax.tree.map(chunked, numbers))
    return jax.tree.map(lambda part: part.reshape(-1)[:total], found)
