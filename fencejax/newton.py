"""Newton's method for a few scalar unknowns, differentiated through the converged equation."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array

Unknowns = tuple[Array, ...]


def jacobian(function: Callable[[Unknowns], Unknowns], at: Unknowns) -> list[list[Array]]:
    """Rows of the derivative of `function`, as scalars."""
    _, linear = jax.linearize(function, at)
    return _columns(linear, at)


def _columns(linear, at):
    columns = []
    for k in range(len(at)):
        unit = tuple(jnp.ones_like(x) if i == k else jnp.zeros_like(x) for i, x in enumerate(at))
        columns.append(linear(unit))
    return [list(row) for row in zip(*columns, strict=True)]


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
    residual: Callable[[Unknowns], Unknowns], guess: Unknowns, iterations: int
) -> Unknowns:
    """A root of `residual` near `guess`, by `iterations` steps of Newton's method.

    The derivative is that of the root itself, by the implicit function theorem, and does not pass
    through the iterations. `residual` may close over traced values.
    """

    def iterate(function, start):
        x = start
        for _ in range(iterations):
            value, linear = jax.linearize(function, x)
            step = eliminate(_columns(linear, x), value)
            x = tuple(a - b for a, b in zip(x, step, strict=True))
        return x

    def tangent(linear, right):
        return eliminate(_columns(linear, right), right)

    return jax.lax.custom_root(residual, guess, iterate, tangent)
