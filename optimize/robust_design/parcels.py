"""Random samples of parcels and their encounters."""

import numpy as np
from scipy.stats import qmc

from ..common import machine
from ..common.encounters import Encounter
from .configuration import LINEAR, LOGARITHMIC, RobustConfig

_STIFFNESS, _DAMPING = 1.72e9, 3.3e5
FRESH = 1
"""The random stream of the fresh sample; 0 is that of the search's sample, those from 2 on are of
the batches."""


def draw(config: RobustConfig, count: int, stream: int) -> Encounter:
    """`count` encounters with independent numbers, each uniform over its span (in the logarithm
    for mass and stiffness).

    The sample and the batches are scrambled Sobol points, which cover the spans more evenly; the
    fresh sample is drawn at random, so that its intervals are those of independent parcels. With a
    sorter file the parcels are that file's: distributed, listed with weights, or both.
    """
    if config.machine is not None:
        return _of_sorter(config, count, stream)
    names = (*LOGARITHMIC, *LINEAR)
    generator = np.random.default_rng((config.seed, stream))
    if stream == FRESH:
        shares = generator.random((count, len(names)))
    else:
        power = int(np.ceil(np.log2(max(count, 2))))
        engine = qmc.Sobol(len(names), rng=generator)
        shares = engine.random_base2(power)[:count]
    columns = {}
    for name, share in zip(names, shares.T, strict=True):
        low, high = getattr(config, name)
        columns[name] = low * (high / low) ** share if name in LOGARITHMIC else (
            low + (high - low) * share
        )
    columns["damping"] = _DAMPING * (columns["stiffness"] / _STIFFNESS) ** 0.6
    return Encounter(**columns).wide()


def ends(config: RobustConfig) -> Encounter:
    """The encounters with every number at the lower and at the upper end of its span; of a sorter
    file, its first parcel."""
    if config.machine is not None:
        found = Encounter.of(config.machine)
        return Encounter(*(np.asarray(part)[:1] for part in found))
    return Encounter(**{
        name: np.array(getattr(config, name)) for name in (*LOGARITHMIC, *LINEAR)
    }).wide()  # fmt: skip


def _of_sorter(config: RobustConfig, count: int, stream: int) -> Encounter:
    """`count` parcels of a sorter file. Its distributions are drawn anew; of the parcels that it
    lists, each at every place that it lists, one is drawn by its weight for each."""
    given = tuple(t for t in config.set if not t.startswith(("parcels.count=", "parcels.seed=")))
    # One draw leaves the listed parcels at their places.
    listed = machine.once(config.sorter, (*given, "parcels.count=1"), config.free)
    sizes = (f"parcels.count={count}", f"parcels.seed={1000 * config.seed + stream}")
    weights = listed.parcels.weights
    found = machine.load(config.sorter, (*given, *sizes), config.free).machine
    if found.parcels.count == 1:
        raise ValueError(
            "Argument `parcels` of the sorter file must describe several parcels, with weights, or "
            "distributions, but describes one parcel at one place. Write, for example, "
            'file = "parcels.csv", or mass = {distribution = "lognormal", median = "4 kg", '
            'spread = 0.8, upper = "30 kg"}.'
        )
    lanes = _rows(weights, config, count, stream)
    if found.parcels.count > weights.size:
        # Of every listed parcel there are all draws.
        lanes = lanes * count + np.arange(count)
    return Encounter(*(np.asarray(part)[lanes] for part in Encounter.of(found)))


def _rows(weights: np.ndarray, config: RobustConfig, count: int, stream: int) -> np.ndarray:
    """`count` rows by their weights, in random order: at random for the fresh sample, and
    stratified otherwise, one in each of `count` equal parts of all weight."""
    generator = np.random.default_rng((config.seed, stream))
    shares = generator.random(count)
    if stream != FRESH:
        shares = (generator.permutation(count) + shares) / count
    ends = np.cumsum(weights)
    return np.searchsorted(ends / ends[-1], shares, side="right")
