"""A problem as seen from a point: linear parts of the worst case and the limits, and their step.

With a curvature B, what they leave is a small quadratic program for the step d,

    min over d, t, e of   t + 1/2 d^T B d + nu e
    with                  F_i + J_i d <= t,   g_j + G_j d >= -e,   e >= 0,   |d| <= radius,

whose multipliers are those of the problem. e keeps it solvable where the limits contradict each
other.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from . import quadratic_program as quadratic
from .lagrangian import Evaluation, Multipliers, Residual, Vector, complementarity

# A share nearer to a bound than this is on it.
_EDGE = 1e-6
# Multipliers below it do not count.
_COUNTS = 1e-3
# Slopes that differ by more than this of their lengths may be of two branches; they are where the
# change of the value is off their mean's by more than this of the slopes' difference.
_UNLIKE = 0.1
_ROUGH = 0.1
# Of the way to the plane before the points that could not be evaluated, what a step may go.
_CLOSE = 0.5


def span(at: Vector, radius: float, bounded: bool) -> tuple[Vector, Vector]:
    """The least and the largest step within a radius, and within [0, 1] where that bounds."""
    least, most = np.full(at.size, -radius), np.full(at.size, radius)
    if bounded:
        least, most = np.maximum(least, -at), np.minimum(most, 1 - at)
    return least, most


@dataclasses.dataclass
class LocalModel:
    """The problem as seen from a point: values and slopes of F and g.

    `lanes` and `places` say which objective and which margin a row is of; one may have several.
    `far` and `limits_far` say how far away the point is that told a row.
    """

    at: Vector
    objectives: Vector
    margins: Vector
    objective_rows: np.ndarray
    margin_rows: np.ndarray
    lanes: NDArray[np.intp]
    places: NDArray[np.intp]
    far: Vector
    limits_far: Vector

    @classmethod
    def of(cls, evaluation: Evaluation) -> "LocalModel":
        return cls(
            evaluation.point,
            evaluation.objectives,
            evaluation.margins,
            evaluation.objective_rows,
            evaluation.margin_rows,
            np.arange(evaluation.objectives.size),
            np.arange(evaluation.margins.size),
            np.zeros(evaluation.objectives.size),
            np.zeros(evaluation.margins.size),
        )

    def slope(self, held: Multipliers) -> Vector:
        """The gradient of the Lagrangian."""
        return self.objective_rows.T @ held.weights - self.margin_rows.T @ held.margins

    def with_branches(self, others: "list[LocalModel]", reach: float) -> "LocalModel":
        """The same with the rows of other branches.

        A peak force is the largest of several blows, and which of them it is changes at a kink.
        What a point within `reach` said of an objective or margin is a further row of it where it
        is of another branch, F' + J' (x - x'), cut off at what F is here. Of the points on one
        branch the nearest counts.
        """
        whole = self
        away = [float(np.max(np.abs(self.at - other.at))) for other in others]
        for index in np.argsort(away, kind="stable"):
            if others[index] is not self and away[index] <= reach:
                whole = whole._with(self, others[index], away[index])
        return whole

    def _with(self, here: "LocalModel", other: "LocalModel", away: float) -> "LocalModel":
        """With the rows of one more point, of branches that no row is of so far."""
        step = here.at - other.at
        forces, limits = here._bent(other)
        lanes = _missing(forces, self.lanes, self.objective_rows, other.objective_rows)
        places = _missing(limits, self.places, self.margin_rows, other.margin_rows)
        told = np.minimum(other.objectives + other.objective_rows @ step, here.objectives)
        left = np.maximum(other.margins + other.margin_rows @ step, here.margins)
        return LocalModel(
            self.at,
            np.append(self.objectives, told[lanes]),
            np.append(self.margins, left[places]),
            np.vstack([self.objective_rows, other.objective_rows[lanes]]),
            np.vstack([self.margin_rows, other.margin_rows[places]]),
            np.append(self.lanes, lanes),
            np.append(self.places, places),
            np.append(self.far, np.full(lanes.size, away)),
            np.append(self.limits_far, np.full(places.size, away)),
        )

    def _bent(self, other: "LocalModel") -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which objectives and which margins have a kink between here and there."""
        step = self.at - other.at
        return (
            _kinked(self.objectives - other.objectives, self.objective_rows, other.objective_rows,
                    step),
            _kinked(self.margins - other.margins, self.margin_rows, other.margin_rows, step),
        )  # fmt: skip

    def bend_to(self, other: "LocalModel") -> tuple[Vector, Vector]:
        """By how much the objectives and the margins there are off these straight lines."""
        step = other.at - self.at
        return (
            other.objectives - self.objectives - self.objective_rows @ step,
            other.margins - self.margins - self.margin_rows @ step,
        )

    def bent_by(self, objectives: Vector, margins: Vector) -> "LocalModel":
        """The same with the values of every objective and margin shifted, in all of their rows."""
        return dataclasses.replace(
            self,
            objectives=self.objectives + objectives[self.lanes],
            margins=self.margins + margins[self.places],
        )

    def smooth_to(self, other: "LocalModel", held: Multipliers) -> bool:
        """Whether what counts in the Lagrangian has no kink between here and there."""
        forces, limits = self._bent(other)
        return not (
            np.any(forces[held.weights > _COUNTS]) or np.any(limits[held.margins > _COUNTS])
        )

    def farthest(self, rows: Multipliers) -> float:
        """How far away the farthest point is whose row counts."""
        return float(max(
            np.max(self.far[rows.weights > _COUNTS], initial=0.0),
            np.max(self.limits_far[rows.margins > _COUNTS], initial=0.0),
        ))  # fmt: skip

    def balanced(self, bounded: bool, within: float) -> Multipliers:
        """Multipliers of the rows whose slopes come nearest to balance, of the objectives that are
        `within` so much of the worst and the limits that are so near their bounds.

        Where rows of points nearby are among them, their slopes are those of both sides of a kink,
        and a combination of them that vanishes is what makes a kink an optimum (Goldstein 1977).
        """
        high = self.objectives >= np.max(self.objectives) - within
        low = self.margins <= within
        from scipy import optimize

        lead, limits = self.objective_rows[high], self.margin_rows[low]
        unit = np.eye(self.at.size)
        least, most = self.at <= _EDGE, self.at >= 1 - _EDGE
        bounds = np.vstack([unit[least], -unit[most]]) if bounded else unit[:0]
        others = np.vstack([limits, bounds])
        # The weights' sum is 1, as one more equation that outweighs the others.
        heavy = 1e3 * max(1.0, float(np.max(np.abs(lead))))
        matrix = np.block([
            [lead.T, -others.T],
            [np.full(len(lead), heavy), np.zeros(len(others))],
        ])  # fmt: skip
        found, _ = optimize.nnls(
            matrix, np.append(np.zeros(self.at.size), heavy), maxiter=100 * matrix.shape[1]
        )
        weights, margins = np.zeros(self.lanes.size), np.zeros(self.places.size)
        weights[high] = found[: len(lead)] / max(float(np.sum(found[: len(lead)])), 1e-300)
        margins[low] = found[len(lead) : len(lead) + len(limits)]
        return Multipliers(weights, margins)

    def residual(self, rows: Multipliers, violation: float, bounded: bool) -> Residual:
        """What is left of the conditions of Karush, Kuhn and Tucker with the rows' slopes."""
        slope = self.slope(rows)
        step = np.clip(self.at - slope, 0, 1) - self.at if bounded else slope
        left = complementarity(self.objectives, self.margins, rows)
        return Residual(float(np.max(np.abs(step))), left, violation)

    @property
    def widest(self) -> float:
        """How far away the farthest point is that told a row."""
        return float(max(np.max(self.far), np.max(self.limits_far, initial=0.0)))

    def after(self, step, curvature, nu: float) -> float:
        """The merit that the model expects of a step."""
        top = float(np.max(self.objectives + self.objective_rows @ step))
        return top + 0.5 * step @ curvature @ step + nu * self.violation(step)

    def violation(self, step: Vector) -> float:
        """The largest violation that the model expects of a step."""
        return float(np.max(-(self.margins + self.margin_rows @ step), initial=0.0))

    def gathered(self, held: Multipliers) -> Multipliers:
        """The multipliers of rows as those of objectives and margins."""
        return Multipliers(
            np.bincount(self.lanes, held.weights).astype(float),
            np.bincount(self.places, held.margins).astype(float),
        )

    def step(
        self, curvature, penalty: float, span, walls: list[Vector]
    ) -> tuple[Vector, Multipliers] | None:
        """The step and the multipliers of the rows; `None` where the program is not solved.

        `walls` are steps to points that could not be evaluated: no more than half the way to
        the plane before them is gone (`before`).
        """
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
        # Steps and values in units of the region, so that its size does not matter to the program.
        region = max(float(np.max(reach)), 1e-300)

        def widened(block, by_top, by_slack):
            ones = np.ones((len(block), 1))
            return np.hstack([block, by_top * ones, by_slack * ones])

        plane = before(walls)
        foot = np.zeros((0, size)) if plane is None else plane[None]
        away = np.linalg.norm(foot, axis=1)
        matrix = np.vstack([
            widened(-lead, 1.0, 0.0),
            widened(rows, 0.0, 1.0),
            widened(np.zeros((1, size)), 0.0, 1.0),
            widened(unit, 0.0, 0.0),
            widened(-unit, 0.0, 0.0),
            widened(-foot / away[:, None], 0.0, 0.0),
        ])  # fmt: skip
        bounds = np.concatenate([
            self.objectives[high] - top, -low, [0.0], least, -most,
            -_CLOSE * away,
        ]) / region  # fmt: skip
        hessian = np.zeros((size + 2, size + 2))
        hessian[:size, :size] = region * curvature
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
        return step, Multipliers(weights, np.maximum(margins, 0.0))


def before(walls: list[Vector]) -> Vector | None:
    """The foot p of the plane p . d = |p|^2 that has all walls w on its far side, as far from 0 as
    there is one; `None` without walls.

    p = a / |a|^2 with the least |a| for which a . w >= 1: a support vector machine (Boser, Guyon
    and Vapnik 1992). Where the walls lie all around, the farthest are left out, and no more of them
    than need be.
    """
    if not walls:
        return None
    rows = np.array(sorted(walls, key=lambda wall: float(np.linalg.norm(wall))))
    unit = float(np.linalg.norm(rows[0]))
    rows = rows / unit
    foot, fewest, most = rows[0], 1, len(rows)
    count = most
    while fewest < most:
        nearest = rows[:count]
        found = quadratic.solve(
            np.eye(rows.shape[1]), np.zeros(rows.shape[1]), nearest, np.ones(count)
        )
        if found.solved and np.min(nearest @ found.point) > 0.99:
            foot, fewest = found.point / (found.point @ found.point), count
        else:
            most = count - 1
        count = (fewest + most + 1) // 2
    return unit * foot


def _unlike(rows, others):
    """Which rows have another slope there."""
    norm = np.linalg.norm
    return norm(rows - others, axis=-1) > _UNLIKE * (norm(rows, axis=-1) + norm(others, axis=-1))


def _kinked(change, rows, others, step):
    """Which rows are of another branch there: over a smooth curve the mean of the slopes at its
    ends gives the change, over a kink it does not."""
    bend = np.abs((rows - others) @ step)
    off = np.abs(change - 0.5 * (rows + others) @ step)
    return _unlike(rows, others) & (off > _ROUGH * bend)


def _missing(bent, known, rows, others) -> NDArray[np.intp]:
    """Which objectives or margins have a branch there that is not among the known rows."""
    return np.array(
        [i for i in np.flatnonzero(bent) if np.all(_unlike(rows[known == i], others[i]))],
        dtype=np.intp,
    )
