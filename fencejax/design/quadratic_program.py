"""Convex quadratic programs of a few dozen unknowns, by an interior-point method."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
_ITERATIONS = 60


class Solution(NamedTuple):
    """The minimiser x (n,), the multipliers of the constraints (m,), and whether it converged."""

    point: Matrix
    multipliers: Matrix
    solved: bool


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def solve(hessian: Matrix, slope: Matrix, rows: Matrix, least: Matrix) -> Solution:
    """min 1/2 x^T H x + c^T x, subject to A x >= b.

    Mehrotra's predictor-corrector method (1992) on dense matrices; H is positive semidefinite, and
    positive definite where no constraint is active.

    **Arguments:** `hessian` H (n, n), `slope` c (n,), `rows` A (m, n), `least` b (m,).
    """
    from scipy import linalg

    lengths = np.maximum(np.linalg.norm(rows, axis=1), 1e-300)
    rows, least = rows / lengths[:, None], least / lengths
    weight = max(float(np.max(np.abs(slope))), float(np.max(np.abs(hessian))), 1e-300)
    hessian, slope = hessian / weight, slope / weight
    size, count = slope.size, max(least.size, 1)
    point, slack, multipliers = np.zeros(size), np.ones(least.size), np.ones(least.size)
    best, lowest = (point, multipliers), np.inf
    near = 1 + float(np.max(np.abs(least), initial=0))
    for iteration in range(_ITERATIONS):
        dual = hessian @ point + slope - rows.T @ multipliers
        primal = rows @ point - slack - least
        gap = float(slack @ multipliers) / count
        off = max(
            float(np.max(np.abs(dual))), float(np.max(np.abs(primal), initial=0)) / near, gap
        )
        if off < lowest and iteration:
            best, lowest = (point, multipliers), off
        if off <= 1e-12:
            break
        matrix = hessian + rows.T @ (rows * (multipliers / slack)[:, None])
        matrix[np.diag_indices(size)] *= 1 + 1e-15
        # With contradicting constraints the multipliers diverge.
        try:
            factor = linalg.cho_factor(matrix)
        except (np.linalg.LinAlgError, ValueError):
            break

        at = (factor, rows, dual, primal, slack, multipliers)
        _, slide, change = _step(slack * multipliers, *at)
        if iteration == 0:
            # Nocedal and Wright (2006), section 16.6: both well inside.
            slack = np.maximum(1e-3, np.abs(slack + slide))
            multipliers = np.maximum(1e-3, np.abs(multipliers + change))
            continue
        far = min(_furthest(slack, slide), _furthest(multipliers, change), 1.0)
        ahead = (slack + far * slide) @ (multipliers + far * change) / count
        aim = gap * (ahead / gap) ** 3
        move, slide, change = _step(slack * multipliers + slide * change - aim, *at)
        if not np.all(np.isfinite(move)):
            break
        far = min(0.99 * min(_furthest(slack, slide), _furthest(multipliers, change)), 1.0)
        point = point + far * move
        slack = np.maximum(slack + far * slide, 1e-300)
        multipliers = np.maximum(multipliers + far * change, 1e-300)
    point, multipliers = best
    return Solution(point, multipliers * weight / lengths, lowest <= 1e-7)


def _step(complement: Matrix, factor, rows, dual, primal, slack, multipliers):
    """Newton's step of the point, the slacks and the multipliers; `complement` is the residual of
    slack times multiplier."""
    from scipy import linalg

    right = -dual - rows.T @ ((complement + multipliers * primal) / slack)
    move = linalg.cho_solve(factor, right, check_finite=False)
    slide = rows @ move + primal
    return move, slide, -(complement + multipliers * slide) / slack


def _furthest(values: Matrix, change: Matrix) -> float:
    """The largest share of a change before a value falls to 0; at most 1 / 0.99."""
    falling = change < 0
    share = np.min(-values[falling] / change[falling], initial=1 / 0.99)
    return float(share)
