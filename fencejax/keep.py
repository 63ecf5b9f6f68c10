"""A barrier to the compiler's zeal: results put in memory once."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array


def keep(holds: Array, function: Callable[..., Any], *arguments: Any) -> Any:
    """`function(*arguments)`, worked out once and put in memory; not a number unless `holds`.

    On a CPU the compiler fuses cheap arithmetic into every place that reads it, over and over:
    long scalar formulas with many results grow out of hand, in time to compile and to run. A
    branch keeps it from that, as long as the compiler cannot know that it is always taken: `holds`
    must be true for every sound input, one for the whole batch, and not a constant.
    """
    shapes = jax.eval_shape(function, *arguments)
    return jax.lax.cond(
        holds,
        function,
        lambda *_: jax.tree.map(lambda leaf: jnp.full(leaf.shape, jnp.nan, leaf.dtype), shapes),
        *arguments,
    )
