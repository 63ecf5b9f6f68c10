"""Points to compute: grids, Latin hypercubes and Sobol sequences over named variables.

>>> mass = fj.DesignVariable("mass", 5.0, 20.0, "kg")
>>> fj.sampling.sobol([mass], 8).values.shape
(8, 1)
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import ArrayLike

from .. import _check
from ..design import DesignVariable, variable as variable

KINDS = ("grid", "latin_hypercube", "sobol", "given")
"""Kinds of samples."""


@dataclasses.dataclass(frozen=True, eq=False)
class Samples:
    """Points over named variables.

    **Fields:**

    - `variables`: name, bounds, unit and scaling of each of the n variables.
    - `values`: shape (N, n) [SI]; on a grid the last variable runs fastest.
    - `shape`: (N,), or the grid's, one length a variable.
    - `kind`: of `KINDS`; `seed`: of the random ones.

    >>> samples = fj.sampling.sobol([fj.DesignVariable("mass", 2.0, 30.0, "kg")], 4)
    >>> samples.names, samples.count
    (('mass',), 4)
    """

    variables: tuple[DesignVariable, ...]
    values: np.ndarray
    shape: tuple[int, ...]
    kind: str
    seed: int | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The variables' names, in order."""
        return tuple(variable.name for variable in self.variables)

    @property
    def count(self) -> int:
        """N, the number of points."""
        return len(self.values)


def _resolved(variables: Sequence[str | DesignVariable]) -> tuple[DesignVariable, ...]:
    if isinstance(variables, (str, DesignVariable)) or len(variables) == 0:
        raise ValueError(
            "Argument `variables` must be a sequence of at least one name or DesignVariable, but "
            f'is {variables!r}. Write, for example, ["mass", "distance"].'
        )
    found = tuple(variable(v) if isinstance(v, str) else v for v in variables)
    names = [v.name for v in found]
    if len(set(names)) < len(names):
        raise ValueError(f"Argument `variables` must not repeat a name, but holds {names}.")
    return found


def _spread(variables: tuple[DesignVariable, ...], shares: np.ndarray) -> np.ndarray:
    """Values [SI] at shares of the ranges, (N, n)."""
    columns = []
    for v, share in zip(variables, shares.T, strict=True):
        if v.scaling == "linear":
            column = v.lower + (v.upper - v.lower) * share
        else:
            column = v.lower * np.exp(math.log(v.upper / v.lower) * share)
        # Rounding must not exceed a bound.
        columns.append(np.clip(column, v.lower, v.upper))
    return np.stack(columns, axis=1)


def grid(
    variables: Sequence[str | DesignVariable], counts: int | Sequence[int]
) -> Samples:
    """All combinations of `counts` values of each variable, bounds included, evenly spaced in the
    variable or, where its scaling is logarithmic, in its logarithm.

    **Arguments:**

    - `variables`: names with the default bounds of `fencejax.scenes.names`, or
      `DesignVariable`s (see `variable`).
    - `counts`: at least 2 each; one number serves for all.

    Raises `ValueError` for a repeated name, and where the counts do not fit the variables or the
    points this machine's memory.

    >>> mass = fj.DesignVariable("mass", 5.0, 20.0, "kg")
    >>> fj.sampling.grid([mass], [3]).values.ravel().round(3)
    array([ 5., 10., 20.])
    """
    chosen = _resolved(variables)
    numbers = [counts] * len(chosen) if isinstance(counts, (int, np.integer)) else list(counts)
    if len(numbers) != len(chosen):
        raise ValueError(
            f"Argument `counts` must hold a number for each of {[v.name for v in chosen]}, but "
            f"holds {len(numbers)}."
        )
    remedy = "A variable that has one value goes into `fixed`."
    shape = tuple(_check.count("counts", number, least=2, remedy=remedy) for number in numbers)
    _check.room("counts", math.prod(shape), len(shape))
    axes = [
        _spread((v,), np.linspace(0.0, 1.0, k)[:, None])[:, 0]
        for v, k in zip(chosen, shape, strict=True)
    ]
    mesh = np.meshgrid(*axes, indexing="ij")
    return Samples(chosen, np.stack([m.ravel() for m in mesh], axis=1), shape, "grid")


