"""The problem linearised at a point, and the step that follows from it.

With the linear parts of the worst case and the limits and a curvature B, the step d solves a small
quadratic program,

    min over d, t, e of   t + 1/2 d^T B d + nu e
    with                  F_i + J_i d <= t,   g_j + G_j d >= -e,   e >= 0,   |d| <= radius,

whose multipliers are those of the problem. The slack e keeps it solvable where the limits
contradict each other.
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
# Slopes that differ by more than the share _UNLIKE of their lengths may be of two branches; they
# are where the change of the value deviates from that of the mean slope by more than the share
# _KINKED of the slopes' difference.
_UNLIKE = 0.1
_KINKED = 0.1
# How far a step may go towards the plane in front of the walls, as a share of the way.
_CLOSE = 0.5


def span(at: Vector, radius: float, bounded: bool) -> tuple[Vector, Vector]:
    """The least and the largest step within a radius and, where `bounded`, within [0, 1]."""
    least, most = np.full(at.size, -radius), np.full(at.size, radius)
    if bounded:
        least, most = np.maximum(least, -at), np.minimum(most, 1 - at)
    return least, most


@dataclasses.dataclass
class LocalModel:
    """The problem linearised at a point: values and slopes of F and g.

    `lanes` and `places` give the objective and the margin that each row belongs to; one may have
    several rows. `distances` and `limit_distances` give the distance to the point at which a row
    was evaluated.
    """

    at: Vector
    objectives: Vector
    margins: Vector
    objective_rows: np.ndarray
    margin_rows: np.ndarray
    lanes: NDArray[np.intp]
    places: NDArray[np.intp]
    distances: Vector
    limit_distances: Vector

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

    def slope(self, multipliers: Multipliers) -> Vector:
        """The gradient of the Lagrangian."""
        weights, margins = multipliers
        return self.objective_rows.T @ weights - self.margin_rows.T @ margins

    def with_branches(self, others: "list[LocalModel]", reach: float) -> "LocalModel":
        """The same with the rows of other branches.

        A peak force is the largest of several blows, and which of them is the largest changes at a
        kink. The linearisation of an objective or margin at another point x' within `reach`,
        F' + J' (x - x'), becomes a further row where it is of another branch, at most the value F
        here. Of several points on one branch the nearest counts.
        """
        whole = self
        away = [float(np.max(np.abs(self.at - other.at))) for other in others]
        for index in np.argsort(away, kind="stable"):
            if others[index] is not self and away[index] <= reach:
                whole = whole._with(self, others[index], away[index])
        return whole

    def _with(self, here: "LocalModel", other: "LocalModel", away: float) -> "LocalModel":
        """The same with the rows of one more point that are of new branches."""
        step = here.at - other.at
        forces, limits = here._kinks_to(other)
        lanes = _missing(forces, self.lanes, self.objective_rows, other.objective_rows)
        places = _missing(limits, self.places, self.margin_rows, other.margin_rows)
        values = np.minimum(other.objectives + other.objective_rows @ step, here.objectives)
        margins = np.maximum(other.margins + other.margin_rows @ step, here.margins)
        return LocalModel(
            self.at,
            np.append(self.objectives, values[lanes]),
            np.append(self.margins, margins[places]),
            np.vstack([self.objective_rows, other.objective_rows[lanes]]),
            np.vstack([self.margin_rows, other.margin_rows[places]]),
            np.append(self.lanes, lanes),
            np.append(self.places, places),
            np.append(self.distances, np.full(lanes.size, away)),
            np.append(self.limit_distances, np.full(places.size, away)),
        )

    def _kinks_to(self, other: "LocalModel") -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which objectives and which margins have a kink between here and there."""
        step = self.at - other.at
        return (
            _kinked(self.objectives - other.objectives, self.objective_rows, other.objective_rows,
                    step),
            _kinked(self.margins - other.margins, self.margin_rows, other.margin_rows, step),
        )  # fmt: skip

    def linear_errors(self, other: "LocalModel") -> tuple[Vector, Vector]:
        """The errors of this linearisation in the objectives and margins of another point."""
        step = other.at - self.at
        return (
            other.objectives - self.objectives - self.objective_rows @ step,
            other.margins - self.margins - self.margin_rows @ step,
        )

    def shifted(self, objectives: Vector, margins: Vector) -> "LocalModel":
        """The same with the values of every objective and margin shifted, in all of their rows."""
        return dataclasses.replace(
            self,
            objectives=self.objectives + objectives[self.lanes],
            margins=self.margins + margins[self.places],
        )

    def smooth_to(self, other: "LocalModel", multipliers: Multipliers) -> bool:
        """Whether no row with a multiplier that counts has a kink between here and there."""
        forces, limits = self._kinks_to(other)
        weights, margins = multipliers
        return not (np.any(forces[weights > _COUNTS]) or np.any(limits[margins > _COUNTS]))

    def farthest(self, rows: Multipliers) -> float:
        """The distance of the farthest point whose row has a multiplier that counts."""
        return float(max(
            np.max(self.distances[rows.weights > _COUNTS], initial=0.0),
            np.max(self.limit_distances[rows.margins > _COUNTS], initial=0.0),
        ))  # fmt: skip

    def balanced(self, bounded: bool, within: float) -> Multipliers:
        """The multipliers of the rows that make the Lagrangian's gradient smallest: of objectives
        at most `within` below the worst one, and of limits at most `within` from their bounds.

        With rows of points nearby, the slopes are those on both sides of a kink. A kink is an
        optimum where a convex combination of them vanishes (Goldstein 1977).
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
        """The residual of the conditions of Karush, Kuhn and Tucker with the rows' slopes."""
        slope = self.slope(rows)
        step = np.clip(self.at - slope, 0, 1) - self.at if bounded else slope
        left = complementarity(self.objectives, self.margins, rows)
        return Residual(float(np.max(np.abs(step))), left, violation)

    @property
    def widest(self) -> float:
        """The distance of the farthest point at which a row was evaluated."""
        return float(max(np.max(self.distances), np.max(self.limit_distances, initial=0.0)))

    def after(self, step, curvature, nu: float) -> float:
        """The merit that the model predicts after a step."""
        top = float(np.max(self.objectives + self.objective_rows @ step))
        return top + 0.5 * step @ curvature @ step + nu * self.violation(step)

    def violation(self, step: Vector) -> float:
        """The largest violation that the model predicts after a step."""
        return float(np.max(-(self.margins + self.margin_rows @ step), initial=0.0))

    def gathered(self, multipliers: Multipliers) -> Multipliers:
        """The multipliers of the rows summed up for each objective and each margin."""
        return Multipliers(
            np.bincount(self.lanes, multipliers.weights).astype(float),
            np.bincount(self.places, multipliers.margins).astype(float),
        )

    def step(
        self, curvature, penalty: float, span, walls: list[Vector]
    ) -> tuple[Vector, Multipliers] | None:
        """The step and the multipliers of the rows; `None` where the program is not solved.

        `walls` are steps to points that could not be evaluated: the step goes at most half the
        way to the plane in front of them (`before`).
        """
        least, most = span
        size, count = self.at.size, self.objectives.size
        top = float(np.max(self.objectives))
        reach = np.maximum(-least, most)
        # Limits and objectives that no step within the region can reach are left out.
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
    """The foot p of the farthest plane p . d = |p|^2 that has all walls w on its far side; `None`
    without walls.

    p = a / |a|^2 with the least |a| for which a . w >= 1: a support vector machine (Boser, Guyon
    and Vapnik 1992). Where the walls lie all around, as few as possible are left out, the farthest
    first.
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
    """Which rows have a different slope at the other point."""
    norm = np.linalg.norm
    return norm(rows - others, axis=-1) > _UNLIKE * (norm(rows, axis=-1) + norm(others, axis=-1))


def _kinked(change, rows, others, step):
    """Which rows are of another branch at the other point. Along a smooth curve the change of the
    value follows from the mean of the slopes at both ends; across a kink it does not."""
    bend = np.abs((rows - others) @ step)
    off = np.abs(change - 0.5 * (rows + others) @ step)
    return _unlike(rows, others) & (off > _KINKED * bend)


def _missing(bent, known, rows, others) -> NDArray[np.intp]:
    """Which objectives or margins have a branch at the other point that no known row has."""
    return np.array(
        [i for i in np.flatnonzero(bent) if np.all(_unlike(rows[known == i], others[i]))],
        dtype=np.intp,
    )
