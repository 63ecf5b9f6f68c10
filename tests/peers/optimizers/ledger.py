"""What a run has computed, in simulation-equivalents, and the best it knew at every cost."""

import dataclasses

import numpy as np

from .tasks import FEASIBLE, Task


class SpentError(Exception):
    """The budget is spent: thrown through a method that knows of no budget."""


@dataclasses.dataclass
class Ledger:
    """Counts a run: a value costs 1, a value with its Jacobian costs `task.price`.

    Each distinct point is computed and counted once. Where a method asks for the value of a point
    first and for its gradient after that, the point costs `task.price` in all, as if it had known.
    """

    task: Task
    budget: float
    cost: float = 0.0
    points: int = 0
    trail: list[tuple[float, float, float]] = dataclasses.field(default_factory=list)
    _values: dict = dataclasses.field(default_factory=dict)
    _rows: dict = dataclasses.field(default_factory=dict)

    def add(self, cost: float, worst: float, violation: float) -> None:
        """Count an evaluation: worst case [N] and largest violation [1]."""
        self.cost += cost
        self.points += 1
        self.trail.append((self.cost, worst, violation))

    def value(self, share: np.ndarray) -> tuple[float, np.ndarray]:
        """Worst case over the scale and margins; a failed evaluation is infinitely bad."""
        share = np.array(share, dtype=float)
        key = share.tobytes()
        if key in self._rows:
            found = self._rows[key]
            return float(np.max(found.objectives)), found.margins
        if key not in self._values:
            if self.cost >= self.budget:
                raise SpentError
            worst, margins, failed = self.task.numbers(share)
            if failed:
                worst, margins = 1e3, np.full(margins.size, -1e3)
            self._values[key] = worst, margins
            missing = np.inf if failed else float(np.max(-margins, initial=0.0))
            self.add(1.0, worst * self.task.scale, missing)
        return self._values[key]

    def rows(self, share: np.ndarray):
        """Everything with derivatives in the shares."""
        share = np.array(share, dtype=float)
        key = share.tobytes()
        if key not in self._rows:
            if self.cost >= self.budget:
                raise SpentError
            found = self.task.rows(share)
            known = key in self._values
            self._rows[key] = found
            worst = float(np.max(found.objectives)) * self.task.scale
            missing = float(np.max(-found.margins, initial=0.0))
            if self.task.failed(found):
                missing = np.inf
            self.points -= known
            self.add(self.task.price - known, worst, missing)
        return self._rows[key]

    def best(self) -> tuple[np.ndarray, np.ndarray]:
        """Costs, and the best feasible worst case [N] known then; infinite before the first."""
        if not self.trail:
            return np.zeros(1), np.full(1, np.inf)
        cost, worst, violation = np.array(self.trail).T
        return cost, np.minimum.accumulate(np.where(violation <= FEASIBLE, worst, np.inf))

    def reached(self, value: float) -> float:
        """The cost at which a feasible design of at most `value` [N] was known; infinite where
        none was."""
        cost, best = self.best()
        there = np.flatnonzero(best <= value)
        return float(cost[there[0]]) if there.size else float("inf")
