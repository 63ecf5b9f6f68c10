"""Newton's method for a few scalar unknowns, differentiated through the converged equation."""

from collections.abc import Callable

import jax
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
    linearized: Callable[[Unknowns], tuple[Unknowns, Matrix]], guess: Unknowns, iterations: int
) -> Unknowns:
    """A root near `guess`, by `iterations` steps of Newton's method.

    `linearized(x)` gives the residual F at x and a matrix M close to its derivative; it may close
    over traced values. The derivative of the root is by the implicit function theorem,
    dx = -M^-1 dF at fixed x, taken at the last iteration alone: earlier ones are constants to it.
    That makes first derivatives right, as the root is converged and M close, and only these.
    """
    x = guess
    for _ in range(iterations):
        x = jax.lax.stop_gradient(x)
        value, matrix = linearized(x)
        change = eliminate(jax.lax.stop_gradient(matrix), value)
        x = tuple(a - b for a, b in zip(x, change, strict=True))
    return x
