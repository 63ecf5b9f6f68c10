"""Solving a sorter's design problem for one candidate, checking the result, and its prices."""

import dataclasses
import math
from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np

from ..design import (
    Bounded,
    Journal,
    Optimum,
    Record,
    ShadowPrices,
    Stop,
    Verification,
    conflict,
    minimize,
    relaxations,
    shadow_prices,
    sorting,
    verify,
)
from ..fidelity import Fidelity
from ..results import Status
from .problem import Candidate, Measured, SorterProblem

_STARTS = 8


class Look(NamedTuple):
    """A design measured: objectives, margins without the reserve, and the measured quantities."""

    point: np.ndarray
    objectives: np.ndarray
    margins: np.ndarray
    measured: Measured

    @property
    def objective(self) -> float:
        """The objective over the parcels: their worst case, or the measure that is minimised."""
        return float(np.max(self.objectives))

    @property
    def violation(self) -> float:
        """The largest violation of a limit [1]; infinite where a number is not finite."""
        worst = float(np.max(-self.margins, initial=0.0))
        finite = np.all(np.isfinite(self.margins)) and np.all(np.isfinite(self.objectives))
        return worst if finite else math.inf


class Price(NamedTuple):
    """The `gain` from relaxing a limit or a bound from `bound` to `relaxed` [`unit`]: in the
    objective's unit or, where no design holds all limits, in the largest violation [1]. `parcels`:
    those for which the limit is active."""

    name: str
    bound: float
    relaxed: float
    unit: str
    parcels: tuple[str, ...]
    gain: float


@dataclasses.dataclass(frozen=True)
class Solution:
    """The result for a candidate.

    **Fields:**

    - `candidate`: material and numbers from the lists.
    - `before`, `after`: the design at the start and the one found, both at the finer fidelity;
      `after` is `before` where nothing better was found.
    - `optimum`: the optimiser's outcome; `None` where nothing is free.
    - `feasible`: whether `after` holds every limit, within the range of the model.
    - `verified`: how the finer fidelity agrees with the optimiser's.
    - `prices`: of the active limits and bounds, the largest first.
    - `starts`: the number of starting points tried until one could be evaluated.
    """

    candidate: Candidate
    before: Look
    after: Look
    optimum: Optimum | None
    feasible: bool
    verified: Verification | None
    prices: tuple[Price, ...]
    starts: int

    @property
    def improved(self) -> bool:
        """Whether `after` is another design than `before`."""
        return self.after is not self.before

    @property
    def rank(self) -> tuple[float, float]:
        """The sort key: feasible designs first, by their objective; then the others, by
        violation."""
        if self.feasible:
            return 0.0, self.after.objective
        return 1.0, max(self.after.violation, 1e-12)

    @property
    def stop(self) -> str:
        """Why the search ended."""
        return "nothing is free" if self.optimum is None else self.optimum.ended


def look(
    problem: SorterProblem, candidate: Candidate, point: np.ndarray, fidelity: Fidelity
) -> Look:
    """A design measured at a fidelity."""
    measured = problem.measure(point, candidate, fidelity)
    objectives, margins, _ = problem.judged(measured, candidate)
    return Look(np.asarray(point), np.asarray(objectives), np.asarray(margins), measured)


def solve(
    problem: SorterProblem,
    candidate: Candidate,
    *,
    start: np.ndarray | None = None,
    check: Fidelity | None = None,
    budget: int = 60,
    tolerance: float = 2e-3,
    feasibility: float = 1e-3,
    agreement: float = 0.02,
    journal: Journal | None = None,
    progress: Callable[[Record], None] | None = None,
) -> Solution:
    """The best design for a candidate, from any start.

    Where the start cannot be evaluated, others follow: the middle of the ranges, then Sobol'
    points. During the search the fence may bend beyond the range of the linear beam, and a corner
    may be indented beyond that of the contact law: limits lead the search out of there, and the
    final design has no such sorts.

    **Arguments:**

    - `start`: z at the start, by default the problem's.
    - `check`: the fidelity at which both designs are measured again, default
      `Fidelity.standard()`.
    - `budget`, `tolerance`, `journal`, `progress`: as in `fencejax.minimize`.
    - `feasibility` [1]: the violation of a margin that counts as none.
    - `agreement` [1]: largest relative error of the objective that confirms the design.
    """
    check = Fidelity.standard() if check is None else check
    start = problem.start if start is None else start
    before = look(problem, candidate, start, check)
    if problem.space is None:
        return _settled(problem, candidate, before, before, None, None, feasibility, 1)
    optimum, tried = None, 0
    for point in _starts(start):
        tried += 1
        optimum = minimize(
            problem.program, point, data=problem.data(candidate), tolerance=tolerance,
            feasibility=feasibility, budget=budget, journal=journal, progress=progress,
            worst_status=Status.DEEP_PENETRATION,
        )  # fmt: skip
        if optimum.stop is not Stop.FAILED_START:
            break
    assert optimum is not None
    if optimum.stop is Stop.FAILED_START:
        return _settled(problem, candidate, before, before, optimum, None, feasibility, tried)
    after = look(problem, candidate, optimum.point, check)
    verified = verify(
        lambda z: problem.judged(after.measured, candidate), optimum, agreement=agreement,
        feasibility=feasibility,
    )  # fmt: skip
    return _settled(problem, candidate, before, after, optimum, verified, feasibility, tried)