def latin_hypercube(
    variables: Sequence[str | DesignVariable], count: int, seed: int = 0
) -> Samples:
    """`count` random points, one in each of as many equal slices of every variable's range (after
    McKay, Beckman and Conover, 1979), by `scipy.stats.qmc.LatinHypercube`.

    Arguments and errors as of `grid`; `seed` at least 0.

    >>> mass = fj.DesignVariable("mass", 5.0, 20.0, "kg")
    >>> fj.sampling.latin_hypercube([mass], 8, seed=1).values.shape
    (8, 1)
    """
    from scipy.stats import qmc

    chosen = _resolved(variables)
    count, seed = _check.count("count", count, least=1), _check.count("seed", seed)
    _check.room("count", count, len(chosen))
    shares = qmc.LatinHypercube(len(chosen), rng=seed).random(count)
    return Samples(chosen, _spread(chosen, shares), (count,), "latin_hypercube", seed)


def sobol(variables: Sequence[str | DesignVariable], count: int, seed: int = 0) -> Samples:
    """The first `count` points of a scrambled Sobol sequence, by `scipy.stats.qmc.Sobol`: evenly
    spread, so that means converge nearly as 1 / count.

    Arguments and errors as of `grid`; `seed` at least 0. Raises `ValueError` where `count` is not
    a power of two: other numbers of points are not balanced.

    >>> mass = fj.DesignVariable("mass", 5.0, 20.0, "kg")
    >>> fj.sampling.sobol([mass], 8, seed=1).values.shape
    (8, 1)
    """
    from scipy.stats import qmc

    chosen = _resolved(variables)
    count, seed = _check.count("count", count, least=1), _check.count("seed", seed)
    power = count.bit_length() - 1
    if count != 1 << power:
        raise ValueError(
            f"Argument `count` must be a power of two for a Sobol sequence, but is {count}. Write "
            f"{1 << power} or {2 << power}."
        )
    _check.room("count", count, len(chosen))
    shares = qmc.Sobol(len(chosen), rng=seed).random_base2(power)
    return Samples(chosen, _spread(chosen, shares), (count,), "sobol", seed)


def given(values: Mapping[str, ArrayLike]) -> Samples:
    """Points of one's own: `values` holds a column [SI] of N numbers a variable.

    Raises `ValueError` where columns differ in length, hold what is not finite, or do not vary.

    >>> fj.sampling.given({"mass": [5.0, 15.0], "distance": [0.8, 1.0]}).values
    array([[ 5. ,  0.8],
           [15. ,  1. ]])
    """
    columns = {name: np.asarray(column, dtype=float) for name, column in values.items()}
    if not columns:
        raise ValueError("Argument `values` must hold a column at least, but is empty.")
    lengths = {column.shape for column in columns.values()}
    if len(lengths) > 1 or any(column.ndim != 1 for column in columns.values()):
        raise ValueError(
            "Argument `values` must hold columns of one length, but they have the shapes "
            f"{ {name: column.shape for name, column in columns.items()} }."
        )
    chosen = []
    for name, column in columns.items():
        if not np.all(np.isfinite(column)):
            raise ValueError(
                f"Argument `values[{name!r}]` must be finite, but holds "
                f"{column[~np.isfinite(column)][0]}."
            )
        if column.size == 0 or column.min() == column.max():
            raise ValueError(
                f"Argument `values[{name!r}]` must vary, but does not. A variable that has one "
                "value goes into `fixed`."
            )
        low, high = float(column.min()), float(column.max())
        chosen.append(variable(name, low, high, scaling="linear"))
    table = np.stack(list(columns.values()), axis=1)
    return Samples(tuple(chosen), table, (len(table),), "given")
