"""The augmented Lagrangian of a worst case under limits: algebra on one evaluation's Jacobian."""

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Evaluation:
    """Objectives F (k,) and margins g (m,) at a point z (n,), with their Jacobians.

    `objectives` and their Jacobian are already divided by the objective's scale. `status` is the
    largest one of the lanes, or of a failed evaluation the largest that is not numerical. The
    numbers of a `failed` evaluation must not be used as a design; where it is `doubtful`, too, they
    still show how values and slopes change towards the point. `rungs`: the rung of each lane's
    numbers, where the problem has a ladder of fidelities.
    """

    point: Vector
    objectives: Vector
    margins: Vector
    objective_rows: NDArray[np.float64]
    margin_rows: NDArray[np.float64]
    status: int
    failed: bool
    doubtful: bool = False
    rungs: NDArray[np.int64] | None = None

    @property
    def worst(self) -> float:
        """max_i F_i."""
        return float(np.max(self.objectives))

    @property
    def violation(self) -> float:
        """max_j max(0, -g_j); infinite where the evaluation failed."""
        if self.failed:
            return np.inf
        return float(np.max(-self.margins, initial=0.0))


class Multipliers(NamedTuple):
    """Weights w of the objectives (at least 0, sum 1) and multipliers mu of the margins (>= 0)."""

    weights: Vector
    margins: Vector


class Residual(NamedTuple):
    """First-order optimality of a point and multipliers; all three vanish at an optimum."""

    stationarity: float
    complementarity: float
    violation: float


def onto_simplex(point: Vector) -> Vector:
    """The nearest point with no negative entry and the sum 1."""
    ordered = np.sort(point)[::-1]
    excess = (np.cumsum(ordered) - 1) / np.arange(1, point.size + 1)
    return np.maximum(point - excess[np.count_nonzero(ordered > excess) - 1], 0.0)


def updated(at: Evaluation, old: Multipliers, penalty: float) -> Multipliers:
    """First-order multipliers: w = P(w + rho F) on the simplex, mu = max(0, mu - rho g)."""
    return Multipliers(
        onto_simplex(old.weights + penalty * at.objectives),
        np.maximum(old.margins - penalty * at.margins, 0.0),
    )


def augmented(at: Evaluation, old: Multipliers, penalty: float) -> tuple[float, Vector]:
    """Value and gradient of the augmented Lagrangian of min_z max_i F_i(z), g(z) >= 0.

    The worst case is kept exact by its epigraph, min t with t >= F_i, whose multipliers are the
    weights w. The minimum over t is taken in closed form, which leaves

        max over the simplex of (v . F - |v - w|^2 / (2 rho))
            + sum_j (max(0, mu_j - rho g_j)^2 - mu_j^2) / (2 rho)

    (Powell, Hestenes, Rockafellar), with rho = `penalty`. The maximiser v and the
    max(0, mu - rho g) are the updated multipliers, and the gradient is J_F^T v - J_g^T mu_new.
    """
    new = updated(at, old, penalty)
    value = new.weights @ at.objectives - np.sum((new.weights - old.weights) ** 2) / (2 * penalty)
    value = value + (np.sum(new.margins**2) - np.sum(old.margins**2)) / (2 * penalty)
    return float(value), slope(at, new)


def slope(at: Evaluation, multipliers: Multipliers) -> Vector:
    """Gradient of the Lagrangian, J_F^T w - J_g^T mu."""
    return at.objective_rows.T @ multipliers.weights - at.margin_rows.T @ multipliers.margins


def shortfall(at: Evaluation) -> tuple[float, Vector]:
    """Half the sum of the squared violations, and its gradient."""
    missing = np.maximum(-at.margins, 0.0)
    return float(0.5 * missing @ missing), -at.margin_rows.T @ missing


def projected(point: Vector, gradient: Vector, bounded: bool) -> float:
    """Largest entry of the projected gradient.

    For shares s in [0, 1] (`bounded`) the step -dL/ds is clipped at the bounds: |P(s - dL/ds) - s|,
    which also vanishes at a bound towards which L decreases.
    """
    if not bounded:
        return float(np.max(np.abs(gradient)))
    return float(np.max(np.abs(np.clip(point - gradient, 0.0, 1.0) - point)))


def residual(at: Evaluation, multipliers: Multipliers, bounded: bool) -> Residual:
    """The residual of the conditions of Karush, Kuhn and Tucker at a point with multipliers."""
    stationarity = projected(at.point, slope(at, multipliers), bounded)
    return Residual(
        stationarity, complementarity(at.objectives, at.margins, multipliers), at.violation
    )


def complementarity(objectives: Vector, margins: Vector, multipliers: Multipliers) -> float:
    """The largest of the weighted distance of the objectives to the worst case and the products of
    multipliers and margins."""
    behind = multipliers.weights @ (np.max(objectives) - objectives)
    slack = np.abs(multipliers.margins * margins)
    return float(max(behind, np.max(slack, initial=0.0)))
