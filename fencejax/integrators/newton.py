"""Newton's method for a few scalar unknowns, differentiated through the converged equation."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from equinox.internal import unvmap_any
from jaxtyping import Array

from .._xla import fusion_barrier

Unknowns = tuple[Array, ...]
Matrix = list[list[Array]]


def eliminate(matrix: list[list[Array]], right: Unknowns) -> Unknowns:
    """Solve a small dense system by elimination without pivots, written out in scalars.

    The systems here are the identity plus a step times the derivative of forces that oppose the
    motion, so that pivots stay away from zero for any step that resolves them.
    """
    size = len(right)
    rows = [list(row) for row in matrix]
    values = list(right)
    for k in range(size):
        for i in range(k + 1, size):
            factor = rows[i][k] / rows[k][k]
            for j in range(k + 1, size):
                rows[i][j] = rows[i][j] - factor * rows[k][j]
            values[i] = values[i] - factor * values[k]
    for k in reversed(range(size)):
        for j in range(k + 1, size):
            values[k] = values[k] - rows[k][j] * values[j]
        values[k] = values[k] / rows[k][k]
    return tuple(values)


def solve(
    evaluate: Callable[[Any, Unknowns], tuple[Unknowns, Matrix, Array, Any]],
    shorten: Callable[[Any, Any, Unknowns, Unknowns], Array],
    given: Any,
    guess: Unknowns,
    most: Array,
    wanted: Callable[[Any], Any] = lambda extra: extra,
) -> tuple[Unknowns, Any]:
    """A root near `guess` by at most `most` steps of Newton's method, and what goes with it.

    - `evaluate(given, x)` returns the residual at x, a matrix close to its derivative in x, the
      size of the residual against what is tolerated (at most 1: good enough), and whatever else is
      wanted at the root.
    - `shorten(given, extra, change, last)` returns the share of a step x - change that may be
      taken after the change `last`, so that no friction force is carried across its jump.
    - `wanted(extra)`: what of it is returned, and differentiated.
    - `most` is a traced number (floating-point). The compiler so keeps the loop: one copy of
      `evaluate` in the program, its results in memory.

    In a batch all lanes go on until the last one is done. The derivative is by the implicit
    function theorem, dx = -F_x^-1 dF at fixed x, with the exact F_x whatever the iterations used.
    """

    @jax.custom_jvp
    def run(given, guess, most):
        def trip(carry):
            count, _, x, before, _ = carry
            residual, matrix, size, extra = evaluate(given, x)
            change = eliminate(matrix, residual)
            last = tuple(a - b for a, b in zip(before, x, strict=True))
            share = shorten(given, extra, change, last)
            after = tuple(a - share * b for a, b in zip(x, change, strict=True))
            return count + 1, size, after, x, wanted(extra)

        def go_on(carry):
            count, size = carry[:2]
            return jnp.all(count <= most) & unvmap_any(size > 1)

        shapes = jax.eval_shape(trip, (most, most, guess, guess, None))
        empty = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shapes)
        unknown = jnp.full_like(empty[1], jnp.inf)
        start = (jnp.zeros((), most.dtype), unknown, guess, guess, empty[4])
        count, _, _, root, extra = jax.lax.while_loop(go_on, trip, start)
        return (root, extra), count

    @run.defjvp
    def _(primals, tangents):
        given, guess, most = primals
        (root, extra), count = run(given, guess, most)

        def at(given, x):
            residual, _, _, extra = evaluate(given, x)
            return residual, wanted(extra)

        def moved(given_dot):
            # The whole Jacobian in x, column by column: `matrix` is only close to it.
            columns = jax.vmap(
                lambda *unit: jax.jvp(lambda x: at(given, x), (root,), (unit,))[1], out_axes=-1
            )(*jnp.eye(len(root), dtype=root[0].dtype))
            slopes, extra_slopes = columns
            matrix = [[row[j] for j in range(len(root))] for row in slopes]
            _, (residual_dot, extra_dot) = jax.jvp(lambda g: at(g, root), (given,), (given_dot,))
            root_dot = tuple(-d for d in eliminate(matrix, residual_dot))

            def total(held, slope):
                for j, dot in enumerate(root_dot):
                    held = held + slope[j] * dot
                return held

            return root_dot, jax.tree.map(total, extra_dot, extra_slopes)

        root_dot, extra_dot = fusion_barrier(count > 0, moved, tangents[0])
        return ((root, extra), count), ((root_dot, extra_dot), jnp.zeros_like(count))

    return run(given, jax.lax.stop_gradient(guess), most)[0]
