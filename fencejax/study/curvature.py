"""Second derivatives, and whether they hold: a Hessian beside differences of gradients."""

import dataclasses
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from ..printing import Readable, Table

STEADY = 0.3
"""A Hessian holds over a distance where differences of gradients over it are no further from it
than this, relative to its size: it then tells how a gradient changes to a third."""


def unsteadiness(
    slope_at: Callable[[np.ndarray], np.ndarray],
    ends: np.ndarray,
    hessian: np.ndarray,
    sizes: np.ndarray,
) -> np.ndarray:
    """How far columns of a Hessian H (n, n) are from differences of gradients [1], (n,):

    max_j |(g_j(b_k) - g_j(a_k)) / |b_k - a_k| - H_jk| / (s_j s_k)

    with `slope_at` the gradient g (n,), `ends` the points a_k and b_k (n, 2, n), which differ in
    the k-th number alone, and `sizes` s (n,), the roots of what H is compared with.
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
    - `reach` (n,): over which distance of each number they were looked at.
    - `unsteadiness` [1], (n,): how far differences of gradients over that distance, to both sides,
      are from the Hessian's column, relative to its largest element, all in units of `reach`.

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
        """Of each number, whether the Hessian's column holds over its reach, (n,). Where it does
        not, the function has a kink or a jump of its slope there, or bends within the reach."""
        return self.unsteadiness <= STEADY

    def _printed(self) -> Table:
        rows = [("value", f"{self.value:.6g}")]
        for k, (slope, bend) in enumerate(zip(self.gradient, np.diag(self.hessian), strict=True)):
            told = "holds" if self.holds[k] else "does not hold"
            rows.append(
                (f"number {k}", f"slope {slope:.4g}, curvature {bend:.4g}, which {told} over "
                 f"{self.reach[k]:.3g} (unsteadiness {self.unsteadiness[k]:.2g})")
            )  # fmt: skip
        return Table("Curvature", tuple(rows))


def curvature(
    function: Callable[[Array], Array], point: ArrayLike, reach: ArrayLike
) -> Curvature:
    """The Hessian of a function, and over which numbers it holds.

    A second derivative is that of a point. Where a force begins or ends, where friction turns round
    or where the largest of several values is another one, it jumps, and says nothing of the
    function a little further on, though it is exact. So gradients are taken at `reach` to both
    sides of the point in each number, 2 n of them beside the Hessian's cost of some n, and their
    differences compared with it.

    **Arguments:**

    - `function`: of an array (n,), a number; it is traced and differentiated twice.
    - `point`: (n,), or a number.
    - `reach`: above 0; how far from the point the derivatives are to hold, in the units of each
      number, (n,) or one for all.

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
        far = np.broadcast_to(np.asarray(reach, dtype=float), at.shape)
    except ValueError:
        raise ValueError(
            f"Argument `reach` must be one number or one each of `point`, {at.shape}, but has the "
            f"shape {np.shape(reach)}."
        ) from None
    if not np.all(far > 0):
        raise ValueError(f"Argument `reach` must be above 0, but is {reach}.")
    gradient = jax.jit(jax.value_and_grad(function))
    value, slope = (np.asarray(part) for part in gradient(jnp.asarray(at)))
    hessian = np.asarray(jax.jit(jax.hessian(function))(jnp.asarray(at)))
    if not all(np.all(np.isfinite(part)) for part in (value, slope, hessian)):
        raise ValueError(
            "Argument `function` must be finite with its derivatives at `point`, but gives "
            f"{value}, the gradient {slope} and the Hessian {hessian}."
        )
    scaled = far * np.abs(hessian) * far[:, None]
    # What rounding leaves of a straight function's slope is no curvature.
    floor = np.finfo(slope.dtype).eps ** 0.5 * np.max(far * np.abs(slope))
    sizes = np.sqrt(max(np.max(scaled), floor, np.finfo(float).tiny)) / far
    ends = np.stack([np.stack([at - step, at + step]) for step in np.diag(far)])
    off = unsteadiness(lambda x: np.asarray(gradient(jnp.asarray(x))[1]), ends, hessian, sizes)
    return Curvature(float(value), slope, hessian, far.copy(), off)
