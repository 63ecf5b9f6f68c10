"""Evaluations of a compiled problem, one after the other, each of them recorded."""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..results import DOUBTFUL, Status
from .journal import Journal
from .lagrangian import Evaluation, Multipliers, Residual, Vector, residual

Problem = Callable[..., tuple[Array, Array, Array]]
"""z (n,), and data where there are any -> objectives (k,), margins (m,), statuses of any shape."""


class Numbers(NamedTuple):
    """What a problem and its Jacobian are at a point, on the host: objectives (k,), margins (m,),
    their Jacobians (k, n) and (m, n), and how often each `Status` occurred (8,)."""

    objectives: Vector
    margins: Vector
    objective_rows: np.ndarray
    margin_rows: np.ndarray
    statuses: np.ndarray

    @property
    def status(self) -> int:
        """The largest status that occurred."""
        return int(np.max(np.flatnonzero(self.statuses), initial=0))


class Program:
    """A problem with its Jacobian, compiled once for all runs that use it.

    The problem is a function of z (n,) and of further arguments, the *data*: any pytrees of
    numbers that a run holds fixed, such as the bound of a limit. They are arguments of the
    compiled program, so that another value of theirs compiles nothing.
    """

    def __init__(self, problem: Problem):
        def everything(z, *data):
            objectives, margins, status = problem(z, *data)
            numbers = (jnp.atleast_1d(objectives), jnp.atleast_1d(margins))
            codes = jnp.ravel(jnp.asarray(status, dtype=int))
            counts = jnp.sum(codes[:, None] == jnp.arange(len(Status))[None], axis=0)
            return numbers, (numbers, counts)

        jacobian = jax.jacfwd(everything, has_aux=True)
        self._one = jax.jit(jacobian)
        self._many = jax.jit(jax.vmap(jacobian))

    def __call__(self, point: Vector, *data: Any) -> Numbers:
        """The numbers at a point."""
        return _hosted(self._one(jnp.asarray(point), *data))

    def many(self, points: np.ndarray, *data: Any) -> list[Numbers]:
        """The numbers at several points (w, n), in one vectorised call; every leaf of the data has
        a first axis of that length. Another w compiles anew."""
        together = _hosted(self._many(jnp.asarray(points), *data))
        return [Numbers(*(part[i] for part in together)) for i in range(len(points))]


def _hosted(found) -> Numbers:
    rows, (numbers, counts) = jax.device_get(found)
    objectives, margins, by_objective, by_margin = (
        np.asarray(part, dtype=float) for part in (*numbers, *rows)
    )
    return Numbers(objectives, margins, by_objective, by_margin, np.asarray(counts))


class Record(NamedTuple):
    """One evaluation. Times [s] since the start, compilation included.

    `statuses` counts the lanes of each `Status`; `recalled` says that the numbers were read from a
    journal and not computed.
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
    recalled: bool = False

    @property
    def kkt(self) -> float:
        """The larger of stationarity and complementarity; NaN where they are not known."""
        return float("nan") if self.residual is None else max(self.residual[:2])


class Evaluator:
    """Every evaluation that a run makes of a program with its data.

    `estimate`, where set, gives the multipliers whose residual is recorded. With a journal, what
    it holds already is not computed again, and what is computed is written there.
    """

    def __init__(
        self,
        compute: Callable[[Vector], Numbers],
        logits: bool,
        scale: float | None,
        budget: int,
        worst_status: int,
        progress: Callable[[Record], None] | None,
        journal: Journal | None = None,
        data: tuple[Any, ...] = (),
    ):
        self._compute, self._journal, self._data = compute, journal, data
        self.logits, self.scale, self.budget = logits, scale, budget
        self._worst_status, self._progress = worst_status, progress
        self.evaluations: list[Evaluation] = []
        self.records: list[Record] = []
        self.outer = 0
        self.first: Evaluation
        self.estimate: Callable[[Evaluation], Multipliers] | None = None
        self._begin = time.perf_counter()

    def _numbers(self, point: Vector) -> tuple[Numbers, bool]:
        """The numbers at a point, and whether they were known already."""
        if self._journal is None:
            return self._compute(point), False
        known = self._journal.find(point, self._data)
        if known is not None:
            return Numbers(*known), True
        found = self._compute(point)
        self._journal.add(point, self._data, found)
        return found, False

    def __call__(self, point: Vector) -> Evaluation | None:
        """Evaluate, unless the budget is spent."""
        if self.spent:
            return None
        point = np.asarray(point, dtype=float)
        numbers, recalled = self._numbers(point)
        finite = all(np.all(np.isfinite(part)) for part in numbers)
        failed = not finite or numbers.status > self._worst_status
        if self.scale is None and not failed:
            self.scale = float(np.max(np.abs(numbers.objectives))) or 1.0
        scale = self.scale or 1.0
        at = Evaluation(
            point,
            numbers.objectives / scale,
            numbers.margins,
            numbers.objective_rows / scale,
            numbers.margin_rows,
            numbers.status,
            failed,
            failed and finite and numbers.status <= DOUBTFUL,
        )
        known = self.estimate is not None and not failed
        left = residual(at, self.estimate(at), self.logits) if known and self.estimate else None
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
