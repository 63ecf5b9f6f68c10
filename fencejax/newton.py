"""Newton's method for a few scalar unknowns, differentiated through the converged equation."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

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
    evaluate: Callable[[Any, Unknowns], tuple[Unknowns, Matrix, Any]],
    given: Any,
    guess: Unknowns,
    iterations: Array,
) -> tuple[Unknowns, Any]:
    """A root near `guess` after `iterations` steps of Newton's method, and what goes with it.

    `evaluate(given, x)` returns the residual at x, a matrix close to its derivative in x, and
    whatever else is wanted at the root. `iterations` is a traced number (floating-point), so that
    the compiler keeps the loop: one copy of `evaluate` in the program, its results in memory.

    The derivative is by the implicit function theorem, dx = -M^-1 dF at fixed x, and does not pass
    through the iterations. It is right to the first order, as the root is converged and M close.
    """
    # The pytree of inputs is explicit: nothing that is differentiated is closed over.
    return _solved(evaluate, given, jax.lax.stop_gradient(guess), iterations)


def _solved(evaluate, given, guess, iterations):
    @jax.custom_jvp
    def run(given, guess, iterations):
        shapes = jax.eval_shape(lambda g, x: evaluate(g, x)[2], given, guess)
        empty = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shapes)

        def trip(carry):
            count, x, _, _ = carry
            residual, matrix, extra = evaluate(given, x)
            change = eliminate(matrix, residual)
            return count + 1, tuple(a - b for a, b in zip(x, change, strict=True)), x, extra

        start = (jnp.zeros_like(iterations), guess, guess, empty)
        _, _, root, extra = jax.lax.while_loop(lambda c: c[0] <= iterations, trip, start)
        return root, extra

    @run.defjvp
    def _(primals, tangents):
        given, guess, iterations = primals
        given_dot = tangents[0]
        root, extra = run(given, guess, iterations)
        _, matrix, _ = evaluate(given, root)

        def at_root(given):
            residual, _, extra = evaluate(given, root)
            return residual, extra

        _, (residual_dot, extra_dot) = jax.jvp(at_root, (given,), (given_dot,))
        root_dot = tuple(-d for d in eliminate(matrix, residual_dot))
        _, moved = jax.jvp(lambda x: evaluate(given, x)[2], (root,), (root_dot,))
        return (root, extra), (root_dot, jax.tree.map(jnp.add, extra_dot, moved))

    return run(given, guess, iterations)
