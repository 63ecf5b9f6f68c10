"""Sequential quadratic programming for a worst case under limits, in a trust region.

At a point, the worst case and the limits are replaced by their linear parts and the curvature of
the Lagrangian by a BFGS matrix B; what that leaves is a small quadratic program for the step d,

    min over d, t, e of   t + 1/2 d^T B d + nu e
    with                  F_i + J_i d <= t,   g_j + G_j d >= -e,   e >= 0,   |d| <= radius,

whose multipliers are those of the problem. e keeps it solvable where the limits contradict each
other. The step is judged by the worst case and nu times the largest violation, and repeated once
with the limits' curvature taken in where it is too long. One evaluation is one step.

Peak forces have kinks, where another blow becomes the largest. There the linear part holds on one
side alone, and steps would shorten to nothing at what is no optimum. As bundle methods do (Kiwiel
1985), the program also takes in what points nearby said, where they lie on another branch; a
rejected step is then not lost.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from . import quadratic
from .descent import Evaluate
from .lagrangian import Evaluation, Multipliers, Residual, Vector, residual

_EDGE = 1e-6
_SMALLEST = 1e-9
_PATIENCE = 12
_BARREN = 30
# Slopes that differ by more than this of their lengths are of two branches; how near another point
# must be, in steps of the chart, and how many points are remembered.
_UNLIKE = 0.1
_NEAR = 0.05
_MANY = 12


@dataclasses.dataclass
class _Chart:
    """The unknowns in which steps are made: shares in [0, 1] where the points are logits."""

    logits: bool

    def of(self, point: Vector) -> Vector:
        if not self.logits:
            return point
        return np.clip(1 / (1 + np.exp(-point)), _EDGE, 1 - _EDGE)

    def point(self, at: Vector) -> Vector:
        if not self.logits:
            return at
        share = np.clip(at, _EDGE, 1 - _EDGE)
        return np.log(share) - np.log1p(-share)

    def rows(self, at: Vector, rows):
        return rows / np.maximum(at * (1 - at), 1e-12) if self.logits else rows

    def span(self, at: Vector, radius: float) -> tuple[Vector, Vector]:
        """The least and the largest step."""
        least, most = np.full(at.size, -radius), np.full(at.size, radius)
        if self.logits:
            least, most = np.maximum(least, _EDGE - at), np.minimum(most, 1 - _EDGE - at)
        return least, most


@dataclasses.dataclass
class _Model:
    """The problem as seen from a point: values and slopes of F and g in the chart's unknowns.

    `lanes` and `places` say which objective and which margin a row is of; one may have several.
    """

    at: Vector
    objectives: Vector
    margins: Vector
    objective_rows: np.ndarray
    margin_rows: np.ndarray
    lanes: NDArray[np.intp]
    places: NDArray[np.intp]

    @classmethod
    def of(cls, evaluation: Evaluation, chart: _Chart) -> "_Model":
        at = chart.of(evaluation.point)
        return cls(
            at,
            evaluation.objectives,
            evaluation.margins,
            chart.rows(at, evaluation.objective_rows),
            chart.rows(at, evaluation.margin_rows),
            np.arange(evaluation.objectives.size),
            np.arange(evaluation.margins.size),
        )

    def slope(self, held: Multipliers) -> Vector:
        """The gradient of the Lagrangian."""
        return self.objective_rows.T @ held.weights - self.margin_rows.T @ held.margins

    def with_branches(self, others: "list[_Model]", reach: float) -> "_Model":
        """The same with the rows of other branches.

        A peak force is the largest of several blows, and which of them it is changes at a kink.
        What a point within `reach` said of an objective or margin is a further row of it where
        the slope is another one, F' + J' (x - x'), cut off at what F is here.
        """
        objectives, rows, lanes = [self.objectives], [self.objective_rows], [self.lanes]
        margins, limits, places = [self.margins], [self.margin_rows], [self.places]
        for other in others:
            away = self.at - other.at
            if other is self or np.max(np.abs(away)) > reach:
                continue
            there = other.objectives + other.objective_rows @ away
            new = _unlike(self.objective_rows, other.objective_rows)
            objectives.append(np.minimum(there, self.objectives)[new])
            rows.append(other.objective_rows[new])
            lanes.append(np.flatnonzero(new))
            there = other.margins + other.margin_rows @ away
            new = _unlike(self.margin_rows, other.margin_rows)
            margins.append(np.maximum(there, self.margins)[new])
            limits.append(other.margin_rows[new])
            places.append(np.flatnonzero(new))
        return _Model(
            self.at, np.concatenate(objectives), np.concatenate(margins), np.concatenate(rows),
            np.concatenate(limits), np.concatenate(lanes), np.concatenate(places),
        )  # fmt: skip

    def gathered(self, held: Multipliers) -> Multipliers:
        """The multipliers of rows as those of objectives and margins."""
        return Multipliers(
            np.bincount(self.lanes, held.weights).astype(float),
            np.bincount(self.places, held.margins).astype(float),
        )

    @property
    def count(self) -> int:
        """The number of rows."""
        return self.lanes.size + self.places.size

    def bent_from(self, other: "_Model", held: Multipliers) -> bool:
        """Whether an objective that counts has another slope here than nearby."""
        unlike = _unlike(other.objective_rows, self.objective_rows)
        near = float(np.max(np.abs(self.at - other.at))) < _NEAR
        return near and bool(np.any(unlike[held.weights > 0.01]))

    def step(self, curvature, penalty: float, span) -> tuple[Vector, Multipliers, float] | None:
        """The step, the multipliers of F and g, and the model's merit after it."""
        least, most = span
        size, count = self.at.size, self.objectives.size
        top = float(np.max(self.objectives))
        reach = np.maximum(-least, most)
        # What no step within the region can reach is left out of the program.
        near = self.margins - np.abs(self.margin_rows) @ reach <= 0
        swing = np.abs(self.objective_rows) @ reach
        high = self.objectives + swing >= np.max(self.objectives - swing)
        rows, low = self.margin_rows[near], self.margins[near]
        lead = self.objective_rows[high]
        unit = np.eye(size)
        # Steps in units of the region, so that its size does not matter to the program.
        region = max(float(np.max(reach)), 1e-300)
        lead, rows = region * lead, region * rows

        def widened(block, by_top, by_slack):
            ones = np.ones((len(block), 1))
            return np.hstack([block, by_top * ones, by_slack * ones])

        matrix = np.vstack([
            widened(-lead, 1.0, 0.0),
            widened(rows, 0.0, 1.0),
            widened(np.zeros((1, size)), 0.0, 1.0),
            widened(unit, 0.0, 0.0),
            widened(-unit, 0.0, 0.0),
        ])  # fmt: skip
        bounds = np.concatenate([
            self.objectives[high] - top, -low, [0.0], least / region, -most / region,
        ])  # fmt: skip
        hessian = np.zeros((size + 2, size + 2))
        hessian[:size, :size] = region**2 * curvature
        hessian[size, size] = hessian[size + 1, size + 1] = 1e-10
        slope = np.concatenate([np.zeros(size), [1.0, penalty]])
        found = quadratic.solve(hessian, slope, matrix, bounds)
        if not found.solved:
            return None
        step = np.clip(region * found.point[:size], least, most)
        weights, margins = np.zeros(count), np.zeros(self.margins.size)
        weights[high] = found.multipliers[: len(lead)]
        margins[near] = found.multipliers[len(lead) : len(lead) + len(rows)]
        weights = np.maximum(weights, 0) / max(float(np.sum(np.maximum(weights, 0))), 1e-300)
        after = float(np.max(self.objectives + self.objective_rows @ step))
        missing = float(np.max(-(self.margins + self.margin_rows @ step), initial=0.0))
        merit = after + 0.5 * step @ curvature @ step + penalty * missing
        return step, Multipliers(weights, np.maximum(margins, 0.0)), merit


def _unlike(rows, others):
    """Which rows have another slope there."""
    norm = np.linalg.norm
    return norm(rows - others, axis=1) > _UNLIKE * (norm(rows, axis=1) + norm(others, axis=1))


def _bfgs(curvature, step: Vector, change: Vector):
    """Powell's damped update: B stays positive definite."""
    pressed = curvature @ step
    along = float(step @ pressed)
    if along <= 1e-300:
        return curvature
    inner = float(step @ change)
    if inner < 0.2 * along:
        share = 0.8 * along / (along - inner)
        change = share * change + (1 - share) * pressed
        inner = float(step @ change)
    return curvature - np.outer(pressed, pressed) / along + np.outer(change, change) / inner


class _Trail:
    """Worst case and violation over the last steps, to see that they hardly fall any more."""

    def __init__(self, tolerance: float):
        self._tolerance = tolerance
        self._steps: list[tuple[float, float]] = []

    def add(self, at: Evaluation, penalty: float) -> bool:
        """True where the last steps together lowered the merit by less than the tolerance."""
        self._steps.append((at.worst, at.violation))
        if len(self._steps) <= _PATIENCE:
            return False
        worst, violation = self._steps[-_PATIENCE - 1]
        gain = worst - at.worst + penalty * (violation - at.violation)
        return gain < self._tolerance * max(1.0, abs(at.worst))


@dataclasses.dataclass
class Sequence:
    """The state of a run: where it is, B, the penalty nu, the radius, how it goes on."""

    logits: bool
    tolerance: float
    feasibility: float
    penalty: float
    radius: float = 0.0

    def run(
        self, evaluate: Evaluate, at: Evaluation, held: Multipliers, latest: list[Multipliers]
    ) -> tuple[Evaluation, Multipliers, str]:
        """Step until the conditions of Karush, Kuhn and Tucker hold within the tolerance.

        Gives the last point, its multipliers and the outcome: `"optimal"`, `"spent"` where the
        budget is, `"stalled"` where no step is lower, `"infeasible"` where the limits' violation
        cannot be lowered. `latest` holds the multipliers at hand.
        """
        chart = _Chart(self.logits)
        limit = 0.5 if self.logits else 1e3
        self.radius = 0.2 if self.logits else 0.3 * max(1.0, float(np.linalg.norm(at.point)))
        curvature, fresh = np.eye(at.point.size), True
        model = _Model.of(at, chart)
        small, barren, trail = 0, 0, _Trail(self.tolerance)
        seen = [model]
        while True:
            whole = model.with_branches(seen, min(2 * self.radius, _NEAR))
            solved = whole.step(curvature, self.penalty, chart.span(model.at, self.radius))
            if solved is None:
                if fresh:
                    return at, held, "stalled"
                curvature, fresh = np.eye(at.point.size), True
                continue
            step, new, _ = solved
            new = whole.gathered(new)
            if self._too_weak(model, step, new):
                continue
            held = latest[0] = new
            if self._optimal(at, held):
                return at, held, "optimal"
            merit = self._merit(at)
            gain = merit - solved[2]
            if gain <= 1e-14 * max(1.0, abs(merit)) or np.max(np.abs(step)) < _SMALLEST:
                if whole.count > model.count and self.radius > _SMALLEST:
                    # Branches remembered from afar forbid what those nearby may allow.
                    self.radius *= 0.3
                    continue
                stuck = at.violation > self.feasibility and self.penalty >= 1e5
                return at, held, "infeasible" if stuck else "stalled"
            trial = evaluate(chart.point(model.at + step))
            if trial is None:
                return at, held, "spent"
            if trial.failed:
                self.radius = 0.3 * float(np.max(np.abs(step)))
                continue
            if merit - self._merit(trial) < 0.1 * gain:
                better = None
                if whole.count == model.count:
                    better = self._corrected(evaluate, chart, model, trial, step, curvature)
                if better is not None and self._merit(better) < self._merit(trial):
                    trial = better
            after = _Model.of(trial, chart)
            seen = [*seen[1 - _MANY :], after]
            kink = after.bent_from(model, held)
            step = after.at - model.at
            change = after.slope(held) - model.slope(held)
            if fresh and float(step @ change) > 0:
                curvature = np.eye(step.size) * float(change @ change) / float(step @ change)
            curvature, fresh = _bfgs(curvature, step, change), False
            reached = merit - self._merit(trial)
            length = float(np.max(np.abs(step)))
            if reached > 0.75 * gain and length > 0.8 * self.radius:
                self.radius = min(2.0 * self.radius, limit)
            elif reached < 0.1 * gain:
                # A step over a kink taught the other branch: the next one knows it.
                self.radius = (0.8 if kink else 0.4) * min(length, self.radius)
            if reached > 1e-4 * gain:
                at, model = trial, after
                small = small + 1 if reached < 1e-2 * self.tolerance * max(1.0, merit) else 0
                barren = 0
            else:
                barren += 1
            idle = trail.add(at, self.penalty)
            if self.radius < _SMALLEST or small >= 4 or barren >= _BARREN or idle:
                return at, held, "stalled"

    def _merit(self, at: Evaluation) -> float:
        return at.worst + self.penalty * at.violation if not at.failed else np.inf

    def _too_weak(self, model: _Model, step: Vector, held: Multipliers) -> bool:
        """Raise the penalty where it does not outweigh the multipliers; true where the step has to
        be made again with the higher one."""
        needed = 1.5 * float(np.sum(held.margins))
        left = float(np.max(-(model.margins + model.margin_rows @ step), initial=0.0))
        now = float(np.max(-model.margins, initial=0.0))
        at_cap = float(np.sum(held.margins)) >= 0.99 * self.penalty and left > self.feasibility
        # A step cut off by the region's bound may leave a violation to the next one.
        cut_off = np.max(np.abs(step)) >= 0.99 * self.radius and left < 0.9 * now
        if at_cap and not cut_off and self.penalty < 1e5:
            self.penalty *= 10
            return True
        self.penalty = min(max(self.penalty, needed), 1e6)
        return False

    def _optimal(self, at: Evaluation, held: Multipliers) -> bool:
        left: Residual = residual(at, held, self.logits)
        return max(left[:2]) <= self.tolerance and left.violation <= self.feasibility

    def _corrected(
        self, evaluate, chart, model: _Model, trial: Evaluation, step, curvature
    ) -> Evaluation | None:
        """The step with the curvature of F and g, as the trial showed it, taken in."""
        bent = dataclasses.replace(
            model,
            objectives=trial.objectives - model.objective_rows @ step,
            margins=trial.margins - model.margin_rows @ step,
        )
        solved = bent.step(curvature, self.penalty, chart.span(model.at, self.radius))
        if solved is None or np.max(np.abs(solved[0] - step)) < 1e-3 * np.max(np.abs(step)):
            return None
        found = evaluate(chart.point(model.at + solved[0]))
        return None if found is None or found.failed else found
