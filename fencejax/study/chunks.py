"""Many lanes through one compiled program, a chunk at a time."""

import concurrent.futures
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

CountProgress = Callable[[int, int], None]


def in_chunks(
    program: Callable[[Any], Any],
    lanes: Any,
    size: int,
    *,
    workers: int = 1,
    progress: CountProgress | None = None,
) -> Any:
    """The results of a vectorised program for any number of lanes, on the host.

    **Arguments:**

    - `program`: from a tree of arrays with `size` lanes as their first axis to another such tree.
    - `lanes`: the same with any number of lanes, at least 1. The last chunk is filled up with the
      last lane, so that one program serves all.
    - `workers`: threads that call the program. The first chunk, which compiles it, runs alone.
    - `progress(done, total)`: called after every chunk.
    """
    total = len(jax.tree.leaves(lanes)[0])
    picks = np.minimum(np.arange(-(-total // size) * size), total - 1).reshape(-1, size)

    def one(pick):
        chunk = jax.tree.map(lambda leaf: jnp.asarray(np.asarray(leaf)[pick]), lanes)
        return jax.device_get(program(chunk))

    done = []
    with concurrent.futures.ThreadPoolExecutor(workers) as pool:
        for results in (map(one, picks[:1]), pool.map(one, picks[1:])):
            for result in results:
                done.append(result)
                if progress is not None:
                    progress(min(total, len(done) * size), total)
    return jax.tree.map(lambda *parts: np.concatenate(parts)[:total], *done)
