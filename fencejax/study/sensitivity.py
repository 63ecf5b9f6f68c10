"""Sensitivity of outputs to inputs: elasticities at a point, and shares of variance over ranges.

Local: e = d ln Q / d ln p from derivatives, and the sum rules that follow because physical laws do
not depend on the units. Global, for inputs that vary independently over ranges: the indices of
Sobol' from samples of values, and an upper bound on them from samples of gradients, of which far
fewer are needed.

The functions of this module take arrays of any origin; `fencejax.Response` computes them for a
scene. Inputs are u in [0, 1]^n, uniform: a `DesignVariable`'s `value(u)` is then uniform or
log-uniform between its bounds.

>>> fj.sensitivity.elasticities(np.array([8.0]), np.array([[12.0]]), np.array([2.0]))
array([[3.]])
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import ArrayLike

from .. import _check
from ..parts import Dimension, dimension


class Estimate(NamedTuple):
    """A value with the bounds of its confidence interval; arrays of one shape.

    >>> points = fj.sensitivity.design(1, 64).first
    >>> found = fj.sensitivity.derivative_measures(2.0 * points, np.full((64, 1, 1), 2.0))
    >>> bool((found.bound.low <= found.bound.value)[0, 0])
    True
    """

    value: np.ndarray
    low: np.ndarray
    high: np.ndarray


class Design(NamedTuple):
    """Points u in [0, 1]^n of a Sobol' analysis: `first` (A) and `second` (B) of shape (K, n),
    `mixed` of shape (n, K, n), in which `mixed[i]` is A with its column i taken from B.

    >>> points = fj.sensitivity.design(3, 16)
    >>> points.first.shape, points.mixed.shape
    ((16, 3), (3, 16, 3))
    """

    first: np.ndarray
    second: np.ndarray
    mixed: np.ndarray


class SobolIndices(NamedTuple):
    """Shares of the variance of m outputs due to n inputs [1], each of shape (m, n): `first` due to
    the input alone, S_i; `total` due to it and all of its interactions, S_Ti.

    >>> points, slopes = fj.sensitivity.design(2, 256), np.array([[2.0], [1.0]])
    >>> found = fj.sensitivity.sobol_indices(*(part @ slopes for part in points))
    >>> found.total.value.round(1)
    array([[0.8, 0.2]])
    """

    first: Estimate
    total: Estimate


class DerivativeMeasures(NamedTuple):
    """For m outputs and n inputs: `measure` nu_i = E[(dQ/du_i)^2] [the output's unit squared] and
    `bound` on S_Ti [1], each of shape (m, n).

    >>> points = fj.sensitivity.design(1, 64).first
    >>> found = fj.sensitivity.derivative_measures(2.0 * points, np.full((64, 1, 1), 2.0))
    >>> found.measure.value, found.bound.value.round(2)
    (array([[4.]]), array([[1.2]]))
    """

    measure: Estimate
    bound: Estimate


def elasticities(values: ArrayLike, slopes: ArrayLike, at: ArrayLike) -> np.ndarray:
    """e_ij = (dQ_i / dp_j) p_j / Q_i [1]: the increase of Q_i in per cent for an increase of p_j by
    one.

    **Arguments:** Q of shape (..., m), dQ/dp of shape (..., m, n), p of shape (..., n). Where
    Q_i = 0 there is no elasticity: NaN.

    >>> fj.sensitivity.elasticities(np.array([8.0]), np.array([[12.0]]), np.array([2.0]))
    array([[3.]])
    """
    values, slopes, at = (np.asarray(a, dtype=float) for a in (values, slopes, at))
    return slopes * at[..., None, :] / np.where(values == 0, np.nan, values)[..., None]


def unit_rules(
    elasticity: ArrayLike, input_units: Sequence[str], output_units: Sequence[str]
) -> np.ndarray:
    """The residuals of the three sum rules, of shape (..., m, 3) [1]: mass, length and time.

    Counting mass in a unit smaller by the factor s multiplies every p_j by s^(mu_j) and Q_i by
    s^(M_i), with mu_j and M_i their exponents of mass, and Q_i(p) is the same law. Its derivative
    in ln s at s = 1 is

    sum_j mu_j e_ij = M_i,

    and likewise for length and time (Buckingham's theorem in differential form). The sum runs over
    *all* numbers that have a unit. The residual, sum_j mu_j e_ij - M_i, is then 0 to rounding;
    where some of these numbers were kept constant, it is minus the sum of their own elasticities
    times exponents. For a scene these are `Fidelity.step` with the duration (time), `slip_speed`
    and `static_speed` (length and time) and `tip_fade` (length): the residual shows how much Q
    depends on them.

    **Arguments:** `elasticity` of shape (..., m, n) with n units of inputs and m of outputs, such
    as `"kg/m^3"` (see `fencejax.parts.dimension`).

    Raises `ValueError` for an unknown unit and where the counts differ.

    >>> fj.sensitivity.unit_rules(np.array([[2.0, 1.0]]), ["m/s", "kg"], ["J"])
    array([[0., 0., 0.]])
    """
    elasticity = np.asarray(elasticity, dtype=float)
    shape = len(output_units), len(input_units)
    if elasticity.shape[-2:] != shape:
        raise ValueError(
            f"Argument `elasticity` must have the shape (..., {shape[0]}, {shape[1]}), one row an "
            f"output and one column an input, but has {elasticity.shape}."
        )
    inputs = np.array([dimension(unit) for unit in input_units], dtype=float)
    outputs = np.array([dimension(unit) for unit in output_units], dtype=float)
    # An input that is 0 has the elasticity 0, whatever its slope.
    return elasticity @ inputs - outputs


UNITS_OF_RULES = Dimension._fields
"""The dimensions of the three rules of `unit_rules`."""


def design(inputs: int, count: int, seed: int = 0) -> Design:
    """`count` points A and B and their mixtures, from a scrambled Sobol' sequence in 2 n
    dimensions (Saltelli et al. 2010).

    Raises `ValueError` where `count` is not a power of 2, at which these sequences are balanced.

    >>> fj.sensitivity.design(3, 16).mixed.shape
    (3, 16, 3)
    """
    from scipy.stats import qmc

    _check.count("inputs", inputs, least=1)
    _check.count("count", count, least=2)
    if count & (count - 1):
        raise ValueError(f"Argument `count` must be a power of 2, but is {count}.")
    engine = qmc.Sobol(2 * inputs, scramble=True, rng=np.random.default_rng(seed))
    points = engine.random(count)
    first, second = points[:, :inputs], points[:, inputs:]
    mixed = np.repeat(first[None], inputs, axis=0)
    for i in range(inputs):
        mixed[i, :, i] = second[:, i]
    return Design(first, second, mixed)


def _bootstrapped(
    statistics: Callable[[np.ndarray], tuple[np.ndarray, ...]],
    count: int,
    confidence: float,
    resamples: int,
    seed: int,
) -> list[Estimate]:
    """Statistics of all `count` rows, with their percentile bootstrap intervals."""
    generator = np.random.default_rng(seed)
    drawn = [statistics(generator.integers(count, size=count)) for _ in range(resamples)]
    tail = 50 * (1 - confidence)
    return [
        Estimate(value, *np.percentile(np.array(samples), [tail, 100 - tail], axis=0))
        for value, *samples in zip(statistics(np.arange(count)), *drawn, strict=True)
    ]


def _checked_confidence(confidence: float, resamples: int) -> None:
    _check.count("resamples", resamples, least=10)
    if not 0 < _check.number("confidence", confidence) < 1:
        raise ValueError(f"Argument `confidence` must be within 0 and 1, but is {confidence:g}.")


def _all_finite(name: str, array: np.ndarray, axes: tuple[int, ...]) -> None:
    """Raise where lanes are not finite: an index of the other lanes would be of another range."""
    bad = int(np.sum(~np.all(np.isfinite(array), axis=axes)))
    if bad:
        raise ValueError(
            f"Argument `{name}` must be finite, but {bad} of its lanes are not. Their status says "
            "why; narrow the ranges of the inputs."
        )


def sobol_indices(
    first: ArrayLike,
    second: ArrayLike,
    mixed: ArrayLike,
    *,
    confidence: float = 0.95,
    resamples: int = 200,
    seed: int = 0,
) -> SobolIndices:
    """The indices of Sobol' by the estimators of Saltelli et al. (2010), first order, and of
    Jansen (1999), total, as in `scipy.stats.sobol_indices`:

    S_i = E[Q(B) (Q(A_B^i) - Q(A))] / V,  S_Ti = E[(Q(A) - Q(A_B^i))^2] / (2 V).

    **Arguments:**

    - `first`, `second`: Q at the points `first` and `second` of a `Design`, of shape (K, m).
    - `mixed`: Q at its points `mixed`, of shape (n, K, m).
    - `confidence`: of the intervals [1], by the percentiles of a bootstrap over the K points with
      `resamples` draws. It treats the points as random; a Sobol' sequence is spread more evenly, so
      that the intervals are rather too wide.

    Raises `ValueError` where a value is not finite. An output that does not vary has the indices 0.

    >>> points, slopes = fj.sensitivity.design(2, 256), np.array([[2.0], [1.0]])
    >>> found = fj.sensitivity.sobol_indices(*(part @ slopes for part in points))
    >>> found.first.value.round(1)
    array([[0.8, 0.2]])
    """
    from scipy import stats

    _checked_confidence(confidence, resamples)
    first, second, mixed = (np.asarray(a, dtype=float) for a in (first, second, mixed))
    _all_finite("first", first, (1,))
    _all_finite("second", second, (1,))
    _all_finite("mixed", mixed, (2,))
    a, b, ab = first.T, second.T, np.moveaxis(mixed, 2, 1)
    count = a.shape[1]

    def indices(rows):
        found = stats.sobol_indices(
            func={"f_A": a[:, rows], "f_B": b[:, rows], "f_AB": ab[:, :, rows]}, n=count
        )
        # For a single output the indices have no axis of outputs.
        return tuple(np.reshape(i, (len(a), -1)) for i in (found.first_order, found.total_order))

    return SobolIndices(*_bootstrapped(indices, count, confidence, resamples, seed))


def derivative_measures(
    values: ArrayLike,
    slopes: ArrayLike,
    *,
    confidence: float = 0.95,
    resamples: int = 200,
    seed: int = 0,
) -> DerivativeMeasures:
    """Measures of sensitivity from derivatives, and the bound on the total index that follows:

    nu_i = E[(dQ/du_i)^2],  S_Ti <= nu_i / (pi^2 V),

    with V the variance of Q, for independent u_i that are uniform over [0, 1] (Sobol' and
    Kucherenko 2009; by Wirtinger's inequality). Over [a, b] the bound is
    (b - a)^2 nu_i / (pi^2 V) with the derivative in that variable, the same number. It holds where
    Q is differentiable almost everywhere and continuous, and it is tight where Q is a cosine of
    half a period over the range; for a straight line it is 12 / pi^2 = 1.22 times the index.

    **Arguments:** Q of shape (K, m) and dQ/du of shape (K, m, n) at points u that are spread evenly
    over the cube, such as `Design.first`. Intervals as in `sobol_indices`.

    Raises `ValueError` where a value or a slope is not finite, and for fewer than two points. An
    output that does not vary at all has the bound 0.

    >>> points = fj.sensitivity.design(1, 64).first
    >>> found = fj.sensitivity.derivative_measures(2.0 * points, np.full((64, 1, 1), 2.0))
    >>> found.bound.value.round(2)
    array([[1.2]])
    """
    _checked_confidence(confidence, resamples)
    values, slopes = np.asarray(values, dtype=float), np.asarray(slopes, dtype=float)
    _all_finite("values", values, (1,))
    _all_finite("slopes", slopes, (1, 2))
    count = _check.count("points", len(values), least=2)
    square = slopes**2

    def measures(rows):
        measure = np.mean(square[rows], axis=0)
        variance = np.var(values[rows], axis=0, ddof=1)[:, None]
        flat = variance == 0
        bound = measure / (np.pi**2 * np.where(flat, 1.0, variance))
        return measure, np.where(flat, np.where(measure == 0, 0.0, np.inf), bound)

    return DerivativeMeasures(*_bootstrapped(measures, count, confidence, resamples, seed))
