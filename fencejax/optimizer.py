"""Constrained design: the smallest worst case under limits, by an augmented Lagrangian."""

import dataclasses
import enum
from collections.abc import Callable

import numpy as np
from jaxtyping import ArrayLike

from . import _check
from .descent import Adam, Lbfgs, Merit
from .evaluator import Evaluator, Problem, Record as Record
from .lagrangian import (
    Evaluation,
    Multipliers,
    Residual,
    Vector,
    augmented,
    projected,
    residual,
    shortfall,
    updated,
)
from .status import Status

_METHODS = {"lbfgs": Lbfgs, "adam": Adam}
_ROUNDS = 30


class Stop(enum.Enum):
    """Why an optimisation ended."""

    OPTIMAL = "the conditions of Karush, Kuhn and Tucker hold within the tolerance"
    INFEASIBLE = "no feasible design found: the violation is stationary above the tolerance"
    STAGNATED = "no further progress, short of the tolerance"
    BUDGET = "the budget of evaluations is spent"
    FAILED_START = "the first design cannot be evaluated; see its status"


@dataclasses.dataclass(frozen=True)
class Optimum:
    """The outcome of `minimize`.

    **Fields:**

    - `first`, `last`: the evaluations at the start and at the end, objectives over `scale`; where
      nothing feasible was found, the last one is the least-violating of all that were made.
    - `weights`: share of each objective in the worst case's gradient [1].
    - `multipliers`: of the margins: the rate at which the worst case (over `scale`) grows with the
      margin that is demanded.
    - `scale`: what the objectives were divided by.
    - `residual`: stationarity, complementarity and violation at `last`.
    - `stop`, `feasible`: why it ended; whether all limits hold.
    - `history`: every evaluation.
    """

    first: Evaluation
    last: Evaluation
    weights: Vector
    multipliers: Vector
    scale: float
    residual: Residual
    stop: Stop
    feasible: bool
    history: tuple[Record, ...]

    @property
    def point(self) -> Vector:
        """The design z, shape (n,)."""
        return self.last.point

    @property
    def objectives(self) -> Vector:
        """Every objective there, in its own unit."""
        return self.last.objectives * self.scale

    @property
    def objective(self) -> float:
        """The worst case there, in the objective's own unit."""
        return self.last.worst * self.scale

    @property
    def margins(self) -> Vector:
        """Every margin there [1]."""
        return self.last.margins

    @property
    def converged(self) -> bool:
        """Whether the point meets the conditions of Karush, Kuhn and Tucker."""
        return self.stop is Stop.OPTIMAL


def minimize(
    problem: Problem,
    start: ArrayLike,
    *,
    logits: bool = False,
    method: str = "lbfgs",
    tolerance: float = 1e-3,
    feasibility: float = 1e-4,
    penalty: float = 10.0,
    scale: float | None = None,
    budget: int = 150,
    worst_status: int = Status.LEFT_OVER_TIP,
    progress: Callable[[Record], None] | None = None,
) -> Optimum:
    """min over z of max_i F_i(z), subject to g_j(z) >= 0.

    An augmented Lagrangian (`fencejax.lagrangian`) with an inner descent by optax. One evaluation
    is one call of the compiled problem, which gives every F and g with the Jacobian.

    **Arguments:**

    - `problem`: z (n,) -> objectives F (k,), margins g (m,) [1], statuses of the lanes (any shape;
      see `Status`, 0 where there are none).
    - `start`: z at the start.
    - `logits`: z are logits of shares in [0, 1], as those of `DesignSpace`; stationarity is then
      that of the shares between their bounds.
    - `method`: `"lbfgs"` or `"adam"`.
    - `tolerance` [1]: on stationarity and complementarity, the objective over `scale`.
    - `feasibility` [1]: the violation of a margin that still counts as none.
    - `penalty`: rho at the start.
    - `scale`: of the objective, by default its magnitude at the start.
    - `budget`: evaluations at most.
    - `worst_status`: an evaluation with a status above it, or with a number that is not finite,
      has failed: the step towards it is shortened.
    - `progress`: called with every `Record`.

    Raises `ValueError` and `TypeError` for arguments out of their range.
    """
    _check.choice("method", method, tuple(_METHODS))
    for name, number in (
        ("tolerance", tolerance),
        ("feasibility", feasibility),
        ("penalty", penalty),
    ):
        _check.number(name, number, above=0)
    _check.count("budget", budget, least=1)
    if scale is not None:
        _check.number("scale", scale, above=0)
    point = np.asarray(_check.vector("start", np.asarray(start, dtype=float)))
    run = Evaluator(problem, logits, scale, budget, worst_status, progress)
    inner = _METHODS[method]()
    at = run(point)
    assert at is not None
    run.first = at
    if at.failed:
        return _outcome(run, at, _initial(at), Stop.FAILED_START, feasibility)
    at, multipliers, stop = _outer_loop(run, inner, at, tolerance, feasibility, penalty)
    if stop is not Stop.OPTIMAL:
        at, multipliers, stop = _least_violating(
            run, inner, at, multipliers, stop, tolerance, feasibility
        )
    return _outcome(run, at, multipliers, stop, feasibility)


