"""A loop's carry in the form that JAX's transformations of the loop need from the start."""

from collections.abc import Callable
from typing import Any

import jax
import jax.custom_batching
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero

from .dependence import repeated


def complete(carry: Any, body: Callable[[Any, Any], Any], given: Any) -> Any:
    """The `carry` itself, for the start of a loop of `body(carry, given)`.

    JAX differentiates the body of a loop again and again, until it has found which numbers of the
    carry depend on what is being differentiated, and it vectorises the body as often again. Here
    that is found beforehand, from the operations of the body alone: these numbers have a tangent
    from the start, and in a batch all numbers are one a lane, so that one pass is enough each time.
    All leaves are floating-point arrays.

    Only reverse mode needs this, as it linearises its checkpointed loops by JAX's own rules: it
    saves a third of the time to trace a gradient. Forward mode by columns reads the dependence off
    the traced loop: there `one_a_lane` is enough.
    """
    leaves, structure = jax.tree.flatten(carry)

    def flat(leaves, given):
        return jax.tree.leaves(body(jax.tree.unflatten(structure, leaves), given))

    @jax.custom_jvp
    def same(leaves, given):
        return _one_a_lane(leaves, given)

    def rule(primals, tangents):
        leaves, given = primals
        dots, given_dots = tangents
        marks = [not isinstance(dot, SymbolicZero) for dot in dots]
        others = [not isinstance(dot, SymbolicZero) for dot in jax.tree.leaves(given_dots)]
        traced = jax.make_jaxpr(flat)(*jax.eval_shape(lambda *each: each, leaves, given)).jaxpr
        moves = repeated(traced, marks, others)
        every = [*dots, *jax.tree.leaves(given_dots)]
        first = next(dot for dot in every if not isinstance(dot, SymbolicZero))
        zero = 0 * jnp.ravel(first)[0]
        tangents = [
            jnp.broadcast_to(zero.astype(leaf.dtype), leaf.shape)
            if move and isinstance(dot, SymbolicZero)
            else dot
            for leaf, dot, move in zip(leaves, dots, moves, strict=True)
        ]
        return same(leaves, given), tangents

    same.defjvp(rule, symbolic_zeros=True)
    return jax.tree.unflatten(structure, same(leaves, given))


def one_a_lane(carry: Any, given: Any) -> Any:
    """The `carry` itself, for the start of a loop whose derivative is made by
    `columns.pushed`: in a batch, all its numbers are one a lane."""
    return _one_a_lane(carry, given)


@jax.custom_batching.custom_vmap
def _one_a_lane(carry, given):
    return carry


@_one_a_lane.def_vmap
def _(size, in_batched, carry, given):
    lanes = jax.tree.map(
        lambda leaf, b: leaf if b else jnp.broadcast_to(leaf, (size, *leaf.shape)),
        carry,
        in_batched[0],
    )
    return lanes, jax.tree.map(lambda _: True, lanes)
