"""Constrained design: the smallest worst case under limits, by an augmented Lagrangian."""

import dataclasses
import enum
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import ArrayLike

from .. import _check
from ..results import Status
from .evaluator import Evaluator, Numbers, Problem, Program, Record as Record
from .first_order import Adam, Lbfgs, Merit
from .journal import Journal
from .lagrangian import (
    Evaluation,
    Multipliers,
    Residual,
    Vector,
    augmented,
    onto_simplex,
    projected,
    residual,
    shortfall,
    updated,
)
from .sqp import Sequence

_METHODS = {"lbfgs": Lbfgs, "adam": Adam}
_ENDS = {
    "optimal": "OPTIMAL",
    "spent": "BUDGET",
    "stalled": "STAGNATED",
    "infeasible": "INFEASIBLE",
}
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
    - `residual`: stationarity, complementarity and violation at `last`; by `"sqp"`, on a kink,
      with the slopes that points within a hundredth of the ranges found on its sides.
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
    problem: Problem | Program,
    start: ArrayLike,
    *,
    data: tuple[Any, ...] = (),
    logits: bool = False,
    method: str = "lbfgs",
    tolerance: float = 1e-3,
    feasibility: float = 1e-4,
    penalty: float = 10.0,
    scale: float | None = None,
    budget: int = 150,
    multipliers: Multipliers | None = None,
    worst_status: int = Status.LEFT_OVER_TIP,
    journal: Journal | None = None,
    progress: Callable[[Record], None] | None = None,
) -> Optimum:
    """min over z of max_i F_i(z), subject to g_j(z) >= 0.

    An augmented Lagrangian (`fencejax.lagrangian`) with an inner descent by optax, or sequential
    quadratic programming. One evaluation is one call of the compiled problem, which gives every F
    and g with the Jacobian.

    **Arguments:**

    - `problem`: z (n,) -> objectives F (k,), margins g (m,) [1], statuses of the lanes (any shape;
      see `Status`, 0 where there are none); or a `Program` made of such a function, which several
      runs then share.
    - `start`: z at the start.
    - `data`: further arguments of the problem, the same throughout the run.
    - `logits`: z are logits of shares in [0, 1], as those of `DesignSpace`; stationarity is then
      that of the shares between their bounds.
    - `method`: `"lbfgs"` or `"adam"` on the augmented Lagrangian, or `"sqp"`, sequential quadratic
      programming (`fencejax.sequential`), which takes the fewest evaluations.
    - `tolerance` [1]: on stationarity and complementarity, the objective over `scale`.
    - `feasibility` [1]: the violation of a margin that still counts as none.
    - `penalty`: rho at the start.
    - `scale`: of the objective, by default its magnitude at the start.
    - `budget`: evaluations at most.
    - `multipliers`: those at the start, in the units of `scale`: of a neighbouring problem's
      optimum, say. By default equal weights, and 0 for the margins.
    - `worst_status`: an evaluation with a status above it, or with a number that is not finite,
      has failed: the step towards it is shortened.
    - `journal`: evaluations made before; the run is resumed from them, and adds its own.
    - `progress`: called with every `Record`.

    Raises `ValueError` and `TypeError` for arguments out of their range.
    """
    program = problem if isinstance(problem, Program) else Program(problem)

    def compute(point: Vector) -> Numbers:
        return program(point, *data)

    settings = Settings(
        logits, method, tolerance, feasibility, penalty, scale, budget, worst_status
    )
    return settings.run(compute, start, data, multipliers, journal, progress)


@dataclasses.dataclass(frozen=True)
class Settings:
    """The arguments of `minimize` that say how, checked."""

    logits: bool = False
    method: str = "lbfgs"
    tolerance: float = 1e-3
    feasibility: float = 1e-4
    penalty: float = 10.0
    scale: float | None = None
    budget: int = 150
    worst_status: int = Status.LEFT_OVER_TIP

    def __post_init__(self):
        _check.choice("method", self.method, ("sqp", *_METHODS))
        for name in ("tolerance", "feasibility", "penalty"):
            _check.number(name, getattr(self, name), above=0)
        _check.count("budget", self.budget, least=1)
        if self.scale is not None:
            _check.number("scale", self.scale, above=0)

    def run(
        self,
        compute: Callable[[Vector], Numbers],
        start: ArrayLike,
        data: tuple[Any, ...] = (),
        multipliers: Multipliers | None = None,
        journal: Journal | None = None,
        progress: Callable[[Record], None] | None = None,
    ) -> Optimum:
        """Minimise what `compute` gives; see `minimize`."""
        point = np.asarray(_check.vector("start", np.asarray(start, dtype=float)))
        run = Evaluator(
            compute, self.logits, self.scale, self.budget, self.worst_status, progress, journal,
            data,
        )  # fmt: skip
        at = run(point)
        assert at is not None
        run.first = at
        held = _initial(at) if multipliers is None else _fitting(multipliers, at)
        if at.failed:
            return _outcome(run, at, held, Stop.FAILED_START, self.feasibility)
        within = (self.tolerance, self.feasibility)
        left = None
        if self.method == "sqp":
            inner = Lbfgs()
            at, held, stop, left = _stepwise(run, at, held, *within, self.penalty, self.logits)
        else:
            inner = _METHODS[self.method]()
            at, held, stop = _outer_loop(run, inner, at, held, *within, self.penalty)
        end = at
        if stop is not Stop.OPTIMAL:
            at, held, stop = _least_violating(run, inner, at, held, stop, *within)
        return _outcome(run, at, held, stop, self.feasibility, left if at is end else None)


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


def _stepwise(run: Evaluator, at, multipliers, tolerance, feasibility, penalty, logits):
    """Sequential quadratic programming; also what is left of the conditions at its end."""
    run.outer = 1
    latest = [multipliers]
    run.estimate = lambda _: latest[0]
    sequence = Sequence(logits, tolerance, feasibility, penalty)
    at, multipliers, end = sequence.run(run, at, multipliers, latest)
    return at, multipliers, Stop[_ENDS[end]], sequence.left


def _outer_loop(
    run: Evaluator, inner, at: Evaluation, multipliers, tolerance, feasibility, penalty
):
    """Descend, update the multipliers, raise the penalty where the violation does not fall."""
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


def _fitting(given: Multipliers, at: Evaluation) -> Multipliers:
    """Given multipliers, checked: weights on the simplex, none below 0."""
    weights, margins = (np.asarray(part, dtype=float) for part in given)
    if weights.shape != at.objectives.shape or margins.shape != at.margins.shape:
        raise ValueError(
            f"Argument `multipliers` must have the shapes {at.objectives.shape} and "
            f"{at.margins.shape} of objectives and margins, but has {weights.shape} and "
            f"{margins.shape}."
        )
    return Multipliers(onto_simplex(weights), np.maximum(margins, 0.0))


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
        return (
            best,
            multipliers if same else _refit(best, multipliers),
            Stop.STAGNATED if stop is Stop.INFEASIBLE else stop,
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
    return Multipliers(multipliers.weights, np.where(at.margins > 0, 0.0, multipliers.margins))


def _outcome(
    run: Evaluator,
    at: Evaluation,
    multipliers: Multipliers,
    stop: Stop,
    feasibility: float,
    left: Residual | None = None,
) -> Optimum:
    return Optimum(
        first=run.first,
        last=at,
        weights=multipliers.weights,
        multipliers=multipliers.margins,
        scale=run.scale or 1.0,
        residual=left or residual(at, multipliers, run.logits),
        stop=stop,
        feasible=at.violation <= feasibility,
        history=tuple(run.records),
    )
