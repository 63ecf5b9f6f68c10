"""What the job found."""

import dataclasses
from typing import Any

import numpy as np

from fencejax.design import DesignSpace, Limit, Optimum, Quantity


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What the job found: the optimum, the designs [SI], measurements, and whether it stands.

    `measured` holds, one number an impact, what the optimiser found (`found`) and what the finer
    fidelity says of the paper's two-link fence (`before`), the optimum (`after`) and the paper's
    one-link fence (`one_link`); `sorts` the whole sorts of these three.
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
        """Converged, feasible, and not contradicted by the reference or by the whole sorts."""
        stands = self.confirmed is not False and self.sorted_out is not False
        return self.optimum.converged and self.optimum.feasible and stands
