"""Mean, CVaR, worst case and quantiles of a sample, as weighted sums of its sorted values.

>>> float(fj.risk.risk(jnp.array([900.0, 1000.0, 1100.0, 1200.0]), "cvar", 0.5))
1150.0
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import betainc
from jaxtyping import Array, ArrayLike

from .. import _check

MEASURES = ("mean", "cvar", "worst")


def _sorted(values: Array, valid: ArrayLike | None) -> tuple[Array, Array, Array]:
    """The values in descending order, the invalid ones last and 0, their ranks from 0, and the
    number of valid ones."""
    good = jnp.ones_like(values, dtype=bool) if valid is None else jnp.asarray(valid)
    key = jnp.where(good, -values, jnp.inf)
    order = jnp.argsort(jax.lax.stop_gradient(key))
    falling = jnp.where(good, values, 0.0)[order]
    rank = jnp.arange(values.shape[0]).astype(values.dtype)
    return falling, rank, jnp.sum(good).astype(values.dtype)


def _share(level: float) -> float:
    level = _check.number("level", level, above=0)
    if level >= 1:
        raise ValueError(f"Argument `level` must be below 1 [1], but is {level:g}.")
    return level


def risk(
    values: ArrayLike, measure: str = "cvar", level: float = 0.95,
    valid: ArrayLike | None = None, weights: ArrayLike | None = None,
) -> Array:
    """A measure of the large values of a sample (n,): of a force, say.

    - `"mean"`: their mean.
    - `"cvar"`: the mean of the largest share 1 - `level`, the minimum over t of
      t + sum max(0, F_i - t) / ((1 - level) n) (Rockafellar and Uryasev, 2000), in closed form:
      with k = (1 - level) n the r-th largest value counts min(1, max(0, k - r + 1)) / k.
    - `"worst"`: the largest.

    Differentiable: the derivative is that of the values at their present ranks, a subgradient
    where two of them are equal. Values that are not `valid` (n,) are left out and may be NaN; the
    result is NaN where none is left. `weights` (n,), at least 0, are the frequencies of the values,
    by default all equal.

    Raises `ValueError` for an unknown measure or a level not in (0, 1).

    >>> forces = jnp.array([900.0, 1000.0, 1100.0, 1200.0])
    >>> [float(fj.risk.risk(forces, measure, 0.5)) for measure in ("mean", "cvar", "worst")]
    [1050.0, 1150.0, 1200.0]
    """
    _check.choice("measure", measure, MEASURES)
    level = _share(level)
    if weights is not None:
        return _weighted(jnp.asarray(values), measure, level, valid, jnp.asarray(weights))
    falling, rank, count = _sorted(jnp.asarray(values), valid)
    if measure == "mean":
        return jnp.sum(falling) / jnp.where(count > 0, count, jnp.nan)
    if measure == "worst":
        return jnp.where(count > 0, falling[0], jnp.nan)
    # At least one value counts, however small the share of the sample.
    top = jnp.maximum((1 - level) * count, jnp.minimum(count, 1.0))
    weights = jnp.clip(top - rank, 0.0, 1.0)
    return jnp.sum(weights * falling) / jnp.where(count > 0, top, jnp.nan)


def _weighted(
    values: Array, measure: str, level: float, valid: ArrayLike | None, weights: Array
) -> Array:
    """`risk` of values with different frequencies: among the largest values that make up the share
    1 - `level` of all weight, each counts with its own weight."""
    good = weights > 0
    good = good if valid is None else good & jnp.asarray(valid)
    safe, own = jnp.where(good, values, 0.0), jnp.where(good, weights, 0.0)
    total = jnp.sum(own)
    if measure == "mean":
        return jnp.sum(own * safe) / jnp.where(total > 0, total, jnp.nan)
    if measure == "worst":
        return jnp.where(total > 0, jnp.max(jnp.where(good, values, -jnp.inf)), jnp.nan)
    order = jnp.argsort(jax.lax.stop_gradient(jnp.where(good, -values, jnp.inf)))
    falling, own = safe[order], own[order]
    top = (1 - level) * total
    counted = jnp.clip(top - (jnp.cumsum(own) - own), 0.0, own)
    return jnp.sum(counted * falling) / jnp.where(total > 0, top, jnp.nan)


def quantile(values: ArrayLike, level: float, valid: ArrayLike | None = None) -> Array:
    """The value that a share `level` of a sample (n,) does not exceed, smooth in rank.

    Harrell and Davis' estimator (1982): the i-th smallest of n counts
    I(i / n) - I((i - 1) / n), with I the regularised incomplete beta function of
    a = (n + 1) level, b = (n + 1) (1 - level). Differentiable as `risk` is; `valid` as there.

    Raises `ValueError` for a level not in (0, 1).

    >>> float(fj.risk.quantile(jnp.array([900.0, 1000.0, 1100.0, 1200.0]), 0.5))
    1050.0
    """
    level = _share(level)
    values = jnp.asarray(values)
    if valid is None:
        from scipy import special

        edges = np.arange(values.shape[0] + 1) / values.shape[0]
        size = values.shape[0] + 1
        counts = np.diff(special.betainc(size * level, size * (1 - level), edges))
        return jnp.sum(jnp.asarray(counts, dtype=values.dtype) * jnp.sort(values))
    falling, rank, count = _sorted(values, valid)
    safe = jnp.maximum(count, 1.0)
    # Counted from the largest: the share that exceeds it is 1 - level.
    a, b = (safe + 1) * (1 - level), (safe + 1) * level
    upper = betainc(a, b, jnp.minimum((rank + 1) / safe, 1.0))
    lower = betainc(a, b, jnp.minimum(rank / safe, 1.0))
    weights = jax.lax.stop_gradient(upper - lower)
    return jnp.where(count > 0, jnp.sum(weights * falling), jnp.nan)
