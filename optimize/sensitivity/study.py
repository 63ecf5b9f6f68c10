"""The computation of elasticities at points and along a line, and of shares of variance."""

from typing import NamedTuple

import numpy as np

import fencejax as fj
from fencejax.scenes import numbers as scene_numbers
from fencejax.study import (
    CountProgress,
    DerivativeMeasures,
    Design,
    Response,
    SobolIndices,
    sensitivity,
)


class Local(NamedTuple):
    """A local study at P points: `values` (P, m) and `elasticity` in the n inputs, (P, m, n) [1];
    the residuals of the unit rules, (P, m, 3) [1]; statuses (P,)."""

    values: np.ndarray
    elasticity: np.ndarray
    rules: np.ndarray
    status: np.ndarray


class Samples(NamedTuple):
    """Values at the points of a design, (K, m), (K, m) and (n, K, m); slopes in u at the first of
    them, (G, m, n); counts of statuses."""

    design: Design
    first: np.ndarray
    second: np.ndarray
    mixed: np.ndarray
    slopes: np.ndarray
    counts: dict[str, int]


class Global(NamedTuple):
    """Sobol' indices, bounds on the total ones, and whether they are consistent: no bound is below
    its index by more than both intervals allow."""

    indices: SobolIndices
    measures: DerivativeMeasures
    consistent: bool


def local(
    response: Response, names: tuple[str, ...], places: list[dict[str, float]],
    progress: CountProgress | None = None,
) -> Local:  # fmt: skip
    """Elasticities in `names` at places where some numbers differ from the scene's own.

    The places of one call differ in the same numbers.
    """
    scene = response.scene
    given = np.array([list(place.values()) for place in places])
    lanes = np.asarray(scene_numbers.values(scene))[None]
    if given.size:
        lanes = scene_numbers.vary(scene, tuple(places[0]), given)
    batch = response.slopes(lanes, progress=progress)
    assert batch.slopes is not None
    everything = sensitivity.elasticities(batch.values, batch.slopes, lanes)
    rules = sensitivity.unit_rules(
        everything,
        [scene_numbers.number(scene, name).unit for name in response.names],
        [quantity.unit for quantity in response.quantities],
    )
    chosen = sensitivity.elasticities(
        batch.values,
        scene_numbers.slopes_in(scene, names, lanes, batch.slopes),
        scene_numbers.named(scene, names, lanes),
    )
    return Local(batch.values, chosen, rules, batch.status)


def sample(
    response: Response, inputs: tuple[fj.DesignVariable, ...], count: int, gradients: int,
    seed: int, progress: CountProgress | None = None,
) -> Samples:  # fmt: skip
    """Values at all points of a design, slopes at the first `gradients` of them."""
    design = sensitivity.design(len(inputs), count, seed)
    names = tuple(variable.name for variable in inputs)
    points = np.concatenate([design.first, design.second, *design.mixed])
    rows, spans = _scaled(inputs, points)
    batch = response.values(scene_numbers.vary(response.scene, names, rows), progress=progress)
    first, second, *mixed = np.split(batch.values, len(inputs) + 2)
    sloped = response.slopes_in(names, rows[:gradients])
    assert sloped.slopes is not None
    slopes = sloped.slopes * spans[:gradients, None, :]
    return Samples(design, first, second, np.stack(mixed), slopes, batch.counts())


def _scaled(inputs, points):
    """Values p of points u, and dp/du; (P, n) each."""
    columns, slopes = [], []
    for variable, u in zip(inputs, points.T, strict=True):
        value = np.asarray(variable.value(u))
        columns.append(value)
        if variable.scaling == "linear":
            slopes.append(np.full_like(value, variable.upper - variable.lower))
        else:
            slopes.append(value * np.log(variable.upper / variable.lower))
    return np.stack(columns, axis=1), np.stack(slopes, axis=1)


def judge(samples: Samples, confidence: float, resamples: int, seed: int) -> Global:
    """Indices and bounds of a sample.

    Raises `ValueError` where a lane is not finite.
    """
    settings = {"confidence": confidence, "resamples": resamples, "seed": seed}
    indices = sensitivity.sobol_indices(samples.first, samples.second, samples.mixed, **settings)
    count = len(samples.slopes)
    measures = sensitivity.derivative_measures(samples.first[:count], samples.slopes, **settings)
    consistent = bool(np.all(measures.bound.high >= indices.total.low))
    return Global(indices, measures, consistent)
