"""The number of times that JAX transforms a program: `PASSES` has an entry for each time."""

import jax

PASSES: list[int] = []


@jax.custom_batching.custom_vmap
def counted(x):
    """The number itself, which notes how often it is vectorised."""
    return x


@counted.def_vmap
def _(size, in_batched, x):
    PASSES.append(1)
    return x, in_batched[0]
