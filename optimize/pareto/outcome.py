"""The results of the job."""

import dataclasses

import numpy as np

from .configuration import ParetoConfig
from .problem import Tradeoff
from .trace import Point


@dataclasses.dataclass(frozen=True)
class Front:
    """The results of the job: the points, which of them are on the front, the constant-force bound
    of each [N], the number of evaluations, and `stiff`, the largest force [N] by a rigid fence of
    the shape at the front's knee, `None` without a front."""

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
        """The index of the point furthest on the good side of the line between the front's ends,
        with both axes scaled by their ranges, which is that of the least sum; the first one where
        an axis does not vary; `None` for fewer than two points."""
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
        """Whether the front has at least two points, all of them feasible, with a completed search
        and confirmed."""
        kept = [p for p, good in zip(self.points, self.on_front, strict=True) if good]
        return len(kept) >= 2 and all(p.sound for p in kept)
