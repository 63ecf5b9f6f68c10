"""An optimum evaluated again, with a finer fidelity."""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike

from .. import _check
from ..printing import Readable, Table, shown
from ..results import Status
from .lagrangian import Vector
from .optimum import Optimum


@dataclasses.dataclass(frozen=True, repr=False)
class Verification(Readable):
    """The comparison of an optimum with a finer fidelity.

    **Fields:**

    - `objectives`, `margins`: at the optimum, with the finer fidelity.
    - `error`: the optimiser's worst case less the finer one's, relative to the latter [1].
    - `margin_error`: the largest difference of a margin [1].
    - `violation`: the largest violation at the finer fidelity [1].
    - `status`: the largest `Status` of the lanes.
    - `doubts`: the objections to the optimum, in words; empty where there are none.

    >>> problem = lambda z: (z**2, z - 0.5, jnp.zeros(1, int))
    >>> fj.verify(problem, fj.minimize(problem, [0.9])).doubts
    ()
    """

    objectives: Vector
    margins: Vector
    error: float
    margin_error: float
    violation: float
    status: int
    doubts: tuple[str, ...]

    @property
    def confirmed(self) -> bool:
        """Whether error, violation and status are within their bounds."""
        return not self.doubts

    @property
    def text(self) -> str:
        """`confirmed`, or the objections."""
        return "NOT confirmed, as " + "; ".join(self.doubts) if self.doubts else "confirmed"

    def _printed(self) -> Table:
        return Table("Verification", (
            ("verdict", self.text),
            ("worst case", f"{shown(self.objective)}; the search's is off by "
             f"{100 * self.error:+.2g} %"),
            ("margins", f"differ by up to {shown(self.margin_error)}"),
        ))  # fmt: skip

    @property
    def objective(self) -> float:
        """The worst case at the finer fidelity, in the objective's own unit."""
        return float(np.max(self.objectives))


def verify(
    problem: Callable[..., tuple[ArrayLike, ArrayLike, ArrayLike]],
    optimum: Optimum,
    *,
    data: tuple[Any, ...] = (),
    agreement: float = 0.01,
    feasibility: float = 1e-4,
    worst_status: int = Status.LEFT_OVER_TIP,
) -> Verification:
    """Evaluate the problem at `reference`, or any other fidelity, at an optimum's point.

    **Arguments:**

    - `problem`: as for `minimize`, with another fidelity; give it compiled (`jax.jit`) where
      several optima are verified. Only its value is computed.
    - `optimum`, `data`: the result of `minimize`, and the data that it had.
    - `agreement` [1]: largest relative error of the worst case that confirms the optimum.
    - `feasibility` [1]: violation that counts as none; checked for optima that were feasible.
    - `worst_status`: the largest status that confirms the optimum.

    Raises `ValueError` where `agreement` or `feasibility` is not finite and above 0, `TypeError`
    where it is no number.

    >>> problem = lambda z: (z**2, z - 0.5, jnp.zeros(1, int))
    >>> print(fj.verify(problem, fj.minimize(problem, [0.9])))
    Verification
      verdict     confirmed
      worst case  0.25; the search's is off by +0 %
      margins     differ by up to 0
    """
    _check.number("agreement", agreement, above=0)
    _check.number("feasibility", feasibility, above=0)
    found = jax.device_get(problem(jnp.asarray(optimum.point), *data))
    objectives, margins = (np.atleast_1d(np.asarray(part, dtype=float)) for part in found[:2])
    status = int(np.max(found[2], initial=0))
    worst = float(np.max(objectives))
    error = optimum.objective / worst - 1 if worst else float("inf")
    violation = float(np.max(-margins, initial=0.0))
    doubts = []
    if not (np.isfinite(error) and np.all(np.isfinite(margins))):
        doubts.append("a number is not finite")
    if status > worst_status:
        doubts.append(f"{Status(status).name}: {Status(status).text}")
    if optimum.feasible and violation > feasibility:
        doubts.append(f"a limit is broken by {100 * violation:.3g} %")
    if abs(error) > agreement:
        doubts.append(
            f"the worst case differs by {100 * error:+.3g} %, more than {100 * agreement:g} %"
        )
    return Verification(
        objectives,
        margins,
        error,
        float(np.max(np.abs(margins - optimum.margins), initial=0.0)),
        violation,
        status,
        tuple(doubts),
    )
