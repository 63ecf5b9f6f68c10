"""What the job found."""

import dataclasses

import numpy as np

from . import confidence
from .configuration import RobustConfig
from .descent import Found


@dataclasses.dataclass(frozen=True)
class Judgement:
    """A design on the fresh sample: intervals of the measures of the severity by name, of the
    share of parcels that hold each limit, the statuses by name, the share left out."""

    measures: dict[str, confidence.Interval]
    shares: dict[str, confidence.Interval]
    statuses: dict[str, int]
    excluded: float
    lanes: dict[str, np.ndarray]


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What the job found: the designs [SI], their judgements, and the ratio of the measure after
    to that before, on the same fresh parcels; and the measure after of a fence of that shape that
    does not bend."""

    config: RobustConfig
    found: Found
    before: np.ndarray
    after: np.ndarray
    judged: dict[str, Judgement]
    ratio: confidence.Interval
    stiff: float
    elapsed: float

    @property
    def held(self) -> bool:
        """Whether the fresh sample does not contradict that each limit holds for the fraction."""
        shares = self.judged["after"].shares.values()
        return all(s.upper >= self.config.fraction for s in shares)

    @property
    def succeeded(self) -> bool:
        """The search ended as it should, the limits hold, few parcels had to be left out."""
        few = self.judged["after"].excluded <= self.config.excluded_most
        return self.found.ended and self.held and few
