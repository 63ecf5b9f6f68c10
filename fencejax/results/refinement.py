"""Lanes with a numerical status are computed again, at the next finer fidelity."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import ArrayLike

from ..lanes import FEW
from .status import NUMERICAL

_DOUBTS = np.array(sorted(NUMERICAL))
# Lanes in a call where there are more than are computed one by one. Every other number of lanes
# compiles a program of its own. 64 lanes take a tenth less time for each, but waste more in a call
# that is not full.
_MANY = 32


def climb(
    compute: Callable[[int], Any],
    doubted: Callable[[Any], bool],
    rungs: int,
    found: Any,
    *,
    rung: int = 0,
    least: int = 0,
) -> tuple[Any, int]:
    """The result of `compute` at the first of `rungs` rungs, from `least` on, where it is not
    `doubted`, and that rung; the result of the last rung stands in any case. `found` is the result
    at `rung`."""
    while (rung < least or doubted(found)) and rung + 1 < rungs:
        rung = max(rung + 1, least)
        found = compute(rung)
    return found, rung


class Refined(NamedTuple):
    """Numbers of lanes, each leaf with the lanes first; the status and the rung of each lane."""

    numbers: Any
    statuses: np.ndarray
    rungs: np.ndarray


def refined(
    compute: Callable[[int, Any], tuple[Any, ArrayLike]],
    lanes: Any,
    rungs: int,
    least: np.ndarray | None = None,
    *,
    grouped: bool = True,
) -> Refined:
    """The numbers of lanes, each at the first rung at which they are not in doubt.

    Lanes whose status is numerical (`Status.numerical`) are gathered on the host and computed
    again at the next rung, up to the last, whose numbers stand in any case: one by one while they
    are few, else in groups of 32, the last one filled up with its first lane. So a rung's program
    is compiled once, or twice, however many lanes are in doubt from call to call, and where all of
    them begin beyond the first rung, too.

    **Arguments:**

    - `compute`: rung (from 0, coarsest) and lanes -> numbers and statuses, each leaf with the lanes
      first; a compiled function.
    - `lanes`: a pytree whose leaves have the lanes first.
    - `rungs`: how many there are.
    - `least`: the rung from which each lane begins; by default the first.
    - `grouped`: with `False` they are all computed in one call: for a `compute` that makes chunks
      of its own.
    """
    first = 0 if least is None else int(np.min(least, initial=rungs - 1))

    def computed(rung, which):
        """The numbers and statuses of some lanes at a rung, call by call."""
        sizes = _groups(which.size) if grouped else [which.size]
        parts = []
        for start, size in zip(np.cumsum([0, *sizes]), sizes, strict=False):
            some = which[start : start + size]
            chosen = np.append(some, np.full(size - some.size, some[0]))
            part = jax.tree.map(lambda leaf, chosen=chosen: np.asarray(leaf)[chosen], lanes)
            found = jax.device_get(compute(rung, part))
            parts.append(jax.tree.map(lambda leaf, n=some.size: np.asarray(leaf)[:n], found))
        return jax.tree.map(lambda *leaves: np.concatenate(leaves), *parts)

    if first == 0:
        numbers, statuses = jax.device_get(compute(first, lanes))
    else:
        # Finer rungs are compiled for groups of lanes: a call with all lanes would be another
        # program.
        numbers, statuses = computed(first, np.arange(jax.tree.leaves(lanes)[0].shape[0]))
    numbers, statuses = jax.tree.map(np.array, numbers), np.array(statuses)
    used = np.full(statuses.shape[0], first)
    for rung in range(first + 1, rungs):
        wanted = np.isin(statuses, _DOUBTS)
        if least is not None:
            wanted = wanted | (least >= rung)
        doubtful = np.flatnonzero(wanted)
        if not doubtful.size:
            continue
        finer, now = computed(rung, doubtful)

        def put(old, new, at=doubtful):
            old[at] = new

        jax.tree.map(put, numbers, finer)
        put(statuses, now)
        used[doubtful] = rung
    return Refined(numbers, statuses, used)


def _groups(count: int) -> list[int]:
    """The number of lanes in each call, to compute `count` of them."""
    many, rest = divmod(count, _MANY)
    if rest <= FEW:
        return [_MANY] * many + [1] * rest
    return [_MANY] * (many + 1)