def _starts(first: np.ndarray):
    yield first
    yield np.full(first.size, 0.5)
    from scipy.stats import qmc

    engine = qmc.Sobol(first.size, rng=np.random.default_rng(0))
    yield from engine.random(_STARTS)


def _settled(
    problem: SorterProblem, candidate: Candidate, before: Look, after: Look,
    optimum: Optimum | None, verified: Verification | None, feasibility: float, starts: int,
) -> Solution:  # fmt: skip
    def order(one: Look):
        bad = len(problem.troubles(one.measured.statuses))
        return max(one.violation, feasibility), bad, one.objective

    if order(before) <= order(after):
        after = before
    # Numerical doubt at the finest rung leaves a design unconfirmed, but breaks no limit.
    trouble = [s for s in map(Status, after.measured.statuses) if not s.numerical]
    sound = max(trouble, default=Status.SUCCESSFUL) <= Status.LEFT_OVER_TIP
    prices: tuple[Price, ...] = ()
    if optimum is not None and optimum.stop is not Stop.FAILED_START:
        if optimum.feasible:
            found = shadow_prices(optimum)
        else:
            found = conflict(optimum.last)
        prices = _prices(problem, candidate, found, optimum.last.margins)
    return Solution(
        candidate, before, after, optimum, after.violation <= feasibility and sound,
        verified, prices, starts,
    )  # fmt: skip


def _prices(
    problem: SorterProblem, candidate: Candidate, found: ShadowPrices, margins: np.ndarray
) -> tuple[Price, ...]:
    """The gains from relaxing limits and bounds by a tenth, the largest first."""
    of = [problem.margin(k) for k in range(margins.size)]
    limits = [
        Bounded(
            name, limit.bound, limit.quantity.unit, limit.unit_of_margin, limit.sense == "at most",
            [k for k, (other, _) in enumerate(of) if other == name],
        )
        for name, limit in problem.limits(candidate)
    ]  # fmt: skip
    variables = () if problem.space is None else problem.space.variables
    named = dict(zip(problem.variable_names if variables else (), variables, strict=True))
    text = problem.machine.parcels.text
    return tuple(
        Price(
            one.name, one.bound, one.relaxed, one.unit,
            tuple(text(lane) for k in one.margins if (lane := of[k][1]) is not None), one.gain,
        )
        for one in relaxations(limits, named, found, margins)
    )  # fmt: skip


def rigid(problem: SorterProblem, solution: Solution, check: Fidelity | None = None) -> Measured:
    """The same sorts by a rigid fence of the same shape."""
    check = Fidelity.standard() if check is None else check
    stiff = check.replace(modes=0, static_correction=False)
    return problem.measure(solution.after.point, solution.candidate, stiff, refine=False)


def constant_push(problem: SorterProblem, solution: Solution) -> np.ndarray:
    """The constant force [N] on each parcel, of shape (P,), that would move it as far past the
    belt's edge as required (see `fencejax.design.sorting.constant_push`)."""
    limits = dict(problem.limits(solution.candidate))
    past = limits["sorted"].bound if "sorted" in limits else 0.0
    scenes = problem.scenes(solution.after.point, solution.candidate)
    return np.asarray(jax.vmap(lambda scene: sorting.constant_push(scene, past))(scenes))
