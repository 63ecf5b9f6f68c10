"""The lanes of a result with valid numbers, and sums over these alone."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .result import Result
from .status import Status


def holds(result: Result) -> Array:
    """Whether a result's numbers are good, one a lane: whether its status is at most
    `LEFT_OVER_TIP`.

    >>> bool(fj.holds(fj.simulate(fj.scenes.rigid_wall())))
    True
    """
    return jnp.asarray(result.status) <= Status.LEFT_OVER_TIP


def good(result: Result, value: Any, otherwise: float = 0.0) -> Any:
    """`value` where the numbers of `result` are good, `otherwise` in the other lanes, whose
    gradient is then 0.

        def force(thickness):
            result = fj.simulate(scene(thickness), only=("peak_force",))
            return fj.good(result, result.peak_force), fj.holds(result)

        forces, valid = jax.vmap(force)(thicknesses)
        mean = jnp.sum(forces) / jnp.sum(valid)

    This is `jnp.where(status <= Status.LEFT_OVER_TIP, value, otherwise)`. With
    `Fidelity(gradient="forward")` it is enough, in forward and in reverse mode: a lane that ends
    `NON_FINITE` has derivatives of 0, so that it does not contribute to a sum. A value computed
    from a result by functions of your own may have non-finite derivatives; mask before them. Count
    the valid lanes, as above, as they may be fewer than all.

    **Arguments:**

    - `result`: of `fencejax.simulate`, of any batch shape.
    - `value`: a number or pytree computed from it, each leaf with the batch's axes first.

    >>> result = fj.simulate(fj.scenes.rigid_wall())
    >>> print(f"{fj.good(result, result.peak_force):.0f} N")
    3294 N
    """
    fine = holds(result)

    def masked(leaf):
        leaf = jnp.asarray(leaf)
        apart = jnp.reshape(fine, fine.shape + (1,) * (leaf.ndim - fine.ndim))
        return jnp.where(
            jnp.broadcast_to(apart, leaf.shape), leaf, jnp.full_like(leaf, otherwise)
        )

    return jax.tree.map(masked, value)
