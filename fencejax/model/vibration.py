"""The fence's vibration in modes, and its exact advance over a step.

Arrays of modes come as *blocks*: a tuple with one scalar a mode where the modes are few, which the
compiler fuses and `vmap` turns into arrays with the batch last, or one array for all where they
are many.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from .mode_shapes import MOST_SCALAR_MODES, Blocks


def blocks(values) -> Blocks:
    """Split (..., m) into blocks, the modes first gone or last kept."""
    modes = values.shape[-1]
    if modes > MOST_SCALAR_MODES:
        return (jnp.asarray(values),)
    return tuple(jnp.asarray(values[..., i]) for i in range(modes))


def dot(left: Sequence[Array], right: Sequence[Array]) -> Array:
    """Sum over the modes of the product of two blocks."""
    return total(a * b for a, b in zip(left, right, strict=True))


def total(blocks) -> Array:
    """Sum over the modes."""
    result = 0.0
    for block in blocks:
        result = result + (jnp.sum(block) if jnp.ndim(block) else block)
    return jnp.asarray(result)


class Vibration(NamedTuple):
    """Modal amplitudes [m] and their rates [m/s], as blocks."""

    amplitude: Blocks
    rate: Blocks


def propagate(maps, state: Vibration, start: Blocks, end: Blocks) -> Vibration:
    """One exact step under modal forces [m/s^2] that vary linearly from `start` to `end`."""
    amplitude, rate = [], []
    for m, q, v, f0, f1 in zip(maps, state.amplitude, state.rate, start, end, strict=True):
        amplitude.append(m.qq * q + m.qv * v + m.q_start * f0 + m.q_end * f1)
        rate.append(m.vq * q + m.vv * v + m.v_start * f0 + m.v_end * f1)
    return Vibration(tuple(amplitude), tuple(rate))


def flat(values: Blocks) -> Array:
    """Blocks as one array."""
    return jnp.concatenate([jnp.atleast_1d(value) for value in values])


def one_by_one(values: Blocks) -> list[Array]:
    """The modes of blocks one by one."""
    found = []
    for block in values:
        found.extend(block[i] for i in range(block.shape[0])) if block.ndim else found.append(block)
    return found


def combined(tables: Blocks, values: Blocks) -> Array:
    """Sum over the modes of a table over the nodes (first axis) times the modes' values."""
    parts = [
        jnp.sum(table * value[None], axis=-1) if jnp.ndim(value) else table * value
        for table, value in zip(tables, values, strict=True)
    ]
    return sum(parts[1:], parts[0])
