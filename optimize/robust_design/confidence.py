"""Statistics of a fresh sample of parcels with confidence intervals."""

from typing import NamedTuple

import numpy as np
from scipy.special import betaincinv


class Interval(NamedTuple):
    """An estimate and the bounds of its confidence interval."""

    value: float
    lower: float
    upper: float


def measure_of(values: np.ndarray, measure: str, level: float, axis: int = -1) -> np.ndarray:
    """Mean, CVaR or largest of samples along an axis; see `fencejax.risk.risk`."""
    if measure == "mean":
        return np.mean(values, axis=axis)
    if measure == "worst":
        return np.max(values, axis=axis)
    falling = -np.sort(-values, axis=axis)
    count = values.shape[axis]
    top = max((1 - level) * count, 1.0)
    weights = np.clip(top - np.arange(count), 0, 1) / top
    return np.moveaxis(falling, axis, -1) @ weights


def bootstrap(
    values: np.ndarray, measure: str, level: float, resamples: int, confidence: float, seed: int
) -> Interval:
    """A measure of a sample with its percentile bootstrap interval (Efron, 1979).

    With `values` of shape (n, 2) the interval is that of the second column's measure over the
    first's, both drawn together. The bootstrap does not bound a worst case from above, as it never
    draws more than the sample's largest value.
    """
    generator = np.random.default_rng(seed)
    table = values if values.ndim == 2 else values[:, None]
    found = []
    for part in np.array_split(np.arange(resamples), max(1, resamples * len(table) // 2_000_000)):
        drawn = table[generator.integers(0, len(table), (part.size, len(table)))]
        found.append(measure_of(drawn, measure, level, axis=1))
    drawn, whole = np.concatenate(found), measure_of(table, measure, level, axis=0)
    if table.shape[1] == 2:
        drawn, whole = drawn[:, 1] / drawn[:, 0], whole[1] / whole[0]
    half = 0.5 * (1 - confidence)
    low, high = np.quantile(np.ravel(drawn), [half, 1 - half])
    return Interval(float(np.ravel(whole)[0]), float(low), float(high))


def share(holds: np.ndarray, confidence: float) -> Interval:
    """The share of parcels that hold a limit, with Clopper and Pearson's exact interval (1934)."""
    count, good = holds.size, int(np.sum(holds))
    half = 0.5 * (1 - confidence)
    low = 0.0 if good == 0 else float(betaincinv(good, count - good + 1, half))
    high = 1.0 if good == count else float(betaincinv(good + 1, count - good, 1 - half))
    return Interval(good / count, low, high)