@dataclasses.dataclass(frozen=True)
class _Round:
    """One inner descent: its multipliers and penalty, and when it is done."""

    held: Multipliers
    penalty: float
    within: float
    tolerance: float
    feasibility: float
    logits: bool

    def merit(self, at: Evaluation) -> tuple[float, Vector]:
        return augmented(at, self.held, self.penalty)

    def estimate(self, at: Evaluation) -> Multipliers:
        return updated(at, self.held, self.penalty)

    def optimal(self, at: Evaluation) -> bool:
        left = residual(at, self.estimate(at), self.logits)
        return max(left[:2]) <= self.tolerance and left.violation <= self.feasibility

    def accepted(self, at: Evaluation) -> bool:
        slope = self.merit(at)[1]
        return projected(at.point, slope, self.logits) <= self.within or self.optimal(at)


def _outer_loop(run: Evaluator, inner, at: Evaluation, tolerance, feasibility, penalty):
    """Descend, update the multipliers, raise the penalty where the violation does not fall."""
    multipliers = _initial(at)
    inner_tolerance, left, idle = 0.1, np.inf, 0

    for outer in range(1, _ROUNDS + 1):
        run.outer = outer
        this = _Round(multipliers, penalty, inner_tolerance, tolerance, feasibility, run.logits)
        run.estimate = this.estimate
        stalled = False
        if not this.accepted(at):
            at, stalled = inner.run(run, this.merit, at, tuple(run.evaluations), this.accepted)
        multipliers = this.estimate(at)
        if this.optimal(at):
            return at, multipliers, Stop.OPTIMAL
        if run.spent:
            return at, multipliers, Stop.BUDGET
        idle = idle + 1 if stalled else 0
        if idle >= 3:
            return at, multipliers, Stop.STAGNATED
        if penalty >= 1e5 and at.violation > 0.5 * left > feasibility:
            return at, multipliers, Stop.INFEASIBLE
        was, left = left, _slack(at, multipliers)
        if left > 0.3 * was:
            penalty = min(5 * penalty, 1e6)
        inner_tolerance = max(0.2 * inner_tolerance, 0.3 * tolerance)
    return at, multipliers, Stop.STAGNATED


def _initial(at: Evaluation) -> Multipliers:
    count = at.objectives.size
    return Multipliers(np.full(count, 1 / count), np.zeros(at.margins.size))


def _slack(at: Evaluation, multipliers: Multipliers) -> float:
    """What the multiplier updates still change: violation and complementarity together."""
    open_margins = np.minimum(at.margins, multipliers.margins)
    behind = multipliers.weights @ (at.worst - at.objectives)
    return float(max(np.max(np.abs(open_margins), initial=0.0), behind))


def _least_violating(run: Evaluator, inner, at, multipliers, stop, tolerance, feasibility):
    """Where the limits do not hold: lower the violation alone, from the least-violating design.

    A feasible design found on the way is kept, and the reason to stop with it.
    """
    best = min(run.evaluations, key=lambda e: (max(e.violation, feasibility), e.worst))
    if best.violation <= feasibility:
        same = best is at
        return best, multipliers if same else _refit(best, multipliers), (
            Stop.STAGNATED if stop is Stop.INFEASIBLE else stop
        )

    def held(at):
        return at.violation <= feasibility

    def stationary(at):
        value, gradient = shortfall(at)
        return held(at) or projected(at.point, gradient, run.logits) <= tolerance * np.sqrt(value)

    run.outer += 1
    run.budget += 30
    merit: Merit = shortfall
    if not stationary(best):
        inner.run(run, merit, best, tuple(run.evaluations), stationary)
    best = min(run.evaluations, key=lambda e: (max(e.violation, feasibility), e.worst))
    if best.violation <= feasibility:
        return best, _refit(best, multipliers), stop if stop is Stop.BUDGET else Stop.STAGNATED
    return best, _refit(best, multipliers), Stop.INFEASIBLE


def _refit(at: Evaluation, multipliers: Multipliers) -> Multipliers:
    """The same weights; the multipliers of margins that are open are 0."""
    return Multipliers(
        multipliers.weights, np.where(at.margins > 0, 0.0, multipliers.margins)
    )


def _outcome(
    run: Evaluator, at: Evaluation, multipliers: Multipliers, stop: Stop, feasibility: float
) -> Optimum:
    return Optimum(
        first=run.first,
        last=at,
        weights=multipliers.weights,
        multipliers=multipliers.margins,
        scale=run.scale or 1.0,
        residual=residual(at, multipliers, run.logits),
        stop=stop,
        feasible=at.violation <= feasibility,
        history=tuple(run.records),
    )
