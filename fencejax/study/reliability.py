"""The probability that scattered numbers break a limit, from the most probable point of failure."""

import dataclasses
from collections.abc import Callable, Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .. import _check
from .curvature import STEADY, unsteadiness

# The distance around the most probable point at which a limit's curvature is checked [standard
# deviations].
_NEAR = 0.5
# Largest distance of a point from the nearest one of the limit [standard deviations] with which it
# is the design point: it changes the reliability index by half its square.
_STRAIGHT = 0.03


@dataclasses.dataclass(frozen=True, eq=False)
class Reliability:
    """The probability that n scattered numbers break a limit, and their importance.

    **Fields:**

    - `first_order`: the probability with the limit as a plane through the design point (FORM) [1];
      `probability`: with its curvatures there (SORM) [1].
    - `index`: beta [1], the distance of the design point from the medians in standard deviations,
      below 0 where the medians break the limit.
    - `point`: the numbers [SI] with which the limit is most probably broken, by name.
    - `importance`: the share [1] of each number in the scatter of the margin there; they sum to 1.
    - `curvatures`: of the limit at the point [1], n - 1, above 0 where it bends away.
    - `unsteadiness` [1]: the largest deviation of gradients half a standard deviation on both sides
      of the point from the prediction of the curvatures, relative to these and to 1. Above some 0.3
      the limit has a kink or a changing curvature there, and `probability` is no better than
      `first_order`.
    - `evaluations`: of the margin with its gradient.

    >>> found = fj.failure_probability(lambda p: 3.0 - p["a"], {"a": lambda u: 2.0 * u})
    >>> round(found.index, 3), round(found.point["a"], 3)
    (1.5, 3.0)
    """

    probability: float
    first_order: float
    index: float
    point: dict[str, float]
    importance: dict[str, float]
    curvatures: np.ndarray
    unsteadiness: float
    evaluations: int

    @property
    def holds(self) -> bool:
        """Whether the curvatures hold half a standard deviation around the point."""
        return self.unsteadiness <= STEADY

    def __str__(self) -> str:
        rows = [
            f"probability of breaking the limit {self.probability:.3g} "
            f"(a plane limit: {self.first_order:.3g}), reliability index {self.index:.3f}",
            f"{'number':<24}{'most probable':>14}{'importance':>12}",
        ]
        for name, value in self.point.items():
            rows.append(f"{name:<24}{value:>14.4g}{100 * self.importance[name]:>10.1f} %")
        if not self.holds:
            rows.append(
                "The limit's curvature does not hold around the most probable point (unsteadiness "
                f"{self.unsteadiness:.2g}): a kink is near. Check the probability by samples."
            )
        return "\n".join(rows)


def failure_probability(
    margin: Callable[[dict[str, Array]], Array],
    scatter: Mapping[str, Callable[[Array], Array]],
    *,
    tolerance: float = 1e-6,
    budget: int = 100,
) -> Reliability:
    """The probability that `margin(values)` is below 0 for independently scattered values.

    In terms of standard normal numbers u, the design point is the one nearest to 0 with
    margin = 0; its distance is the reliability index beta. The first-order probability is
    Phi(-beta) (Hasofer and Lind, 1974), the second-order one
    Phi(-beta) prod (1 + psi k_i)^(-1/2), psi = phi(beta) / Phi(-beta), with the curvatures k_i of
    the limit at the point (Hohenbichler and Rackwitz, 1988; Breitung, 1984), from the margin's
    exact Hessian. Both become exact for rare failures with a single design point; where several
    parts of the limit are equally near, they count only one of them.

    The point is found by SciPy's sequential quadratic programming.

    **Arguments:**

    - `margin`: of a dictionary of numbers [SI], below 0 where the limit is broken. Traced, and
      differentiated twice: smooth near the point.
    - `scatter`: each number [SI] as a function of a standard normal one:
      `{"mass": lambda u: 8.0 * jnp.exp(0.4 * u)}` is lognormal about 8 kg,
      `lambda u: low + (high - low) * jax.scipy.stats.norm.cdf(u)` uniform.
    - `tolerance`: how near to the limit, relative to the margin at the medians, the point is. What
      the precision of the numbers cannot tell is not asked for: less than the square root of its
      round-off counts as that.
    - `budget`: the most evaluations of the margin and its gradient.

    Raises `ValueError` where `scatter` is empty, where the margin or a derivative is not finite,
    where the margin does not depend on the numbers, and where no point of the limit is found within
    the budget.

    >>> scatter = {"mass": lambda u: 8.0 * jnp.exp(0.4 * u), "limit": lambda u: 25.0 + 2.0 * u}
    >>> print(fj.failure_probability(lambda p: p["limit"] - p["mass"], scatter))
    probability of breaking the limit 0.0027 (a plane limit: 0.00263), reliability index 2.791
    number                   most probable  importance
    mass                             23.86      95.8 %
    limit                            23.86       4.2 %
    """
    from scipy import stats

    if not scatter:
        raise ValueError("Argument `scatter` must hold at least one number's distribution.")
    budget = _check.count("budget", budget, least=1)
    tolerance = _check.number("tolerance", tolerance, above=0.0)
    limit = _Margin(margin, scatter, budget)
    point, slope = _design_point(limit, tolerance)
    steepness = float(np.linalg.norm(slope))
    outward = -slope / steepness
    index = float(point @ outward)
    hessian = limit.hessian(point) / steepness
    across = np.linalg.svd(outward[None])[2][1:]
    curvatures = np.linalg.eigvalsh(across @ hessian @ across.T)
    first = float(stats.norm.sf(index))
    # exp of a difference of logarithms, as both factors may underflow.
    psi = float(np.exp(stats.norm.logpdf(index) - stats.norm.logsf(index)))
    factors = 1 + psi * curvatures
    if not np.all(factors > 0):
        raise ValueError(
            f"The limit bends round the medians at {limit.text(point)} (curvatures "
            f"{curvatures}, reliability index {index:.3g}): it is broken in many places equally "
            "probably, and no single one tells how often. Draw samples instead."
        )
    ends = np.stack([np.stack([point - d, point + d]) for d in _NEAR * np.eye(len(point))])
    size = np.full(len(point), np.sqrt(max(1.0, float(np.max(np.abs(hessian))))))
    off = unsteadiness(lambda u: limit.slope(u) / steepness, ends, hessian, size)
    return Reliability(
        probability=first * float(np.prod(factors**-0.5)),
        first_order=first,
        index=index,
        point={name: float(value) for name, value in limit.values(point).items()},
        importance={name: float(a * a) for name, a in zip(scatter, outward, strict=True)},
        curvatures=curvatures,
        unsteadiness=float(np.max(off)),
        evaluations=limit.evaluations,
    )


