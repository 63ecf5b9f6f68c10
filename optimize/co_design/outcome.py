"""What the job found."""

import dataclasses

import numpy as np

from fencejax.design import Optimum, Verification

from .configuration import CoDesignConfig
from .problem import Joint


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What the job found: what the searches from several starts came to, none where there is one,
    and the one that was gone on with; the designs [SI], the one given and the one found, both
    measured at the finer fidelity, its verdict; the largest force [N] of a fence that does not
    bend, of the shape after, and what a constant push of the hardest parcel would need [N]."""

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
