"""Newton's method for a few scalar unknowns, differentiated through the converged equation."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from equinox.internal import unvmap_any
from jax.custom_derivatives import SymbolicZero
from jax.interpreters.partial_eval import dce_jaxpr
from jaxtyping import Array

from .._xla import fusion_barrier
from ..derivatives import custom_columns, pushed

Unknowns = tuple[Array, ...]
Matrix = list[list[Array]]

# Ratio of the residual to the tolerated one [1] below which the iteration ends at once. Above it
# one more step is taken, which squares the residual.
_BALANCED = 0.1


def eliminate(matrix: list[list[Array]], right: Unknowns) -> Unknowns:
    """Solve a small dense system by elimination without pivots, written out in scalars.

    The systems here are the identity plus a step times the derivative of forces that oppose the
    motion, so that pivots stay away from zero for any step that resolves them.
    """
    size = len(right)
    rows = [list(row) for row in matrix]
    values, inverse = list(right), []
    for k in range(size):
        # One division for a pivot, in place of one for each number that is divided by it.
        inverse.append(1 / rows[k][k])
        for i in range(k + 1, size):
            factor = rows[i][k] * inverse[k]
            for j in range(k + 1, size):
                rows[i][j] = rows[i][j] - factor * rows[k][j]
            values[i] = values[i] - factor * values[k]
    for k in reversed(range(size)):
        for j in range(k + 1, size):
            values[k] = values[k] - rows[k][j] * values[j]
        values[k] = values[k] * inverse[k]
    return tuple(values)


def solve(
    evaluate: Callable[[Any, Unknowns], tuple[Unknowns, Matrix, Array, Any]],
    shorten: Callable[[Any, Any, Unknowns, Unknowns], Array],
    given: Any,
    guess: Unknowns,
    most: Array,
    wanted: Callable[[Any], Any] = lambda extra: extra,
) -> tuple[Unknowns, Any]:
    """A root near `guess`, by at most `most` steps of Newton's method, and further results there.

    - `evaluate(given, x)` returns the residual at x; a matrix close to its derivative in x; the
      ratio of the residual's size to the tolerated one (at most 1: good enough); and further
      results.
    - `shorten(given, extra, change, last)` returns the share of a step x - change that may be taken
      after the change `last`, so that no friction force passes its jump in it.
    - `wanted(extra)`: the part of the further results that is returned, and differentiated.
    - `most` is a traced number (floating-point), so that the compiler does not unroll the loop:
      the program has one copy of `evaluate`, and its results are in memory.

    In a batch the loop goes on until the last lane is done, and each lane's root is the one that it
    has by itself. The derivative is by the implicit function theorem, dx = -F_x^-1 dF at fixed x,
    with the exact F_x whatever matrix the iterations used.
    """

    # Traced once, however often it is called.
    evaluate = jax.jit(evaluate)
    structure, inputs = jax.tree.structure(given), len(jax.tree.leaves(given))

    def at(leaves, x):
        residual, _, _, extra = evaluate(jax.tree.unflatten(structure, leaves), x)
        return residual, wanted(extra)

    def along(leaves, root, count, dots):
        return fusion_barrier(count > 0, lambda dots: _directions(at, leaves, root, dots), dots)

    @jax.custom_jvp
    def run(given, guess, most):
        def trip(carry):
            count, was, x, before, _ = carry
            residual, matrix, size, extra = evaluate(given, x)
            # A residual that was good enough before the last step is now at round-off.
            left = jnp.where((size <= _BALANCED) | (was <= 1), 0.0, size)
            change = eliminate(matrix, residual)
            last = tuple(a - b for a, b in zip(before, x, strict=True))
            share = shorten(given, extra, change, last)
            # A lane that is done keeps its root while other lanes of the batch go on.
            after = tuple(
                jnp.where(left > 0, a - share * b, a) for a, b in zip(x, change, strict=True)
            )
            return count + 1, left, after, x, wanted(extra)

        def go_on(carry):
            count, left = carry[:2]
            return jnp.all(count <= most) & unvmap_any(left > 0)

        shapes = jax.eval_shape(trip, (most, most, guess, guess, None))
        empty = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shapes)
        unknown = jnp.full_like(empty[1], jnp.inf)
        start = (jnp.zeros((), most.dtype), unknown, guess, guess, empty[4])
        count, _, _, root, extra = jax.lax.while_loop(go_on, trip, start)
        return (root, extra), count

    def rule(primals, tangents):
        given, guess, most = primals
        (root, extra), count = run(given, guess, most)
        leaves = jax.tree.leaves(given)
        dots = jax.tree.leaves(tangents[0], is_leaf=lambda x: isinstance(x, SymbolicZero))
        moved = [i for i, dot in enumerate(dots) if not isinstance(dot, SymbolicZero)]
        if not moved:
            return ((root, extra), count), jax.tree.map(jnp.zeros_like, ((root, extra), count))

        one = {i: dots[i][None] for i in moved}
        some = jax.tree.map(lambda dot: dot[0], along(leaves, root, count, one))
        return ((root, extra), count), (some, jnp.zeros_like(count))

    def columns(arguments, results, dots):
        leaves, root, count = arguments[:inputs], tuple(results[: len(guess)]), results[-1]
        moved = {i: dot for i, dot in enumerate(dots[:inputs]) if dot is not None}
        if not moved:
            return [None] * len(results)
        return [*jax.tree.leaves(along(leaves, root, count, moved)), None]

    run.defjvp(rule, symbolic_zeros=True)
    return custom_columns(run, columns)(given, jax.lax.stop_gradient(guess), most)[0]


def _directions(at, leaves, root, dots):
    """The derivatives of a root and of the further results there, along all directions.

    `dots` are the derivatives of some of the `leaves`, by the leaf's number, with the directions in
    the first axis. `at(leaves, x)` gives the residual at x and the further results.
    """
    traced, shapes = jax.make_jaxpr(at, return_shape=True)(leaves, root)
    size = len(root)
    values, none = [*leaves, *root], [None] * len(leaves)
    # Without what only the iterations read.
    needed, _ = dce_jaxpr(traced.jaxpr, [True] * len(traced.out_avals), instantiate=True)
    program = needed, traced.consts, values
    # The whole Jacobian in x, column by column: the matrix of the iterations is only close to it.
    _, slopes = pushed(*program, [*none, *jnp.eye(size, dtype=root[0].dtype)])
    outs, moved = pushed(*program, [*map(dots.get, range(len(leaves))), *[None] * size])
    like = next(iter(dots.values()))
    zero = jnp.zeros_like(root[0])
    matrix = [[zero if row is None else row[j] for j in range(size)] for row in slopes[:size]]
    nothing = jnp.zeros(like.shape[:1], root[0].dtype)
    right = tuple(nothing if dot is None else dot for dot in moved[:size])
    root_dot = tuple(-d for d in eliminate(matrix, right))

    def total(out, dot, slope):
        if dot is None:
            dot = jnp.zeros((*like.shape[:1], *out.shape), out.dtype)
        if slope is not None:
            for j, of_root in enumerate(root_dot):
                dot = dot + slope[j][None] * of_root.reshape(-1, *[1] * out.ndim)
        return dot

    rest = [total(*each) for each in zip(outs[size:], moved[size:], slopes[size:], strict=True)]
    return root_dot, jax.tree.unflatten(jax.tree.structure(shapes[1]), rest)
