"""Errors of values and gradients against a reference, and their statistics over scenes."""

import dataclasses

import numpy as np

import fencejax as fj

from .cases import QUANTITIES, VARIABLES


@dataclasses.dataclass(frozen=True, eq=False)
class Outcome:
    """The results of a fidelity over a family of n scenes.

    `values` (n, 3) [SI], by `QUANTITIES`; `slopes` (n, 3, 8), elasticities d ln Q / d ln p [1] by
    `QUANTITIES` and `VARIABLES`, or `None` where only values were asked for; `status` (n,).
    """

    values: np.ndarray
    slopes: np.ndarray | None
    status: np.ndarray

    def first(self, lanes: int) -> "Outcome":
        """The first scenes alone."""
        slopes = None if self.slopes is None else self.slopes[:lanes]
        return Outcome(self.values[:lanes], slopes, self.status[:lanes])

    @property
    def sound(self) -> np.ndarray:
        """(n,) whether the numbers are good within the fidelity's error."""
        return self.status <= fj.Status.LEFT_OVER_TIP


@dataclasses.dataclass(frozen=True, eq=False)
class Errors:
    """Relative errors of n scenes: of `value` (n, 3), |Q - Q*| / |Q*|; of `gradient` (n, 3),
    |e - e*| / |e*| with e the vector of elasticities; of each `component` (n, 3, 8),
    |e_j - e*_j| / |e*|; and of each by itself, `own` (n, 3, 8), |e_j - e*_j| / |e*_j|, components
    below 2 % of |e*| being taken as that large. Without slopes the last three are `None`."""

    value: np.ndarray
    gradient: np.ndarray | None
    component: np.ndarray | None
    own: np.ndarray | None


def compare(found: Outcome, truth: Outcome) -> Errors:
    """Errors of `found` against `truth`, over the scenes that are sound in the latter.

    Raises `ValueError` where they do not hold the same number of scenes, or where none is sound.
    """
    if len(found.values) != len(truth.values):
        raise ValueError(
            f"Arguments `found` and `truth` must hold the same scenes, but hold "
            f"{len(found.values)} and {len(truth.values)}."
        )
    sound = truth.sound
    if not sound.any():
        raise ValueError(
            "Argument `truth` must hold a sound scene, but the statuses are "
            f"{[fj.Status(int(s)).name for s in np.unique(truth.status)]}."
        )
    value = np.abs(found.values[sound] / truth.values[sound] - 1)
    if found.slopes is None or truth.slopes is None:
        return Errors(value, None, None, None)
    exact = truth.slopes[sound]
    off = np.abs(found.slopes[sound] - exact)
    size = np.linalg.norm(exact, axis=2, keepdims=True)
    gradient = np.linalg.norm(off, axis=2) / size[..., 0]
    return Errors(value, gradient, off / size, off / np.maximum(np.abs(exact), 0.02 * size))


def spread(errors: np.ndarray) -> dict[str, float]:
    """Median, 95 % quantile and largest over scenes, errors of shape (n,); errors that are
    not finite count as infinite."""
    given = np.where(np.isfinite(errors), errors, np.inf)
    quantile = np.quantile(given, 0.95, method="higher")
    return {
        "median": float(np.quantile(given, 0.5, method="lower")),
        "95 %": float(quantile),
        "worst": float(given.max()),
    }


def summary(errors: Errors) -> dict:
    """Statistics over scenes by quantity: of the value, of the gradient and of its components."""
    rows: dict = {}
    for k, quantity in enumerate(QUANTITIES):
        row: dict = {"value": spread(errors.value[:, k])}
        if errors.gradient is not None:
            assert errors.component is not None
            assert errors.own is not None
            row["gradient"] = spread(errors.gradient[:, k])
            row["components"] = {
                name: {
                    "of the norm": spread(errors.component[:, k, j]),
                    "of its own": spread(errors.own[:, k, j]),
                }
                for j, name in enumerate(VARIABLES)
            }
        rows[quantity] = row
    return rows
