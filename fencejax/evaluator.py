"""Evaluations of a compiled problem, one after the other, each of them recorded."""

import time
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .lagrangian import Evaluation, Multipliers, Residual, Vector, residual

Problem = Callable[[Array], tuple[Array, Array, Array]]
"""z (n,) -> objectives (k,), margins (m,), statuses of any shape."""


class Record(NamedTuple):
    """One evaluation. Times [s] since the start, compilation included."""

    evaluation: int
    outer: int
    point: Vector
    objective: float
    violation: float
    residual: Residual | None
    status: int
    failed: bool
    elapsed: float

    @property
    def kkt(self) -> float:
        """The larger of stationarity and complementarity; NaN where they are not known."""
        return float("nan") if self.residual is None else max(self.residual[:2])


class Evaluator:
    """A compiled problem with its Jacobian, and every evaluation that was made of it.

    `estimate`, where set, gives the multipliers whose residual is recorded.
    """

    def __init__(
        self,
        problem: Problem,
        logits: bool,
        scale: float | None,
        budget: int,
        worst_status: int,
        progress: Callable[[Record], None] | None,
    ):
        def everything(z):
            objectives, margins, status = problem(z)
            numbers = (jnp.atleast_1d(objectives), jnp.atleast_1d(margins))
            return numbers, (numbers, jnp.max(status, initial=0))

        self._compiled = jax.jit(jax.jacfwd(everything, has_aux=True))
        self.logits, self.scale, self.budget = logits, scale, budget
        self._worst_status, self._progress = worst_status, progress
        self.evaluations: list[Evaluation] = []
        self.records: list[Record] = []
        self.outer = 0
        self.first: Evaluation
        self.estimate: Callable[[Evaluation], Multipliers] | None = None
        self._begin = time.perf_counter()

    def __call__(self, point: Vector) -> Evaluation | None:
        """Evaluate, unless the budget is spent."""
        if len(self.records) >= self.budget:
            return None
        rows, (numbers, status) = jax.device_get(self._compiled(jnp.asarray(point)))
        finite = all(np.all(np.isfinite(part)) for part in (*rows, *numbers))
        failed = not finite or int(status) > self._worst_status
        if self.scale is None and not failed:
            self.scale = float(np.max(np.abs(numbers[0]))) or 1.0
        scale = self.scale or 1.0
        at = Evaluation(
            np.asarray(point, dtype=float),
            np.asarray(numbers[0], dtype=float) / scale,
            np.asarray(numbers[1], dtype=float),
            np.asarray(rows[0], dtype=float) / scale,
            np.asarray(rows[1], dtype=float),
            int(status),
            failed,
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
