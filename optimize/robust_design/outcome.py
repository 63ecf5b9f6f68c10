"""The results of the job."""

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
    """The results of the job: the designs [SI], their judgements, the ratio of the measure after to
    that before on the same fresh parcels, and `stiff`, the measure of a rigid fence of the shape
    after."""

    config: RobustConfig
    found: Found
    before: np.ndarray
    after: np.ndarray
    judged: dict[str, Judgement]
    ratio: confidence.Interval
    stiff: float
    elapsed: float

    @property
    def limits_hold(self) -> bool:
        """Whether the fresh sample is consistent with each limit holding for the stated
        fraction."""
        shares = self.judged["after"].shares.values()
        return all(s.upper >= self.config.fraction for s in shares)

    @property
    def succeeded(self) -> bool:
        """Whether the search ended as intended, the limits hold, and few parcels were left out."""
        few = self.judged["after"].excluded <= self.config.excluded_most
        return self.found.ended and self.limits_hold and few
