"""What the job found."""

import dataclasses

import numpy as np

from .configuration import ParetoConfig
from .problem import Tradeoff
from .trace import Point


@dataclasses.dataclass(frozen=True)
class Front:
    """What the job found: the points, which of them are on the front, the bound of each [N], and
    how many evaluations it took."""

    config: ParetoConfig
    tradeoff: Tradeoff
    points: list[Point]
    on_front: np.ndarray
    least_force: np.ndarray
    evaluations: int
    elapsed: float

    @property
    def succeeded(self) -> bool:
        """At least two points on the front, all of them feasible, sought to the end and
        confirmed."""
        kept = [p for p, good in zip(self.points, self.on_front, strict=True) if good]
        return len(kept) >= 2 and all(p.sound for p in kept)
