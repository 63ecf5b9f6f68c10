"""Numbers that their status doubts are computed again, at the next finer fidelity."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import ArrayLike

from .status import NUMERICAL

_DOUBTS = np.array(sorted(NUMERICAL))
# One lane takes hardly less time than eight.
_FEWEST = 8


def climb(
    compute: Callable[[int], Any],
    doubted: Callable[[Any], bool],
    rungs: int,
    found: Any,
    *,
    rung: int = 0,
    least: int = 0,
) -> tuple[Any, int]:
    """What `compute` gives at the first of `rungs` rungs, from `least` on, where it is not
    `doubted`, and that rung; that of the last stands in any case. `found` is what it gives at
    `rung`."""
    while (rung < least or doubted(found)) and rung + 1 < rungs:
        rung = max(rung + 1, least)
        found = compute(rung)
    return found, rung


class Refined(NamedTuple):
    """Numbers of lanes, each leaf with the lanes first; their statuses, and the rung of each."""

    numbers: Any
    statuses: np.ndarray
    rungs: np.ndarray


def refined(
    compute: Callable[[int, Any], tuple[Any, ArrayLike]],
    lanes: Any,
    rungs: int,
    least: np.ndarray | None = None,
) -> Refined:
    """The numbers of lanes, each at the first rung at which they are not in doubt.

    Lanes whose status is numerical (`Status.numerical`) are gathered on the host and computed
    again at the next rung, up to the last, whose numbers stand in any case. The number of lanes in
    a call is a power of two from 8 on, filled up with the first of them, so that few programs are
    compiled: one lane takes hardly less time than eight.

    **Arguments:**

    - `compute`: rung (from 0, coarsest) and lanes -> numbers and statuses, each leaf with the lanes
      first; a compiled function.
    - `lanes`: a pytree whose leaves have the lanes first.
    - `rungs`: how many there are.
    - `least`: the rung from which each lane begins; by default the first.
    """
    first = 0 if least is None else int(np.min(least, initial=rungs - 1))
    numbers, statuses = jax.device_get(compute(first, lanes))
    numbers, statuses = jax.tree.map(np.array, numbers), np.array(statuses)
    used = np.full(statuses.shape[0], first)
    for rung in range(first + 1, rungs):
        wanted = np.isin(statuses, _DOUBTS)
        if least is not None:
            wanted = wanted | (least >= rung)
        doubtful = np.flatnonzero(wanted)
        if not doubtful.size:
            continue
        # Never more than there are: of few lanes all, so that one program serves any of them.
        size = min(max(_FEWEST, 1 << int(doubtful.size - 1).bit_length()), statuses.shape[0])
        chosen = np.append(doubtful, np.full(size - doubtful.size, doubtful[0]))
        part = jax.tree.map(lambda leaf, chosen=chosen: np.asarray(leaf)[chosen], lanes)
        finer, now = jax.device_get(compute(rung, part))
        count = doubtful.size

        def put(old, new, at=doubtful, count=count):
            old[at] = np.asarray(new)[:count]

        jax.tree.map(put, numbers, finer)
        put(statuses, now)
        used[doubtful] = rung
    return Refined(numbers, statuses, used)
