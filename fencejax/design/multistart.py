"""Several optimisations at once, with their evaluations in one vectorised call."""

import concurrent.futures
import functools
import queue
import threading
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np
from jaxtyping import ArrayLike

from .. import _check
from .evaluator import Record
from .journal import Journal
from .lagrangian import Multipliers, Vector
from .optimizer import Optimum, Settings
from .program import LaneProgram, Numbers, Problem, Program


def minimize_many(
    problem: Problem | Program | LaneProgram,
    starts: ArrayLike,
    *,
    data: Sequence[tuple[Any, ...]] | None = None,
    multipliers: Sequence[Multipliers | None] | None = None,
    width: int = 8,
    journal: Journal | None = None,
    progress: Callable[[int, Record], None] | None = None,
    **settings: Any,
) -> list[Optimum]:
    """`minimize` from several starts, or with several data, at once.

    Up to `width` runs proceed together. Each waits at its next point for the others, and one
    vectorised call evaluates all points; when a run ends, the next start takes its place. Each run
    takes the same steps as `minimize` alone, within rounding.

    **Arguments:**

    - `problem`: as for `minimize`; its data are vectorised over their first axis.
    - `starts`: z at the starts, shape (runs, n).
    - `data`: the data of each run, of one structure; by default none.
    - `multipliers`: those at the start of each run.
    - `width`: evaluations in a call, at most as many as there are starts.
    - `journal`, and `settings`: as for `minimize`. `progress` gets the run's number, too.

    Raises `ValueError` and `TypeError` for arguments out of their range.

    >>> problem = lambda z: (z**2, z - 0.5, jnp.zeros(1, int))
    >>> [found.point.round(3) for found in fj.minimize_many(problem, [[0.9], [0.7]])]
    [array([0.5]), array([0.5])]
    """
    points = np.asarray(starts, dtype=float)
    if points.ndim != 2 or not points.size:
        raise ValueError(
            f"Argument `starts` must have the shape (runs, variables), but has {points.shape}."
        )
    runs = len(points)
    for name, given in (("data", data), ("multipliers", multipliers)):
        if given is not None and len(given) != runs:
            raise ValueError(
                f"Argument `{name}` must hold one entry for each of the {runs} starts, but holds "
                f"{len(given)}."
            )
    width = min(_check.count("width", width, least=1), runs)
    chosen = Settings(**settings)
    program = problem if isinstance(problem, (Program, LaneProgram)) else Program(problem)
    waiting: queue.SimpleQueue[int] = queue.SimpleQueue()
    for number in range(runs):
        waiting.put(number)
    together = _Together(program, width)
    found: list[Optimum | None] = [None] * runs

    def work(place: int) -> None:
        try:
            while True:
                try:
                    run = waiting.get_nowait()
                except queue.Empty:
                    return
                own = () if data is None else data[run]
                found[run] = chosen.run(
                    functools.partial(together, place, own),
                    points[run],
                    own,
                    None if multipliers is None else multipliers[run],
                    journal,
                    None if progress is None else functools.partial(progress, run),
                )
        finally:
            together.leave(place)

    with concurrent.futures.ThreadPoolExecutor(width) as pool:
        jobs = [pool.submit(work, place) for place in range(width)]
    for job in jobs:
        job.result()
    return [optimum for optimum in found if optimum is not None]


class _Together:
    """Gathers one point from every active run, evaluates them in one call, returns the numbers."""

    def __init__(self, program: Program | LaneProgram, width: int):
        self._program, self._width = program, width
        self._present = set(range(width))
        self._asked: dict[int, tuple[Vector, tuple[Any, ...], np.ndarray | None]] = {}
        self._answers: dict[int, Numbers] = {}
        self._failure: BaseException | None = None
        self._change = threading.Condition()

    def __call__(
        self, place: int, data: tuple[Any, ...], point: Vector, least: np.ndarray | None
    ) -> Numbers:
        with self._change:
            self._asked[place] = (point, data, least)
            self._evaluate_if_complete()
            self._change.wait_for(lambda: place in self._answers or self._failure is not None)
            if self._failure is not None:
                raise RuntimeError("an evaluation of all runs failed") from self._failure
            return self._answers.pop(place)

    def leave(self, place: int) -> None:
        """The run is over: the others do not wait for it any more."""
        with self._change:
            self._present.discard(place)
            self._evaluate_if_complete()

    def _evaluate_if_complete(self) -> None:
        if not self._asked or set(self._asked) != self._present:
            return
        places, asked = list(self._asked), list(self._asked.values())
        # Vacant places are filled with one of the points, so that the shape stays the same.
        filled = asked + [asked[0]] * (self._width - len(asked))
        try:
            stacked = jax.tree.map(lambda *parts: np.stack(parts), *(data for _, data, _ in filled))
            many = self._program.many(
                np.stack([point for point, *_ in filled]), *stacked,
                least=[least for *_, least in filled],
            )  # fmt: skip
            self._answers.update(zip(places, many, strict=False))
        except BaseException as error:
            self._failure = error
            raise
        finally:
            self._asked.clear()
            self._change.notify_all()
