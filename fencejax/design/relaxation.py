"""The gain from relaxing limits and bounds by a tenth: shadow prices times that step."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from .lagrangian import Vector
from .prices import NEGLIGIBLE, ShadowPrices
from .variables import DesignVariable

RELAXED = 0.1
"""The share by which a limit or a bound is relaxed to state its price; a limit of 0 is relaxed by
that share of its margin's unit."""


class Bounded(NamedTuple):
    """A limit: its `bound` [`unit`], the indices of its margins among all (m,), and the unit of its
    margins [`unit`]."""

    name: str
    bound: float
    unit: str
    unit_of_margin: float
    at_most: bool
    margins: Sequence[int]


class Relaxation(NamedTuple):
    """A limit or a bound, relaxed from `bound` to `relaxed` [`unit`]: `gain` is the decrease of the
    objective (or violation); `margins` are those of a limit that have a price."""

    name: str
    bound: float
    relaxed: float
    unit: str
    gain: float
    margins: tuple[int, ...]


def relaxations(
    limits: Sequence[Bounded],
    variables: Mapping[str, DesignVariable],
    prices: ShadowPrices,
    margins: Vector,
) -> list[Relaxation]:
    """The gain from relaxing each limit and each bound of a variable by `RELAXED` of itself, the
    largest first: its price times the step, to the first order and one at a time.

    `margins` (m,) are those of the design whose `prices` are given; `variables` are by the names
    that a report uses, in the order of the shares z. A bound of 0 belongs to the number itself and
    is not relaxed.
    """
    found: list[Relaxation] = []
    for limit in limits:
        step = RELAXED * (abs(limit.bound) or limit.unit_of_margin)
        # A search cut short may have a multiplier for a margin that is larger than the step of the
        # relaxation: such a margin does not count.
        near = [k for k in limit.margins if margins[k] * limit.unit_of_margin <= step]
        rate = sum(float(prices.margins[k]) for k in near)
        relaxed = limit.bound + (step if limit.at_most else -step)
        gain = rate * step / limit.unit_of_margin
        deciding = tuple(k for k in near if prices.margins[k] > 0)
        found.append(Relaxation(limit.name, limit.bound, relaxed, limit.unit, gain, deciding))
    for index, (name, variable) in enumerate(variables.items()):
        lower, upper, unit = variable.lower, variable.upper, variable.unit
        if lower != 0:
            below = lower - RELAXED * abs(lower)
            gain = -float(prices.lower[index]) * float(variable.share(below))
            found.append(Relaxation(f"lower bound of {name}", lower, below, unit, gain, ()))
        if upper != 0:
            above = upper + RELAXED * abs(upper)
            gain = float(prices.upper[index]) * (float(variable.share(above)) - 1)
            found.append(Relaxation(f"upper bound of {name}", upper, above, unit, gain, ()))
    most = max((one.gain for one in found), default=0.0)
    worth = (one for one in found if one.gain > NEGLIGIBLE * most)
    return sorted(worth, key=lambda one: -one.gain)
