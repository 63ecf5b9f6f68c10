"""What the job found."""

import dataclasses

import numpy as np

from .configuration import ParetoConfig
from .problem import Tradeoff
from .trace import Point


@dataclasses.dataclass(frozen=True)
class Front:
    """What the job found: the points, which of them are on the front, the bound of each [N], how
    many evaluations it took, and the largest force [N] of a fence that does not bend, of the shape
    at the front's knee, or `None` where there is none."""

    config: ParetoConfig
    tradeoff: Tradeoff
    points: list[Point]
    on_front: np.ndarray
    least_force: np.ndarray
    evaluations: int
    elapsed: float
    stiff: float | None = None

    @property
    def knee(self) -> int | None:
        """The place of the point that is furthest on the good side of the line between the front's
        ends, both axes taken over their ranges; `None` where there is no front."""
        kept = np.flatnonzero(self.on_front)
        if kept.size < 2:
            return None
        plane = np.array([(self.points[k].other, self.points[k].force) for k in kept])
        spans = np.ptp(plane, axis=0)
        if not np.all(spans > 0):
            return int(kept[0])
        return int(kept[np.argmin(np.sum((plane - plane.min(axis=0)) / spans, axis=1))])

    @property
    def succeeded(self) -> bool:
        """At least two points on the front, all of them feasible, sought to the end and
        confirmed."""
        kept = [p for p, good in zip(self.points, self.on_front, strict=True) if good]
        return len(kept) >= 2 and all(p.sound for p in kept)