class _SpentError(Exception):
    """The budget of evaluations is used up."""


class _Margin:
    """The margin of standard normal numbers u (n,), with its derivatives; `evaluations` counts
    those of `at`, of which there may be `budget`, and `seen` has their points, margins and
    gradients."""

    def __init__(self, margin, scatter, budget: int):
        self._scatter, self.budget = scatter, budget
        self._of = lambda u: margin(self.values(u))
        self._both = jax.jit(jax.value_and_grad(self._of))
        self._latest: tuple[bytes, float, np.ndarray] | None = None
        self.seen: list[tuple[np.ndarray, float, np.ndarray]] = []
        self.evaluations = 0

    @property
    def medians(self) -> np.ndarray:
        """u = 0."""
        return np.zeros(len(self._scatter))

    def values(self, u) -> dict[str, Array]:
        """The scattered numbers [SI] by name."""
        return {name: number(u[k]) for k, (name, number) in enumerate(self._scatter.items())}

    def text(self, u) -> str:
        """The scattered numbers, for messages."""
        return ", ".join(f"{name} = {float(value):.4g}" for name, value in self.values(u).items())

    def at(self, u) -> tuple[float, np.ndarray]:
        """The margin and its gradient; that of the point before is not evaluated again."""
        u = np.asarray(u, dtype=float)
        if self._latest is None or self._latest[0] != u.tobytes():
            if self.evaluations >= self.budget:
                raise _SpentError
            value, slope = self._both(jnp.asarray(u))
            self.evaluations += 1
            value, slope = float(value), np.asarray(slope, dtype=float)
            if not (np.isfinite(value) and np.all(np.isfinite(slope))):
                raise ValueError(
                    f"Argument `margin` must give finite numbers and derivatives, but gives {value}"
                    f" with {slope} at {self.text(u)}."
                )
            self._latest = u.tobytes(), value, slope
            self.seen.append((u, value, slope))
        return self._latest[1], self._latest[2]

    def slope(self, u) -> np.ndarray:
        """The gradient, not counted as an evaluation."""
        return np.asarray(self._both(jnp.asarray(u))[1])

    def hessian(self, u) -> np.ndarray:
        """The second derivatives (n, n)."""
        return np.asarray(jax.jit(jax.hessian(self._of))(jnp.asarray(u)))


def _design_point(limit: _Margin, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """The point of the limit nearest to the medians, and the margin's gradient there."""
    from scipy.optimize import minimize

    begin, slope = limit.at(limit.medians)
    if not np.any(slope):
        raise ValueError(
            "Argument `margin` must depend on the scattered numbers, but its derivatives at their "
            f"medians, {limit.text(limit.medians)}, are all 0."
        )
    scale = max(abs(begin), float(np.linalg.norm(slope)))
    # SLSQP ends where the margin and the distance change by less than this: round-off hides less.
    least = float(np.sqrt(np.finfo(jnp.zeros(0).dtype).eps))
    tolerance = max(tolerance, least)
    message = f"the budget of {limit.budget} evaluations is used up"
    try:
        message = minimize(
            lambda u: 0.5 * float(u @ u),
            # The nearest point of the tangent plane; at the medians the objective is flat.
            -begin * slope / (slope @ slope),
            jac=lambda u: u,
            method="SLSQP",
            constraints={
                "type": "eq",
                "fun": lambda u: limit.at(u)[0] / scale,
                "jac": lambda u: limit.at(u)[1] / scale,
            },
            options={"maxiter": limit.budget, "ftol": max(tolerance**2, least)},
        ).message
    except _SpentError:
        pass
    # The last of them may be the outcome of a line search amid round-off.
    on_limit = [(u, slope) for u, margin, slope in limit.seen if abs(margin) <= tolerance * scale]
    found = min(on_limit, key=lambda each: _astray(*each), default=None)
    if found is None or _astray(*found) > _STRAIGHT:
        point, nearest, _ = min(limit.seen, key=lambda each: abs(each[1]))
        raise ValueError(
            f"No point of the limit is found within `budget`: {message}. The margin is {begin:.4g} "
            f"at the medians, and {nearest:.4g} at {limit.text(point)}, where it is nearest to 0. "
            "The limit may be out of reach of these numbers."
        )
    return found


def _astray(point: np.ndarray, slope: np.ndarray) -> float:
    """How far a point of the limit is from the foot of the perpendicular on the tangent plane there
    [standard deviations]: 0 for the nearest one."""
    return float(np.linalg.norm(point - (point @ slope) / (slope @ slope) * slope))
