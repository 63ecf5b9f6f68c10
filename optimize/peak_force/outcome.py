"""The results of the job."""

import dataclasses
from typing import Any

import numpy as np

from fencejax.design import DesignSpace, Limit, Optimum, Quantity


@dataclasses.dataclass(frozen=True)
class Outcome:
    """The results of the job: the optimum, the designs [SI], measurements, and their verification.

    `measured` has, one number an impact, the optimiser's own numbers (`found`) and those of the
    finer fidelity for the paper's two-link fence (`before`), the optimum (`after`) and the paper's
    one-link fence (`one_link`); `sorts` has the whole sorts of these three.
    """

    optimum: Optimum
    space: DesignSpace
    before: np.ndarray
    after: np.ndarray
    measured: dict[str, dict[str, Any]]
    sorts: dict[str, dict[str, Any]]
    stiff: np.ndarray
    confirmed: bool | None
    sorted_out: bool | None
    limits: tuple[Limit, ...]
    objective: Quantity
    elapsed: float

    @property
    def succeeded(self) -> bool:
        """Whether it converged, is feasible, and agrees with the reference and the whole sorts."""
        stands = self.confirmed is not False and self.sorted_out is not False
        return self.optimum.converged and self.optimum.feasible and stands
