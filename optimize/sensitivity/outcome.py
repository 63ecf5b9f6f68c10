"""The results of the job."""

import dataclasses

import numpy as np

from .study import Global, Local, Samples

MASS_TOLERANCE = 0.01
"""The largest residual of the rule of mass [1]. A step's implicit equations are differentiated with
an approximate matrix: at the fast fidelity this causes errors of elasticities up to a few
thousandths."""


@dataclasses.dataclass(frozen=True)
class Outcome:
    """The results of the study: `points` and `line` have a row for each place; where the sample is
    unusable, `shares` is `None` and `refused` the reason."""

    names: tuple[str, ...]
    points: dict[str, Local]
    at: np.ndarray
    line: Local | None
    samples: Samples
    shares: Global | None
    refused: str
    elapsed: dict[str, float]

    @property
    def balanced(self) -> bool:
        """Whether the rule of mass holds at every point."""
        left = [np.abs(found.rules[..., 0]) for found in self.points.values()]
        return all(bool(np.all(one <= MASS_TOLERANCE)) for one in left)

    @property
    def succeeded(self) -> bool:
        """Whether all numbers are finite, the rule of mass holds, and no index is above its
        bound."""
        return self.balanced and self.shares is not None and self.shares.consistent
