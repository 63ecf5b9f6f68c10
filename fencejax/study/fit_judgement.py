"""The accuracy of identified parameters, and warnings about them."""

import dataclasses

import numpy as np

from ..design import DesignVariable
from ..printing import Readable, Table, of_lines
from ..results import Status
from .fit_problem import Problem
from .fit_search import residual_deviations
from .posterior import Posterior, laplace

# Above this, directions in parameter space are hardly distinguishable (Belsley, Kuh and Welsch
# 1980).
_ILL_CONDITIONED = 30.0


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Fit(Readable):
    """The n parameters found, and their accuracy.

    **Fields:**

    - `parameters`: with their bounds; `start`, `values`: before and after [SI], (n,).
    - `standard_errors`: of ln p [1] where the scaling is logarithmic, which is the relative error
      of p, and else of p [SI]; (n,). Infinite where the recordings do not determine p.
    - `low`, `high`: the interval of `confidence` [SI], (n,) each.
    - `correlation`: of the estimates [1], (n, n).
    - `condition`: of the Jacobian with columns of length one [1], without those that are 0;
      `weakest`: the change [1] of each ln p (or p over its range) along the least determined
      direction, the largest being 1.
    - `noise`: standard deviation of the residuals by signal [the signal's unit];
      `autocorrelation` of the residuals from one row to the next, by signal [1].
    - `fitted`: signals of the model at the recordings' times, one array (signals, K) an experiment.
    - `misfit`: root of the sum of weighted squares by degrees of freedom [1]: 1 where the
      residuals are as large as the noise.
    - `converged`, `evaluations`, `stop`: of the descent; `costs`: half the weighted sum of squares
      reached from each start.
    - `warnings`: reasons not to take the numbers at face value.
    - `posterior`: with the model's curvature, if asked for.
    - `rung`: the rung of `Fidelity.ladder()` at which the numbers were computed; above 0 where they
      were in doubt at the rungs before.
    """

    parameters: tuple[DesignVariable, ...]
    start: np.ndarray
    values: np.ndarray
    standard_errors: np.ndarray
    low: np.ndarray
    high: np.ndarray
    confidence: float
    correlation: np.ndarray
    condition: float
    weakest: np.ndarray
    noise: dict[str, float]
    autocorrelation: dict[str, float]
    fitted: list[np.ndarray]
    misfit: float
    converged: bool
    evaluations: int
    stop: str
    costs: list[float]
    warnings: tuple[str, ...]
    posterior: Posterior | None = None
    rung: int = 0

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters' names, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    def __str__(self) -> str:
        rows = [f"{'parameter':<24}{'start':>12}{'found':>12}{'std. error':>12}   interval"]
        for k, p in enumerate(self.parameters):
            relative = p.scaling == "logarithmic"
            error = self.standard_errors[k]
            shown = f"{100 * error:.2f} %" if relative else f"{error:.2e}"
            rows.append(
                f"{p.name.replace('_', ' '):<24}{self.start[k]:>12.4g}{self.values[k]:>12.4g}"
                f"{shown:>12}   {self.low[k]:.4g} ... {self.high[k]:.4g}"
                + ("" if p.unit == "1" else f" {p.unit}")
            )
        return "\n".join(rows)

    def _printed(self) -> Table:
        lines = [f"misfit {self.misfit:.3g}, condition {self.condition:.3g}: {self.stop}"]
        if self.rung:
            lines.append(f"computed finer: rung {self.rung} of the fidelity's ladder")
        lines += [f"warning: {warning}" for warning in self.warnings]
        return of_lines("Fit", "\n".join([str(self), *lines]))


