"""The outcome of an optimisation: its summary, and the shadow prices of limits and bounds."""

import dataclasses
import enum
from collections.abc import Sequence

import numpy as np

from ..printing import Readable, Table, shown
from .evaluator import Record
from .lagrangian import Evaluation, Multipliers, Residual, Vector
from .objectives import Limit
from .prices import NEGLIGIBLE, ShadowPrices, prices
from .variables import DesignSpace


class Stop(enum.Enum):
    """Why an optimisation ended.

    >>> fj.Stop.BUDGET.value
    'the budget of evaluations is spent'
    """

    OPTIMAL = "the conditions of Karush, Kuhn and Tucker hold within the tolerance"
    INFEASIBLE = "no feasible design found: the violation falls no further"
    STAGNATED = "no further progress, short of the tolerance"
    BUDGET = "the budget of evaluations is spent"
    FAILED_START = "the first design cannot be evaluated; see its status"


@dataclasses.dataclass(frozen=True, repr=False)
class Optimum(Readable):
    """The outcome of `minimize`.

    **Fields:**

    - `first`, `last`: the evaluations at the start and at the end, their objectives divided by
      `scale`. Where no feasible design was found, `last` is the one with the smallest violation.
    - `weights`: share of each objective in the worst case's gradient [1].
    - `multipliers`: of the margins: the rate at which the worst case (over `scale`) grows with the
      margin that is demanded.
    - `scale`: what the objectives were divided by.
    - `residual`: stationarity, complementarity and violation at `last`. Where `"sqp"` ends on a
      kink, they take in the slopes on the kink's other sides, evaluated at points within a
      hundredth of the ranges.
    - `stop`, `feasible`: why it ended; whether all limits hold.
    - `history`: every evaluation.
    - `on_kink`: whether the conditions hold only with the slopes on all sides of a kink. The
      residuals in `history` are of single evaluations and leave those slopes out.

    >>> optimum = fj.minimize(lambda z: (z**2, z - 0.5, jnp.zeros(1, int)), [0.9])
    >>> optimum.point.round(4), optimum.stop.name, optimum.converged
    (array([0.5]), 'OPTIMAL', True)
    """

    first: Evaluation
    last: Evaluation
    weights: Vector
    multipliers: Vector
    scale: float
    residual: Residual
    stop: Stop
    feasible: bool
    history: tuple[Record, ...]
    on_kink: bool = False

    @property
    def ended(self) -> str:
        """Why it ended, in words."""
        sides = ", with the slopes on the sides of a kink that it ends on" if self.on_kink else ""
        return self.stop.value + sides

    @property
    def point(self) -> Vector:
        """The design z, shape (n,)."""
        return self.last.point

    @property
    def objectives(self) -> Vector:
        """Every objective there, in its own unit."""
        return self.last.objectives * self.scale

    @property
    def objective(self) -> float:
        """The worst case there, in the objective's own unit."""
        return self.last.worst * self.scale

    @property
    def margins(self) -> Vector:
        """Every margin there [1]."""
        return self.last.margins

    @property
    def converged(self) -> bool:
        """Whether the point meets the conditions of Karush, Kuhn and Tucker."""
        return self.stop is Stop.OPTIMAL

    def _printed(self) -> Table:
        return self.summary()

    def summary(
        self, space: DesignSpace | None = None, margins: Sequence[str | Limit] = (),
        unit: str = "1",
    ) -> Table:  # fmt: skip
        """A table of the outcome, ready to print: why the search ended, the worst case before and
        after, the design, and the active limits and bounds with their shadow prices.

        **Arguments:**

        - `space`: gives the variables' names and units; without it they are printed as shares.
        - `margins`: the limits, or their names, in the order of the margins; by default the
          margins are numbered.
        - `unit`: of the objective.

        Raises `ValueError` where the number of `margins` or of the variables of `space` is wrong.
        """
        count, size = self.margins.size, self.point.size
        names = tuple(margins) or tuple(f"margin {k}" for k in range(count))
        titles = tuple(f"z[{k}]" for k in range(size)) if space is None else space.names
        if len(names) != count or len(titles) != size:
            raise ValueError(
                f"Arguments `margins` and `space` must name the {count} margins and {size} "
                f"variables of this optimum, but name {len(names)} and {len(titles)}."
            )
        feasible = "all limits hold" if self.feasible else (
            f"no design that holds all limits: the nearest breaks one by "
            f"{100 * self.residual.violation:.3g} %"
        )  # fmt: skip
        rows = [
            ("ended", self.ended),
            ("limits", feasible),
            ("worst case", f"{shown(self.first.worst * self.scale, unit)} at the start, "
             f"{shown(self.objective, unit)} found"),
            ("evaluations", str(len(self.history))),
        ]  # fmt: skip
        if space is None:
            values = [shown(share) for share in self.point]
        else:
            found = np.asarray(space.from_shares(self.point))
            values = [shown(x, v.unit) for v, x in zip(space.variables, found, strict=True)]
        rows += [(title, value) for title, value in zip(titles, values, strict=True)]
        return Table("Optimum", (*rows, *self._deciding(names, titles, unit)))

    def _deciding(self, limits, titles, unit: str) -> list[tuple[str, str]]:
        """The limits and bounds whose relaxation would lower the worst case, the most effective
        first."""
        if not np.isfinite(self.last.violation):
            return []
        found = shadow_prices(self)
        rates = [
            *((rate, f"{_named(limit)} limits the design", _relaxed(limit))
              for rate, limit in zip(found.margins, limits, strict=True)),
            *((rate, f"lower bound of {name} limits the design", "1 % of the range beyond it")
              for rate, name in zip(found.lower, titles, strict=True)),
            *((rate, f"upper bound of {name} limits the design", "1 % of the range beyond it")
              for rate, name in zip(found.upper, titles, strict=True)),
        ]  # fmt: skip
        most = max((rate for rate, *_ in rates), default=0.0)
        active = sorted((r for r in rates if r[0] > NEGLIGIBLE * most), key=lambda r: -r[0])
        if not active:
            return [("", "no limit and no bound decides")]
        return [
            (name, f"{shown(0.01 * rate, unit, 3)} saved for each {step}")
            for rate, name, step in active
        ]


def _named(limit: str | Limit) -> str:
    return limit if isinstance(limit, str) else limit.name


def _relaxed(limit: str | Limit) -> str:
    """The step, a hundredth of the margin's unit, for which a saving is stated."""
    if isinstance(limit, str):
        return "1 % it is relaxed by (of its bound or scale)"
    return f"{shown(0.01 * limit.unit_of_margin, limit.quantity.unit)} it is relaxed by"


def shadow_prices(optimum: Optimum) -> ShadowPrices:
    """The prices of limits and bounds at an optimum, in the objective's own unit."""
    multipliers = Multipliers(optimum.weights, optimum.multipliers)
    return prices(optimum.last, multipliers, optimum.scale)
