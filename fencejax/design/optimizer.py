"""Constrained design: the smallest worst case under limits."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import optax
from jaxtyping import ArrayLike

from .. import _check
from ..results import Status
from .evaluator import Evaluator, Record as Record
from .first_order import FirstOrder
from .journal import Journal
from .lagrangian import Evaluation, Multipliers, Residual, Vector, onto_simplex, residual, updated
from .optimum import Optimum, Stop
from .program import LaneProgram, Numbers, Problem, Program
from .sqp import Sequence

_ENDS = {
    "optimal": Stop.OPTIMAL,
    "spent": Stop.BUDGET,
    "stalled": Stop.STAGNATED,
    "infeasible": Stop.INFEASIBLE,
}


def minimize(
    problem: Problem | Program | LaneProgram,
    start: ArrayLike,
    *,
    data: tuple[Any, ...] = (),
    bounded: bool = True,
    method: str | optax.GradientTransformation = "sqp",
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
    """min over z of max_i F_i(z), subject to g_j(z) >= 0 and 0 <= z <= 1.

    By sequential quadratic programming (`fencejax.design.sqp`), or by any optimiser of optax on an
    augmented Lagrangian (`fencejax.design.first_order`):

        fj.minimize(problem, space.to_shares(values))
        fj.minimize(problem, space.to_shares(values), method=optax.adam(1e-2))

    One evaluation is one call of the compiled problem, which gives every F and g with the
    Jacobian.

    **Arguments:**

    - `problem`: z (n,) -> objectives F (k,), margins g (m,) [1], statuses of the lanes (any shape;
      see `Status`, 0 where there are none); or a `Program` or `LaneProgram`, which several runs
      then share and which compute lanes in numerical doubt again.
    - `start`: z at the start; shares in [0, 1], as those of `DesignSpace`.
    - `data`: further arguments of the problem, the same throughout the run.
    - `bounded`: whether z stays within [0, 1]; otherwise it is free.
    - `method`: `"sqp"`, which takes the fewest evaluations, or an `optax.GradientTransformation`
      whose update needs gradient and value alone.
    - `tolerance` [1]: on stationarity and complementarity, the objective over `scale`.
    - `feasibility` [1]: the violation of a margin that still counts as none.
    - `penalty`: rho at the start.
    - `scale`: of the objective, by default its magnitude at the start.
    - `budget`: evaluations at most.
    - `multipliers`: those at the start, in the units of `scale`: of a neighbouring problem's
      optimum, say. By default equal weights, and 0 for the margins.
    - `worst_status`: an evaluation with a larger status that is not numerical, or with a number
      that is not finite, has failed: the step towards it is shortened. Numbers in numerical doubt
      are used, and the record says so (`Record.in_doubt`).
    - `journal`: evaluations made before; the run is resumed from them, and adds its own.
    - `progress`: called with every `Record`.

    Raises `ValueError` and `TypeError` for arguments out of their range.

    >>> optimum = fj.minimize(lambda z: (z**2, z - 0.5, jnp.zeros(1, int)), [0.9])
    >>> print(optimum.summary(margins=["minimum"]))
    Optimum
      ended                      the conditions of Karush, Kuhn and Tucker hold within the tolerance
      limits                     all limits hold
      worst case                 0.81 at the start, 0.25 found
      evaluations                3
      z[0]                       0.5
      minimum limits the design  0.01 saved for each 1 % it is relaxed by (of its bound or scale)
    """
    program = problem if isinstance(problem, (Program, LaneProgram)) else Program(problem)

    def compute(point: Vector, least: np.ndarray | None) -> Numbers:
        return program(point, *data, least=least)

    settings = Settings(
        bounded, method, tolerance, feasibility, penalty, scale, budget, worst_status
    )
    return settings.run(compute, start, data, multipliers, journal, progress)


@dataclasses.dataclass(frozen=True)
class Settings:
    """The arguments of `minimize` that set the method, checked."""

    bounded: bool = True
    method: str | optax.GradientTransformation = "sqp"
    tolerance: float = 1e-3
    feasibility: float = 1e-4
    penalty: float = 10.0
    scale: float | None = None
    budget: int = 150
    worst_status: int = Status.LEFT_OVER_TIP

    def __post_init__(self):
        if not isinstance(self.method, optax.GradientTransformation) and self.method != "sqp":
            raise ValueError(
                'Argument `method` must be "sqp" or an optax.GradientTransformation, but is '
                f"{self.method!r}. Write, for example, method=optax.adam(1e-2)."
            )
        for name in ("tolerance", "feasibility", "penalty"):
            _check.number(name, getattr(self, name), above=0)
        _check.count("budget", self.budget, least=1)
        if self.scale is not None:
            _check.number("scale", self.scale, above=0)

    def run(
        self,
        compute: Callable[..., Numbers],
        start: ArrayLike,
        data: tuple[Any, ...] = (),
        multipliers: Multipliers | None = None,
        journal: Journal | None = None,
        progress: Callable[[Record], None] | None = None,
    ) -> Optimum:
        """Minimise the problem computed by `compute`; see `minimize`."""
        point = np.asarray(_check.vector("start", start), dtype=float)
        if self.bounded and not np.all((point >= 0) & (point <= 1)):
            raise ValueError(
                f"Argument `start` must hold shares in [0, 1] [1], but is {point}. Write "
                "space.to_shares(values), or bounded=False for a point without bounds."
            )
        run = Evaluator(
            compute, self.bounded, self.scale, self.budget, self.worst_status, progress, journal,
            data,
        )  # fmt: skip
        at = run(point)
        assert at is not None
        run.first = at
        multipliers = _initial(at) if multipliers is None else _checked(multipliers, at)
        if at.failed:
            return _outcome(run, at, multipliers, Stop.FAILED_START, self.feasibility)
        run.outer, left, on_kink = 1, None, False
        if isinstance(self.method, optax.GradientTransformation):
            descent = FirstOrder(
                self.method, multipliers, penalty=self.penalty, bounded=self.bounded
            )
            run.context = lambda: np.concatenate(descent.multipliers)
            run.estimate = lambda at: updated(at, descent.multipliers, descent.penalty)
            end, outcome = descent.run(run, at, self.tolerance, self.feasibility)
            multipliers = descent.multipliers
        else:
            latest = [multipliers]
            run.estimate = lambda _: latest[0]
            sequence = Sequence(self.bounded, self.tolerance, self.feasibility, self.penalty)
            end, multipliers, outcome = sequence.run(run, at, multipliers, latest)
            if outcome != "optimal" and not run.spent:
                best = self._restored(run)
                if best is not end and best.violation <= self.feasibility < end.violation:
                    run.outer += 1
                    end, multipliers, outcome = sequence.run(run, best, multipliers, latest)
            left = sequence.left if sequence.judged is end else None
            on_kink = sequence.on_kink
        stop = Stop.STAGNATED if outcome == "spent" and run.circling else _ENDS[outcome]
        if stop is not Stop.OPTIMAL:
            best = self._best(run)
            if best is not end:
                end, multipliers, left = best, _without_inactive(best, multipliers), None
            stop = _without_optimum(stop, end.violation <= self.feasibility)
        on_kink = on_kink and stop is Stop.OPTIMAL
        return _outcome(run, end, multipliers, stop, self.feasibility, left, on_kink)


    def _best(self, run: Evaluator) -> Evaluation:
        """The lowest of the feasible designs, or else the least-violating one."""
        return min(run.evaluations, key=lambda e: (max(e.violation, self.feasibility), e.worst))

    def _restored(self, run: Evaluator) -> Evaluation:
        """The best design. Where it is not feasible, the largest violation alone is first minimised
        from there, as a worst case without limits, within the budget."""
        best = self._best(run)
        if best.violation <= self.feasibility:
            return best
        largest, estimate = best.violation, run.estimate

        def missing(at: Evaluation) -> Evaluation:
            return dataclasses.replace(
                at, objectives=-at.margins / largest, objective_rows=-at.margin_rows / largest,
                margins=at.margins[:0], margin_rows=at.margin_rows[:0],
            )  # fmt: skip

        def evaluate(point: Vector) -> Evaluation | None:
            if run.evaluations[-1].violation <= self.feasibility:
                return None
            at = run(point)
            return None if at is None else missing(at)

        run.outer, run.estimate = run.outer + 1, None
        at = missing(best)
        multipliers = _initial(at)
        Sequence(self.bounded, self.tolerance, self.feasibility, self.penalty).run(
            evaluate, at, multipliers, [multipliers]
        )
        run.estimate = estimate
        return self._best(run)


def _without_optimum(stop: Stop, feasible: bool) -> Stop:
    """Why a run ended that found no optimum, given whether its best design is feasible."""
    if stop is Stop.BUDGET:
        return stop
    return Stop.STAGNATED if feasible else Stop.INFEASIBLE


def _initial(at: Evaluation) -> Multipliers:
    count = at.objectives.size
    return Multipliers(np.full(count, 1 / count), np.zeros(at.margins.size))


def _checked(given: Multipliers, at: Evaluation) -> Multipliers:
    """Given multipliers, checked: weights on the simplex, none below 0."""
    weights, margins = (np.asarray(part, dtype=float) for part in given)
    if weights.shape != at.objectives.shape or margins.shape != at.margins.shape:
        raise ValueError(
            f"Argument `multipliers` must have the shapes {at.objectives.shape} and "
            f"{at.margins.shape} of objectives and margins, but has {weights.shape} and "
            f"{margins.shape}."
        )
    return Multipliers(onto_simplex(weights), np.maximum(margins, 0.0))


def _without_inactive(at: Evaluation, multipliers: Multipliers) -> Multipliers:
    """The same weights; the multipliers of inactive margins are set to 0."""
    return Multipliers(multipliers.weights, np.where(at.margins > 0, 0.0, multipliers.margins))


def _outcome(
    run: Evaluator,
    at: Evaluation,
    multipliers: Multipliers,
    stop: Stop,
    feasibility: float,
    left: Residual | None = None,
    on_kink: bool = False,
) -> Optimum:
    return Optimum(
        first=run.first,
        last=at,
        weights=multipliers.weights,
        multipliers=multipliers.margins,
        scale=run.scale or 1.0,
        residual=left or residual(at, multipliers, run.bounded),
        stop=stop,
        feasible=at.violation <= feasibility,
        history=tuple(run.records),
        on_kink=on_kink,
    )
