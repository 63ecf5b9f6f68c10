"""The results of the job."""

import dataclasses

import numpy as np

from .study import Global, Local, Samples

MASS_TOLERANCE = 0.01
"""What the rule of mass may leave over [1]. A step's implicit equations are differentiated with a
matrix close to their own: at the fast fidelity this costs an elasticity up to a few thousandths."""


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What the study found: `points` and `line` hold a row for each place; `shares` is `None`, and
    `refused` says why, where the sample was no use."""

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
        """Every number finite, the rule of mass obeyed, no index above its bound."""
        return self.balanced and self.shares is not None and self.shares.consistent
