"""A barrier to the compiler's zeal: results put in memory once."""

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from equinox.internal import unvmap_any
from jax.extend.core import jaxpr_as_fun
from jaxtyping import Array

from .compiler import shares_arithmetic


def keep(holds: Array, function: Callable[..., Any], *arguments: Any) -> Any:
    """`function(*arguments)`, worked out once and put in memory; not a number unless `holds`.

    Left to itself (see `fencejax.tune_compiler`), on a CPU the compiler fuses cheap arithmetic into
    every place that reads it, over and over: long scalar formulas with many results grow out of
    hand, in time to compile and to run. A branch keeps it from that, as long as the compiler cannot
    know that it is always taken: `holds` must be true for every sound input, one for the whole
    batch, and not a constant. Where the compiler shares arithmetic, this is just
    `function(*arguments)`.
    """
    if shares_arithmetic():
        return function(*arguments)
    # Traced once, and from there on taken as it is.
    traced, shapes = jax.make_jaxpr(function, return_shape=True)(*arguments)
    results = jax.tree.structure(shapes)

    def worked_out(leaves):
        return jaxpr_as_fun(traced)(*leaves)

    def not_numbers(_):
        return [jnp.full(leaf.shape, jnp.nan, leaf.dtype) for leaf in jax.tree.leaves(shapes)]

    leaves = jax.tree.leaves(arguments)
    return jax.tree.unflatten(results, jax.lax.cond(holds, worked_out, not_numbers, leaves))


def sound(tree: Any) -> Array:
    """Whether a pytree holds numbers only, in one lane of a batch at least. It is unknown to the
    compiler as soon as one leaf of the tree is."""
    sums = [jnp.sum(leaf) for leaf in jax.tree.leaves(tree)]
    return unvmap_any(jnp.isfinite(functools.reduce(jnp.add, sums)))
