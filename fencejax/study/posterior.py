"""The posterior distribution of parameters with the model's curvature: Laplace's method."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..printing import Readable, Table
from .curvature import STEADY, unsteadiness


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Posterior(Readable):
    """The normal distribution with the posterior's curvature at its maximum (Laplace; Tierney and
    Kadane 1986). With a flat prior in u, the shares of the parameters' ranges, and the estimated
    noise,

    p(u | y) ~ exp(-(u - u_0)^T H (u - u_0) / (2 s^2)),   H = J^T J + sum_j r_j d^2 r_j / du^2,

    r_j the weighted residuals at the best u_0, J their Jacobian, s the misfit. The standard errors
    of `Fit` leave the sum out, as the Gauss-Newton method does: it is small where the residuals
    are noise alone.

    **Fields:**

    - `names`: the parameters'.
    - `standard_errors`: of ln p [1] where the scaling is logarithmic, and else of p [SI], (n,);
      infinite where H is not positive definite: the search did not end at a minimum.
    - `correlation` [1], (n, n).
    - `ratios`: the standard errors over `Fit.standard_errors` [1], (n,).
    - `unsteadiness`: the largest deviation of H, in units of its own diagonal, from differences of
      gradients over one standard error on both sides of u_0 [1]. Above some 0.3 the posterior is
      not normal, or the model has a kink within it, across which a second derivative is useless.
    """

    names: tuple[str, ...]
    standard_errors: np.ndarray
    correlation: np.ndarray
    ratios: np.ndarray
    unsteadiness: float

    @property
    def holds(self) -> bool:
        """Whether H is positive definite and holds over a standard error."""
        return bool(np.all(np.isfinite(self.standard_errors))) and self.unsteadiness <= STEADY

    def _printed(self) -> Table:
        rows = [
            (name, f"standard error {error:.3g}, {ratio:.3g} times that of straight lines")
            for name, error, ratio in zip(
                self.names, self.standard_errors, self.ratios, strict=True
            )
        ]
        rows += [("unsteadiness", f"{self.unsteadiness:.2g}")]
        return Table("Posterior", tuple(rows))


def laplace(
    problem: Any, shares: np.ndarray, weights: Mapping[str, float], misfit: float, plain: np.ndarray
) -> Posterior:
    """The posterior at the best `shares` of a `Problem`; `plain` are the standard errors [of ln p
    or p] without the residuals' curvature."""
    names = tuple(p.name for p in problem.parameters)
    hessian = problem.curvature(shares, weights)
    size = len(shares)
    lengths = np.sqrt(np.maximum(np.diag(hessian), 0.0))
    error, correlation, unsteady = np.full(size, np.inf), np.eye(size), np.inf
    scaled = hessian / np.maximum(np.outer(lengths, lengths), 1e-300)
    if np.all(lengths > 0) and np.min(np.linalg.eigvalsh(scaled)) > 1e-10:
        spread = np.linalg.inv(scaled)
        deviation = np.sqrt(np.diag(spread))
        error = misfit * deviation / lengths * problem.spans
        correlation = spread / np.outer(deviation, deviation)
        # Over the standard error of each parameter, with the others fixed.
        steps = np.diag(np.maximum(misfit / lengths, 1e-6))
        ends = np.stack([np.clip(shares + side * steps, 0.0, 1.0) for side in (-1, 1)], axis=1)

        def slope_at(u):
            left, rows = problem.stacked(u, weights)
            return rows.T @ left

        unsteady = float(np.max(unsteadiness(slope_at, ends, hessian, lengths)))
    with np.errstate(invalid="ignore"):
        return Posterior(names, error, correlation, error / plain, unsteady)
