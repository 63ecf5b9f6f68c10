"""A loop's carry as JAX's transformations of the loop want it: complete from the start."""

from collections.abc import Callable
from typing import Any

import jax
import jax.custom_batching
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jax.extend.core import Jaxpr, Literal

# Operations on numbers whose derivative is zero everywhere.
_CONSTANT = {"stop_gradient", "floor", "ceil", "round", "sign"}


def complete(carry: Any, body: Callable[[Any, Any], Any], given: Any) -> Any:
    """The `carry` itself, for the start of a loop of `body(carry, given)`.

    JAX differentiates the body of a loop again and again, until it has found which numbers of the
    carry depend on what is being differentiated, and it vectorises the body as often again. Here
    that is found beforehand, from the operations of the body alone: these numbers have a tangent
    from the start, and in a batch all numbers are one a lane, so that one pass is enough each time.
    All leaves are floating-point arrays.
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
        moves = _repeated(traced, marks, others)
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


@jax.custom_batching.custom_vmap
def _one_a_lane(leaves, given):
    return leaves


@_one_a_lane.def_vmap
def _(size, in_batched, leaves, given):
    batched = in_batched[0]
    lanes = [
        leaf if b else jnp.broadcast_to(leaf, (size, *leaf.shape))
        for leaf, b in zip(leaves, batched, strict=True)
    ]
    return lanes, [True] * len(lanes)


def _repeated(body: Jaxpr, carry: list[bool], others: list[bool]) -> list[bool]:
    """Which numbers of a carry depend on the marked ones after any number of trips."""
    while True:
        reached = _reached(body, [*carry, *others])
        after = [a or b for a, b in zip(carry, reached, strict=True)]
        if after == carry:
            return carry
        carry = after


def _reached(program: Jaxpr, marks: list[bool]) -> list[bool]:
    """Which results of a program depend, smoothly, on its marked inputs."""
    moving = {v for v, mark in zip(program.invars, marks, strict=True) if mark}

    def moves(v) -> bool:
        return not isinstance(v, Literal) and v in moving

    for equation in program.eqns:
        ins = [moves(v) for v in equation.invars]
        if any(ins) and equation.primitive.name not in _CONSTANT:
            outs = _results(equation, ins)
            moving.update(
                v
                for v, out in zip(equation.outvars, outs, strict=True)
                if out and _is_number(v.aval)
            )
    return [moves(v) for v in program.outvars]


def _is_number(aval) -> bool:
    return hasattr(aval, "dtype") and jnp.issubdtype(aval.dtype, jnp.floating)


def _results(equation, ins: list[bool]) -> list[bool]:
    """Which results of an operation depend on its marked operands; all, where it is a loop or a
    rule of its own."""
    inner = equation.params.get("jaxpr")
    if equation.primitive.name in ("jit", "pjit") and inner is not None:
        return _reached(inner.jaxpr, ins)
    return [True] * len(equation.outvars)
