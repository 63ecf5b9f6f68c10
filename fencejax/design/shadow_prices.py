"""What each limit and each bound costs: the multipliers of a design that ends on them."""

from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from .lagrangian import Evaluation, Multipliers, Vector, slope
from .optimizer import Optimum

# A share this near to 0 or 1 is on its bound; margins this near to the most violated one are among
# the most violated.
_ON_BOUND, _AMONG = 1e-3, 1e-2


class ShadowPrices(NamedTuple):
    """Rates at which what is minimised falls as limits and bounds give way.

    **Fields:**

    - `margins`: of each margin (m,): by how much it falls for each unit by which that margin may be
      smaller.
    - `lower`, `upper`: of the lower and upper bounds of the shares z (n,), by which they may be
      passed.
    """

    margins: Vector
    lower: Vector
    upper: Vector


def shadow_prices(optimum: Optimum) -> ShadowPrices:
    """The prices at an optimum, in the objective's own unit: its multipliers, and the Lagrangian's
    slope at the bounds that hold it up."""
    at = optimum.last
    gradient = slope(at, Multipliers(optimum.weights, optimum.multipliers))
    lower = np.where(at.point <= _ON_BOUND, np.maximum(gradient, 0.0), 0.0)
    upper = np.where(at.point >= 1 - _ON_BOUND, np.maximum(-gradient, 0.0), 0.0)
    return ShadowPrices(*(optimum.scale * part for part in (optimum.multipliers, lower, upper)))


def conflict(at: Evaluation) -> ShadowPrices:
    """The prices of the largest violation at a point where it cannot be lowered, so that they say
    which limits fight: min over z of max_j(-g_j) has multipliers w >= 0 with sum 1 among the most
    violated margins, and b >= 0 of the bounds of z, for which

        sum_j w_j dg_j/dz + b_lower - b_upper = 0.

    They are found by non-negative least squares; at a point that is not quite the least-violating
    one this leaves a residual, and they are the nearest there are.
    """
    size, worst = at.point.size, float(np.max(-at.margins, initial=0.0))
    among = np.flatnonzero(-at.margins >= worst - _AMONG * max(worst, _AMONG))
    rows = at.margin_rows[among]
    low = np.flatnonzero(at.point <= _ON_BOUND)
    high = np.flatnonzero(at.point >= 1 - _ON_BOUND)
    units = np.eye(size)
    columns = np.concatenate([rows, units[low], -units[high]]).T
    # The sum of w is 1: one more equation, with a weight that leaves it exact.
    total = np.concatenate([np.ones(among.size), np.zeros(low.size + high.size)])
    heavy = 1e4 * max(1.0, float(np.max(np.abs(columns), initial=0.0)))
    found, _ = nnls(
        np.concatenate([columns, heavy * total[None]]), np.append(np.zeros(size), heavy)
    )
    margins, lower, upper = np.zeros(at.margins.size), np.zeros(size), np.zeros(size)
    margins[among] = found[: among.size]
    lower[low] = found[among.size : among.size + low.size]
    upper[high] = found[among.size + low.size :]
    return ShadowPrices(margins, lower, upper)
