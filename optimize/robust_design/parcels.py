"""Parcels as they come: a sample of encounters."""

import numpy as np
from scipy.stats import qmc

from ..common.encounters import Encounter
from .configuration import LINEAR, LOGARITHMIC, RobustConfig

_STIFFNESS, _DAMPING = 1.72e9, 3.3e5
FRESH = 1
"""The stream of the fresh sample; 0 is the sample's own, from 2 on come the batches."""


def draw(config: RobustConfig, count: int, stream: int) -> Encounter:
    """`count` encounters with independent numbers, each even over its span (of its logarithm for
    mass and stiffness).

    The sample and the batches are scrambled Sobol points, which cover the spans more evenly; the
    fresh sample is drawn at random, so that its intervals are those of independent parcels.
    """
    names = (*LOGARITHMIC, *LINEAR)
    generator = np.random.default_rng((config.seed, stream))
    if stream == FRESH:
        shares = generator.random((count, len(names)))
    else:
        power = int(np.ceil(np.log2(max(count, 2))))
        engine = qmc.Sobol(len(names), seed=generator)  # pyright: ignore[reportCallIssue]
        shares = engine.random_base2(power)[:count]
    columns = {}
    for name, share in zip(names, shares.T, strict=True):
        low, high = getattr(config, name)
        columns[name] = low * (high / low) ** share if name in LOGARITHMIC else (
            low + (high - low) * share
        )
    columns["damping"] = _DAMPING * (columns["stiffness"] / _STIFFNESS) ** 0.6
    return Encounter(**columns).wide()
