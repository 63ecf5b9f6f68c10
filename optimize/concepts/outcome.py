"""The results of the job."""

import dataclasses

import numpy as np

from fencejax.sorter import constant_push

from .configuration import ConceptsConfig
from .problem import Group
from .quantities import FORCE, LOAD
from .search import Point


@dataclasses.dataclass(frozen=True)
class Outcome:
    """The results of the job: the points of every concept, the numbers of searches and evaluations,
    how many of these were recalled from journals, and the time [s]."""

    config: ConceptsConfig
    groups: list[Group]
    points: list[Point]
    searches: int
    evaluations: int
    recalled: int
    elapsed: float

    def of(self, minimised: str, rate: float) -> list[Point]:
        """The points for a quantity at a rate: the confirmed ones first, by the objective; then the
        others, by their violation."""
        found = [p for p in self.points if (p.minimised, p.rate) == (minimised, rate)]
        return sorted(found, key=lambda p: (not p.confirmed, p.solution.rank))

    def winner(self, minimised: str, rate: float) -> Point | None:
        """The confirmed point with the least objective; `None` where there is none."""
        first = self.of(minimised, rate)[:1]
        return first[0] if first and first[0].confirmed else None

    def group(self, point: Point) -> Group:
        """The group of a point's concept."""
        return next(group for group in self.groups if point.concept in group.concepts)

    def push(self, point: Point) -> float:
        """The constant force [N] that the hardest parcel would need instead of a point's fence."""
        return float(np.max(constant_push(self.group(point).problem, point.solution)))

    @property
    def minimised(self) -> tuple[str, ...]:
        """The names of the minimised quantities."""
        return (FORCE.name, LOAD.name) if self.config.load else (FORCE.name,)

    @property
    def succeeded(self) -> bool:
        """Whether there is a winner for every quantity at every rate."""
        return all(self.winner(n, rate) for n in self.minimised for rate in self.config.paces)
