"""The results of the job."""

import dataclasses

import numpy as np

from fencejax.design import Optimum, Verification

from .configuration import CoDesignConfig
from .problem import Joint


@dataclasses.dataclass(frozen=True)
class Outcome:
    """The results of the job: `tried`, those of the first searches, empty for a single start, and
    `optimum`, that of the search that was continued; the designs [SI] before and after, both
    `measured` at the finer fidelity, and its verdict, `verified`; `stiff`, the largest force [N]
    by a rigid fence of the shape after, and `push`, the constant force [N] that the hardest parcel
    would need."""

    config: CoDesignConfig
    joint: Joint
    tried: tuple[Optimum, ...]
    optimum: Optimum
    before: np.ndarray
    after: np.ndarray
    measured: dict[str, dict[str, np.ndarray]]
    verified: Verification
    stiff: float
    push: float
    elapsed: float

    @property
    def succeeded(self) -> bool:
        """Feasible, sought to the end and confirmed by the finer fidelity."""
        ended = self.optimum.stop.name in ("OPTIMAL", "STAGNATED")
        return self.optimum.feasible and ended and self.verified.confirmed
