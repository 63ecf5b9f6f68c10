"""Shadow prices of limits and bounds: the multipliers at a design that ends on them."""

from typing import NamedTuple

import numpy as np

from .lagrangian import Evaluation, Multipliers, Vector, slope

# A share this near to 0 or 1 is on its bound; the largest step in the linear program of a conflict.
_ON_BOUND, _STEP = 1e-3, 0.05
NEGLIGIBLE = 1e-3
"""Prices below this share of the largest one are ignored."""


class ShadowPrices(NamedTuple):
    """Rates at which the objective falls as limits and bounds are relaxed.

    **Fields:**

    - `margins`: of each margin (m,): the decrease of the objective for each unit by which that
      margin may be smaller.
    - `lower`, `upper`: of the lower and upper bounds of the shares z (n,): the decrease for each
      unit by which a share may exceed its bound.
    """

    margins: Vector
    lower: Vector
    upper: Vector


def prices(at: Evaluation, multipliers: Multipliers, scale: float) -> ShadowPrices:
    """The prices at a point with its multipliers, times `scale`: the multipliers, and the
    Lagrangian's slope at the active bounds."""
    gradient = slope(at, multipliers)
    lower = np.where(at.point <= _ON_BOUND, np.maximum(gradient, 0.0), 0.0)
    upper = np.where(at.point >= 1 - _ON_BOUND, np.maximum(-gradient, 0.0), 0.0)
    # A margin that no variable changes has no price, whatever its multiplier.
    margins = np.where(np.any(at.margin_rows != 0, axis=1), multipliers.margins, 0.0)
    return ShadowPrices(*(scale * part for part in (margins, lower, upper)))


def conflict(at: Evaluation) -> ShadowPrices:
    """The prices of the largest violation at a point where it cannot be lowered; they show which
    limits are in conflict. They are the multipliers, with the sum 1 over the margins, of

        min t over steps d and t, subject to -g_j - (dg_j/dz) d <= t, 0 <= z + d <= 1

    with every component of d at most a twentieth of the range, so that margins nearly as violated
    as the worst one count, too.
    """
    size, count = at.point.size, at.margins.size
    low, high = np.maximum(-at.point, -_STEP), np.minimum(1 - at.point, _STEP)
    from scipy.optimize import linprog

    solved = linprog(
        np.append(np.zeros(size), 1.0),
        np.column_stack([-at.margin_rows, -np.ones(count)]),
        at.margins,
        bounds=[*zip(low, high, strict=True), (None, None)],
    )
    if solved.status != 0:
        return ShadowPrices(np.zeros(count), np.zeros(size), np.zeros(size))
    lower, upper = solved.lower.marginals[:size], -solved.upper.marginals[:size]
    return ShadowPrices(
        -solved.ineqlin.marginals,
        np.where(at.point < _STEP, lower, 0.0),
        np.where(at.point > 1 - _STEP, upper, 0.0),
    )
