"""The results of the job."""

import dataclasses

from fencejax.sorter import Solution, SorterProblem

from .configuration import DesignConfig


@dataclasses.dataclass(frozen=True)
class Outcome:
    """The results of the job: a solution for each candidate, the best first; `stiff`, the objective
    of a rigid fence of the best one's shape; and `push`, where the objective is a force, the
    constant force [N] that the parcels would need. Both are of the objective's measure over the
    parcels."""

    config: DesignConfig
    problem: SorterProblem
    solutions: list[Solution]
    stiff: float
    push: float | None
    elapsed: float

    @property
    def best(self) -> Solution:
        """The first in rank."""
        return self.solutions[0]

    @property
    def succeeded(self) -> bool:
        """Whether the best design holds every limit and the finer fidelity confirms it."""
        verified = self.best.verified
        return self.best.feasible and (verified is None or verified.confirmed)
