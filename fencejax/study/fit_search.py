"""The search of identification: weighted Gauss-Newton steps from several starts."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from .. import _check
from .fit_problem import Problem
from .recording import SIGNALS

# The most searches, each with the noise estimated from the residuals of the one before.
_PASSES = 5


def first_scales(experiments, noise: Mapping[str, float] | None) -> dict[str, float]:
    """The given noise, or initially the largest value of every signal."""
    largest: dict[str, float] = {}
    for _, recording in experiments:
        for name, column in recording.signals.items():
            size = float(np.nanmax(np.abs(np.asarray(column))))
            largest[name] = max(largest.get(name, 0.0), size)
    if noise is None:
        return {name: size if size > 0 else 1.0 for name, size in largest.items()}
    for name in largest:
        if name not in noise:
            raise ValueError(
                f"Argument `noise` must hold every signal {list(largest)}, but lacks {name!r}."
            )
    return {
        name: _check.number(f"noise[{name!r}]", noise[name], above=0, unit=SIGNALS[name])
        for name in largest
    }


def residual_deviations(problem: Problem, shares, count: int) -> dict[str, float]:
    """Standard deviation of the residuals by signal; each signal loses its share of the degrees of
    freedom."""
    sums: dict[str, float] = {}
    rows: dict[str, int] = {}
    for (modelled, _, _), (_, recording) in zip(
        problem.models(shares), problem.experiments, strict=True
    ):
        for name, a, b in zip(recording.names, modelled, recording.values, strict=True):
            sums[name] = sums.get(name, 0.0) + float(np.nansum((a - b) ** 2))
            rows[name] = rows.get(name, 0) + int(np.sum(np.isfinite(b)))
    share = 1 - count / sum(rows.values())
    return {name: float(np.sqrt(sums[name] / (rows[name] * share))) for name in sums}


def starts_from(begin: np.ndarray, count: int, seed: int) -> list[np.ndarray]:
    """Where the searches start: the first at `begin`, the others spread over the bounds."""
    if count == 1:
        return [begin]
    from scipy.stats import qmc

    engine = qmc.LatinHypercube(begin.size, rng=np.random.default_rng(seed))
    return [begin, *(0.1 + 0.8 * engine.random(count - 1))]


def _jacobian_of(problem: Problem):
    return lambda x, noise: problem.stacked(x, noise)[1]


# Why `scipy.optimize.least_squares` ended.
_ENDS = {
    0: "the evaluations are spent",
    1: "no parameter lowers the sum of squares any further",
    2: "the sum of squares falls no further",
    3: "the parameters change no further",
    4: "neither the sum of squares nor the parameters change any further",
}


def search(problem: Problem, begin, weights, estimated: bool, most: int, progress):
    """One search: the shares, the weights used last, whether it converged, and why it stopped."""
    from scipy.optimize import least_squares

    shares = np.asarray(begin, dtype=float)
    converged, stop = False, ""
    for _ in range(_PASSES):
        current = dict(weights)

        def residuals(x, current):
            value = problem.stacked(x, current)[0]
            if progress is not None:
                progress(problem.evaluations, 0.5 * float(value @ value))
            return value

        jacobian: Any = _jacobian_of(problem)
        solution = least_squares(
            residuals,
            shares,
            jac=jacobian,
            args=(current,),
            bounds=(0.0, 1.0),
            x_scale="jac",
            ftol=1e-10,
            xtol=1e-9,
            gtol=1e-10,
            max_nfev=most,
        )
        shares = solution.x
        converged, stop = bool(solution.status > 0), _ENDS[solution.status]
        if not estimated:
            break
        spread = residual_deviations(problem, shares, shares.size)
        # Residuals that are rounding alone must not become weights.
        new = {name: max(spread[name], 1e-9 * weights[name]) for name in weights}
        ratios = [np.log(new[name] / current[name]) for name in new]
        weights = new
        # A common factor does not change the optimum.
        if np.ptp(ratios) < 0.02:
            break
    return shares, weights, converged, stop
