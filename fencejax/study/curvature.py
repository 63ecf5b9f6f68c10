"""Second derivatives, and whether they hold: a Hessian compared with differences of gradients."""

import dataclasses
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from ..printing import Readable, Table

STEADY = 0.3
"""A Hessian holds over a distance where differences of gradients over that distance deviate from it
by no more than this share of its size: it then predicts changes of the gradient to a third."""


def unsteadiness(
    slope_at: Callable[[np.ndarray], np.ndarray],
    ends: np.ndarray,
    hessian: np.ndarray,
    sizes: np.ndarray,
) -> np.ndarray:
    """The deviation of the columns of a Hessian H (n, n) from differences of gradients [1], (n,):

    max_j |(g_j(b_k) - g_j(a_k)) / |b_k - a_k| - H_jk| / (s_j s_k)

    with `slope_at` the gradient g (n,), `ends` the points a_k and b_k (n, 2, n), which differ only
    in the k-th number, and `sizes` s (n,), the square roots of the reference for H.
    """
    found = np.zeros(len(sizes))
    for k, (low, high) in enumerate(ends):
        column = (slope_at(high) - slope_at(low)) / (high[k] - low[k])
        found[k] = np.max(np.abs(column - hessian[:, k]) / (sizes * sizes[k]))
    return found


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Curvature(Readable):
    """A function's value and derivatives at a point of n numbers.

    **Fields:**

    - `value`, `gradient` (n,), `hessian` (n, n).
    - `reach` (n,): the distance in each number over which they were compared.
    - `unsteadiness` [1], (n,): the distance between a column of the Hessian and the difference
      quotient of the gradient over `reach`, the larger of those to both sides, relative to the
      column's largest element. All numbers are scaled by `reach`.

    >>> fj.curvature(lambda x: x[0] ** 2, [3.0], 0.5)
    Curvature
      value     9
      number 0  slope 6, curvature 2, which holds over 0.5 (unsteadiness 0)
    """

    value: float
    gradient: np.ndarray
    hessian: np.ndarray
    reach: np.ndarray
    unsteadiness: np.ndarray

    @property
    def holds(self) -> np.ndarray:
        """Whether the Hessian's column of each number holds over its reach, (n,). Where it does
        not, the slope has a jump there, or the curvature changes within the reach."""
        return self.unsteadiness <= STEADY

    def _printed(self) -> Table:
        rows = [("value", f"{self.value:.6g}")]
        for k, (slope, bend) in enumerate(zip(self.gradient, np.diag(self.hessian), strict=True)):
            verdict = "holds" if self.holds[k] else "does not hold"
            rows.append(
                (f"number {k}", f"slope {slope:.4g}, curvature {bend:.4g}, which {verdict} over "
                 f"{self.reach[k]:.3g} (unsteadiness {self.unsteadiness[k]:.2g})")
            )  # fmt: skip
        return Table("Curvature", tuple(rows))


def curvature(
    function: Callable[[Array], Array], point: ArrayLike, reach: ArrayLike
) -> Curvature:
    """The Hessian of a function, and over which numbers it holds.

    A second derivative belongs to one point. Where a force begins or ends, where friction reverses
    or where another of several values becomes the largest, it jumps: though exact, it then says
    nothing about the function nearby. Therefore gradients are computed at `reach` on both sides of
    the point in each number, 2 n of them besides the Hessian's cost of some n, and their
    differences are compared with the Hessian.

    **Arguments:**

    - `function`: of an array (n,), a number; it is traced and differentiated twice.
    - `point`: (n,), or a number.
    - `reach`: above 0; the distance from the point over which the derivatives should hold, in the
      units of each number, (n,) or one for all.

    Raises `ValueError` where the shapes do not fit, a reach is not above 0, or the function or one
    of its derivatives is not finite.

    >>> found = fj.curvature(lambda x: x[0] ** 2 + 2 * abs(x[1] - 0.05), [1.0, 0.0], 0.1)
    >>> found.holds
    array([ True, False])
    """
    at = np.atleast_1d(np.asarray(point, dtype=float))
    if at.ndim != 1:
        raise ValueError(f"Argument `point` must have the shape (n,), but has {at.shape}.")
    try:
        distance = np.broadcast_to(np.asarray(reach, dtype=float), at.shape)
    except ValueError:
        raise ValueError(
            f"Argument `reach` must be one number or one each of `point`, {at.shape}, but has the "
            f"shape {np.shape(reach)}."
        ) from None
    if not np.all(distance > 0):
        raise ValueError(f"Argument `reach` must be above 0, but is {reach}.")
    gradient = jax.jit(jax.value_and_grad(function))
    value, slope = (np.asarray(part) for part in gradient(jnp.asarray(at)))
    hessian = np.asarray(jax.jit(jax.hessian(function))(jnp.asarray(at)))
    if not all(np.all(np.isfinite(part)) for part in (value, slope, hessian)):
        raise ValueError(
            "Argument `function` must be finite with its derivatives at `point`, but gives "
            f"{value}, the gradient {slope} and the Hessian {hessian}."
        )
    scaled = distance * np.abs(hessian) * distance[:, None]
    # Rounding in the slope of a linear function is no curvature.
    floor = np.finfo(slope.dtype).eps ** 0.5 * np.max(distance * np.abs(slope))
    sizes = np.sqrt(max(np.max(scaled), floor, np.finfo(float).tiny)) / distance
    ends = np.stack([np.stack([at - step, at + step]) for step in np.diag(distance)])
    off = unsteadiness(lambda x: np.asarray(gradient(jnp.asarray(x))[1]), ends, hessian, sizes)
    return Curvature(float(value), slope, hessian, distance.copy(), off)