def judged(
    problem: Problem, begin, shares, weights, converged, stop, costs, confidence: float,
    posterior: bool = False, rung: int = 0,
) -> Fit:
    """The parameters at the best shares, with the covariance of the linearised problem."""
    from scipy import stats

    parameters = problem.parameters
    residual, jacobian = problem.stacked(shares, weights)
    freedom = residual.size - shares.size
    misfit = float(np.sqrt(residual @ residual / freedom))
    spans = problem.spans
    logarithmic = np.array([p.scaling == "logarithmic" for p in parameters])
    lengths = np.linalg.norm(jacobian, axis=0)
    seen = lengths > 0
    error = np.full(shares.size, np.inf)
    correlation = np.eye(shares.size)
    condition, weakest = np.inf, (~seen).astype(float)
    if np.any(seen):
        _, sizes, turned = np.linalg.svd(jacobian[:, seen] / lengths[seen], full_matrices=False)
        condition = float(sizes[0] / sizes[-1]) if sizes[-1] > 0 else np.inf
        # Directions that the recordings determine beyond rounding.
        known = sizes > 1e-10 * sizes[0]
        inverse = np.where(known, 1 / np.where(known, sizes, 1.0), 0.0)
        spread = (turned.T * inverse**2) @ turned
        deviation = np.sqrt(np.diag(spread))
        both = np.outer(deviation, deviation)
        correlation[np.ix_(seen, seen)] = spread / np.where(both > 0, both, 1.0)
        unknown = np.any(np.abs(turned[~known]) > 1e-3, axis=0)
        error[seen] = np.where(unknown, np.inf, misfit * deviation / lengths[seen])
        weakest = np.zeros(shares.size)
        weakest[seen] = turned[-1] / lengths[seen]
        weakest = weakest * np.where(logarithmic, spans, 1.0)
        weakest = weakest / weakest[np.argmax(np.abs(weakest))]

    values = problem.values(shares)
    standard = error * spans
    half = float(stats.t.ppf(0.5 + 0.5 * confidence, freedom)) * standard
    with np.errstate(over="ignore"):
        low = np.where(logarithmic, values * np.exp(-half), values - half)
        high = np.where(logarithmic, values * np.exp(half), values + half)
    models = problem.models(shares)
    noise = residual_deviations(problem, shares, shares.size)
    lagged = _autocorrelation(problem, models)
    left = list(_warnings(problem, shares, standard, condition, weakest, lagged, models, costs))
    bent = laplace(problem, shares, weights, misfit, standard) if posterior else None
    if bent is not None and not bent.holds:
        left.append(
            "the second derivatives do not hold over a standard error (unsteadiness "
            f"{bent.unsteadiness:.2g}): the posterior is not normal, or has a kink there"
        )
    return Fit(
        parameters=parameters,
        start=problem.values(begin),
        values=values,
        standard_errors=standard,
        low=low,
        high=high,
        confidence=confidence,
        correlation=correlation,
        condition=condition,
        weakest=weakest,
        noise=noise,
        autocorrelation={name: value for name, (value, _) in lagged.items()},
        fitted=[modelled for modelled, _, _ in models],
        misfit=misfit,
        converged=converged,
        evaluations=problem.evaluations,
        stop=stop,
        costs=costs,
        warnings=tuple(left),
        posterior=bent,
        rung=rung,
    )


def _autocorrelation(problem: Problem, models) -> dict[str, tuple[float, float]]:
    """Autocorrelation of residuals between neighbouring samples, by signal, and a bound for
    noise."""
    above: dict[str, float] = {}
    below: dict[str, float] = {}
    rows: dict[str, int] = {}
    for (modelled, _, _), (_, recording) in zip(models, problem.experiments, strict=True):
        for name, row in zip(recording.names, modelled - recording.values, strict=True):
            row = row[np.isfinite(row)]
            above[name] = above.get(name, 0.0) + float(row[1:] @ row[:-1])
            below[name] = below.get(name, 0.0) + float(row @ row)
            rows[name] = rows.get(name, 0) + row.size
    return {
        name: (above[name] / below[name] if below[name] > 0 else 0.0, 3 / np.sqrt(rows[name]))
        for name in above
    }


def _warnings(problem, shares, standard, condition, weakest, lagged, models, costs):
    parameters = problem.parameters
    if condition > _ILL_CONDITIONED:
        combined = ", ".join(
            f"{p.name} {w:+.2f}"
            for p, w in zip(parameters, weakest, strict=True)
            if abs(w) > 0.1
        )
        yield (
            f"hardly distinguishable (condition {condition:.3g}): along {combined} the fit is "
            "almost as good. Hold one of these, or record more signals or other impacts"
        )
    for p, u, error in zip(parameters, shares, standard, strict=True):
        if not np.isfinite(error):
            yield f"{p.name} is not determined by the recordings at all"
        elif p.scaling == "logarithmic" and error > 0.5:
            yield f"{p.name} is known to a factor of {np.exp(error):.2g} only"
        if u < 1e-3 or u > 1 - 1e-3:
            end, bound = ("lower", p.lower) if u < 0.5 else ("upper", p.upper)
            yield f"{p.name} is at its {end} bound {bound:g} {p.unit}: its errors do not hold"
    for name, (value, limit) in lagged.items():
        if abs(value) > limit:
            yield (
                f"residuals of {name} follow one another (autocorrelation {value:+.2f}, noise "
                f"stays within {limit:.2f}): the model leaves something out, and the standard "
                "errors are too small"
            )
    for (_, _, status), (_, recording) in zip(models, problem.experiments, strict=True):
        if status >= Status.LEFT_OVER_TIP:
            yield f"{recording.source}: {Status(status).text}"
    if len(costs) > 1:
        reached = int(np.sum(np.array(costs) < 1.01 * min(costs)))
        if costs[0] > 1.01 * min(costs):
            yield "the scene's own numbers led to a worse minimum than another start"
        elif reached == 1:
            yield f"none of the other {len(costs) - 1} starts came to the same minimum"
