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
    fresh sample is drawn at random, so that its intervals are those of independent parcels.
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
    """`count` parcels of a sorter file, drawn anew from its distributions."""
    sizes = (f"parcels.count={count}", f"parcels.seed={1000 * config.seed + stream}")
    given = tuple(t for t in config.set if not t.startswith(("parcels.count=", "parcels.seed=")))
    found = machine.load(config.sorter, (*given, *sizes), config.free).machine
    if found.parcels.count != count:
        raise ValueError(
            "Argument `parcels` of the sorter file must be distributions, with one place or places "
            f"that are distributed, too, but describes {found.parcels.count} parcels for each "
            f"{count} that are drawn. Write, for example, mass = {{distribution = \"lognormal\", "
            'median = "4 kg", spread = 0.8, upper = "30 kg"}.'
        )
    return Encounter.of(found)
