"""Evaluations of a compiled problem, one after the other, each recorded."""

import functools
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..results import Status
from .journal import Journal
from .lagrangian import Evaluation, Multipliers, Residual, Vector, residual
from .program import Numbers

# Points nearer to each other than this, relative to their size, count as the same.
_SAME = 1e-12


class Record(NamedTuple):
    """One evaluation. Times [s] since the start, compilation included.

    `statuses` counts the lanes of each `Status`, and `rungs` those of each rung of the problem's
    fidelities, from the coarsest on; `recalled` says that the numbers were read from a journal and
    not computed.

    >>> optimum = fj.minimize(lambda z: (z**2, z - 0.5, jnp.zeros(1, int)), [0.9])
    >>> [(record.evaluation, round(float(record.objective), 3)) for record in optimum.history]
    [(1, 0.81), (2, 0.303), (3, 0.25)]
    """

    evaluation: int
    outer: int
    point: Vector
    objective: float
    violation: float
    residual: Residual | None
    status: int
    failed: bool
    elapsed: float
    statuses: tuple[int, ...] = ()
    rungs: tuple[int, ...] = ()
    recalled: bool = False

    @property
    def in_doubt(self) -> int:
        """The number of lanes in numerical doubt even at the finest rung; their numbers are used
        nevertheless."""
        return sum(n for status, n in enumerate(self.statuses) if Status(status).numerical)

    @property
    def kkt(self) -> float:
        """The larger of stationarity and complementarity; NaN where they are unknown."""
        return float("nan") if self.residual is None else max(self.residual[:2])


class Evaluator:
    """Evaluates a program with its data and records every evaluation of a run.

    An evaluation has failed where a number is not finite, or a status that is not numerical is
    above `worst_status`. `estimate`, where set, gives the multipliers whose residual is recorded.
    With a journal, recorded evaluations are not computed again, and new ones are written to it. A
    run that returns to a point that it has evaluated before goes in a circle and ends (`circling`);
    where `context` is set, if what it gives, on which the next step depends too, is the same again.
    """

    def __init__(
        self,
        compute: Callable[..., Numbers],
        bounded: bool,
        scale: float | None,
        budget: int,
        worst_status: int,
        progress: Callable[[Record], None] | None,
        journal: Journal | None = None,
        data: tuple[Any, ...] = (),
    ):
        self._compute, self._journal, self._data = compute, journal, data
        self.bounded, self.scale, self.budget = bounded, scale, budget
        self.circling = False
        self.context: Callable[[], Vector] | None = None
        self._met: list[Vector] = []
        self._worst_status, self._progress = worst_status, progress
        self.evaluations: list[Evaluation] = []
        self.records: list[Record] = []
        self.outer = 0
        self.first: Evaluation
        self.estimate: Callable[[Evaluation], Multipliers] | None = None
        self._begin = time.perf_counter()
        # A lane once in doubt starts at the second rung from then on: a value that jumps between
        # rungs from point to point has kinks that an optimiser cannot distinguish from those of the
        # problem.
        self._least: np.ndarray | None = None

    def _numbers(self, point: Vector) -> tuple[Numbers, bool]:
        """The numbers at a point, and whether they were known already."""
        compute = functools.partial(self._compute, point, least=self._least)
        if self._journal is None:
            return compute(), False
        return self._journal.numbers(point, self._data, compute)

    def __call__(self, point: Vector) -> Evaluation | None:
        """Evaluate, unless the budget is spent or the point is known."""
        point = np.asarray(point, dtype=float)
        met = point if self.context is None else np.concatenate([point, self.context()])
        if any(_same(met, other) for other in self._met if other.shape == met.shape):
            self.circling = True
        if self.spent or self.circling:
            return None
        self._met.append(met)
        numbers, recalled = self._numbers(point)
        again = np.minimum(numbers.rungs, 1)
        self._least = again if self._least is None else np.maximum(self._least, again)
        finite = all(np.all(np.isfinite(part)) for part in numbers)
        failed = not finite or numbers.physical > self._worst_status
        if self.scale is None and not failed:
            self.scale = float(np.max(np.abs(numbers.objectives))) or 1.0
        scale = self.scale or 1.0
        at = Evaluation(
            point,
            numbers.objectives / scale,
            numbers.margins,
            numbers.objective_rows / scale,
            numbers.margin_rows,
            numbers.physical if failed and numbers.physical else numbers.status,
            failed,
            failed and finite and numbers.physical < Status.INCONSISTENT,
            numbers.rungs,
        )
        known = self.estimate is not None and not failed
        left = residual(at, self.estimate(at), self.bounded) if known and self.estimate else None
        record = Record(
            len(self.records) + 1,
            self.outer,
            at.point,
            at.worst * scale,
            at.violation,
            left,
            at.status,
            failed,
            time.perf_counter() - self._begin,
            tuple(numbers.statuses.tolist()),
            tuple(np.bincount(numbers.rungs).tolist()),
            recalled,
        )
        self.records.append(record)
        if not failed:
            self.evaluations.append(at)
        if self._progress is not None:
            self._progress(record)
        return at

    @property
    def spent(self) -> bool:
        """Whether the budget of evaluations is spent."""
        return len(self.records) >= self.budget


def _same(one: Vector, other: Vector) -> bool:
    size = max(1.0, float(np.max(np.abs(other))))
    return bool(np.max(np.abs(one - other)) <= _SAME * size)
