"""The front of every concept, rate by rate, each search started from neighbouring designs."""

import concurrent.futures
import dataclasses
import functools
from collections.abc import Callable, Mapping

import numpy as np

from fencejax.design import Journal
from fencejax.results import Status
from fencejax.sorter import Look, Solution, SorterProblem, look, solve

from ..common import evaluations
from .configuration import ConceptsConfig
from .means import Concept
from .problem import Group, period
from .quantities import FORCE, LOAD, UNITS

_AHEAD, _DECIDE = 2, 3
# Designs whose objectives differ by less than this share count as equal.
_EQUAL = 1e-3


@dataclasses.dataclass(frozen=True)
class Point:
    """The best design of a concept at a rate [1/h] for the quantity `minimised`, as found by the
    search and as measured at the finer fidelity (`finer`)."""

    concept: Concept
    rate: float
    minimised: str
    solution: Solution
    design: Mapping[str, float]
    finer: Look
    agreement: float
    feasibility: float

    @property
    def values(self) -> Mapping[str, np.ndarray]:
        """Every quantity at the finer fidelity, one number a sort."""
        return self.finer.measured.values

    def worst(self, name: str) -> float:
        """A quantity at the finer fidelity, its largest of all sorts."""
        return float(np.max(self.values[name]))

    @property
    def error(self) -> float:
        """The search's objective over the finer one's, less 1 [1]."""
        return self.solution.after.objective / self.finer.objective - 1

    @property
    def feasible(self) -> bool:
        """Whether the search's design holds every limit."""
        return self.solution.feasible

    @property
    def doubts(self) -> tuple[str, ...]:
        """The objections of the finer fidelity."""
        doubts = []
        status = Status(int(np.max(self.finer.measured.statuses)))
        if not self.finer.violation < np.inf:
            doubts.append("a number is not finite")
        elif self.feasible and self.finer.violation > self.feasibility:
            doubts.append(f"a limit is broken by {100 * self.finer.violation:.2g} %")
        if status > Status.LEFT_OVER_TIP:
            doubts.append(f"{status.name}: {status.text}")
        if not abs(self.error) <= self.agreement:
            doubts.append(f"the objective differs by {100 * self.error:+.2g} %")
        return tuple(doubts)

    @property
    def confirmed(self) -> bool:
        """Feasible, and not contradicted by the finer fidelity."""
        return self.feasible and not self.doubts

    @property
    def decides(self) -> tuple[str, ...]:
        """The active limits and bounds or, where it breaks limits, those in conflict; the most
        important first."""
        return tuple(price.name for price in self.solution.prices[:_DECIDE])

    @property
    def verdict(self) -> str:
        """The verdict in words."""
        if not self.feasible:
            violation = self.solution.after.violation
            fight = " and ".join(name.replace("_", " ") for name in self.decides)
            if not violation < np.inf:
                return "cannot be evaluated"
            return f"breaks a limit by {100 * violation:.2g} %" + (f": {fight}" if fight else "")
        return "confirmed" if self.confirmed else "NOT confirmed: " + "; ".join(self.doubts)


class Search:
    """Searches the concepts' fronts; every evaluation goes through a journal of its group.

    A front is searched from the slowest rate to the fastest, each time from the previous design and
    from the best of the concepts that are special cases of this one; then back, as a design for a
    faster rate with less force also serves the slower rate. A design of least acceleration with
    less force than the force's front is a further start for that front.
    """

    def __init__(
        self, config: ConceptsConfig, groups: list[Group], say: Callable[..., None],
        keep: Callable[[list[Point]], None],
    ):  # fmt: skip
        self.config, self.groups, self.say, self.keep = config, groups, say, keep
        self.points: list[Point] = []
        self.evaluations = self.recalled = self.searches = 0
        self._found: dict[tuple[str, Concept, float], tuple[Group, Solution]] = {}

    def run(self) -> list[Point]:
        """The points of all concepts."""
        # Compiling takes longer than searching, on one core: two groups at a time, ahead of the
        # searches.
        pool = concurrent.futures.ThreadPoolExecutor(_AHEAD)
        try:
            ready = [pool.submit(group.compile) for group in self.groups]
            for group, compiled in zip(self.groups, ready, strict=True):
                self._searched(group, compiled)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
        return self.points

    def _searched(self, group: Group, compiled: concurrent.futures.Future[None]) -> None:
        """Search for the points of a group."""
        several = "; ".join(concept.title for concept in group.concepts)
        self.say(
            f"\n{several}: {group.problem.machine.parcels.count} parcels and places, "
            f"{len(group.problem.variable_names)} numbers; compiling (minutes, the first time) ..."
        )
        journals = {}
        for name, problem in group.problems.items():
            journals[name] = evaluations.journal(
                self.config, self.say, f"evaluations-{group.name}-{name}",
                repr(vars(problem.fidelity)) + problem.machine.signature,
            )  # fmt: skip
        compiled.result()
        for concept in group.concepts:
            for name, problem in group.problems.items():
                self._front(group, concept, name, problem, journals[name])
            if LOAD.name in group.problems:
                self._softer(group, concept, group.problems[FORCE.name], journals[FORCE.name])
            for name, problem in group.problems.items():
                for rate in self.config.paces:
                    self._add(group, concept, rate, name, problem)
            self.keep(self.points)
        self.recalled += sum(journal.recalled for journal in journals.values())

    def _front(
        self, group: Group, concept: Concept, name: str, problem: SorterProblem, journal: Journal
    ) -> None:
        paces = self.config.paces
        searched = functools.partial(self._best, group, concept, problem, journal)
        best: dict[float, Solution] = {}
        for rate in paces:
            best[rate] = searched(rate, self._starts(group, concept, rate, name, best))
        for slow, fast in zip(paces[-2::-1], paces[:0:-1], strict=True):
            if _better(best[fast], best[slow]):
                start = np.asarray(best[fast].after.point)
                best[slow] = searched(slow, [start], best[slow])
        for rate in paces:
            self._found[name, concept, rate] = group, best[rate]

    def _softer(
        self, group: Group, concept: Concept, problem: SorterProblem, journal: Journal
    ) -> None:
        """Search for the least force from designs of least acceleration with less force than the
        least one found."""
        for rate in self.config.paces:
            (_, force), (_, load) = (
                self._found[name, concept, rate] for name in (FORCE.name, LOAD.name)
            )
            other = float(np.max(load.after.measured.values[FORCE.name]))
            less = other < (1 - _EQUAL) * force.after.objective
            if load.feasible and (less or not force.feasible):
                start = np.asarray(load.after.point)
                found = self._best(group, concept, problem, journal, rate, [start], force)
                self._found[FORCE.name, concept, rate] = group, found

    def _best(
        self, group: Group, concept: Concept, problem: SorterProblem, journal: Journal,
        rate: float, starts: list[np.ndarray], *known: Solution,
    ) -> Solution:  # fmt: skip
        """The best of the results of searches from some starts and of the known solutions."""
        every = list(known)
        for start in _different(starts):
            found = solve(
                problem, group.candidate(concept, rate), start=start,
                check=group.fidelity(self.config.check), budget=self.config.budget,
                tolerance=self.config.tolerance, feasibility=self.config.feasibility,
                agreement=self.config.agreement, journal=journal,
            )  # fmt: skip
            self.searches += 1
            self.evaluations += 0 if found.optimum is None else len(found.optimum.history)
            every.append(found)
        return min(every, key=lambda one: one.rank)

    def _starts(
        self, group: Group, concept: Concept, rate: float, name: str, best: dict[float, Solution]
    ) -> list[np.ndarray]:
        """Where searches begin: at the slower rate's design, or the sorter's own, at the best of
        the special cases, and at the best with a rigid fence in place of this one; of the
        acceleration at the design of least force and, where it has less, at the second."""
        known = [
            (group_of, other, solution)
            for (of, other, at), (group_of, solution) in self._found.items()
            if at == rate and of == name and solution.feasible
        ]
        special = [each for each in known if concept.holds(each[1])]
        stiff = [each for each in known if concept.stiffens_to(each[1])]
        near, stiffer = (
            [
                group.point(group_of.design(other, solution.after.point), rate)
                for group_of, other, solution in sorted(several, key=lambda x: x[2].rank)[:1]
            ]
            for several in (special, stiff)
        )
        if name == LOAD.name:
            least = self._found[FORCE.name, concept, rate][1].after
            better = [
                each for each in special
                if each[2].after.objective < np.max(least.measured.values[LOAD.name])
            ]
            return [np.asarray(least.point), *(near if better else [])]
        start = np.asarray(best[max(best)].after.point) if best else group.problem.start
        return [group.point(group.design(concept, start), rate), *near, *stiffer]

    def _add(
        self, group: Group, concept: Concept, rate: float, name: str, problem: SorterProblem
    ) -> None:
        _, solution = self._found[name, concept, rate]
        finer = look(
            problem, solution.candidate, solution.after.point, group.fidelity(self.config.verify)
        )
        design = group.design(concept, solution.after.point)
        self.points.append(Point(
            concept, rate, name, solution, design, finer, self.config.agreement,
            self.config.feasibility,
        ))  # fmt: skip
        self.say(self._line(self.points[-1]))

    def _line(self, point: Point) -> str:
        cells = (
            f"{point.concept.title:<34}{point.rate:6.0f}/h {period(point.rate):6.3f} s  "
            f"{point.minimised.replace('_', ' ')} {point.finer.objective:8.4g} "
            f"{UNITS[point.minimised]:<2}"
        )
        decides = ", ".join(name.replace("_", " ") for name in point.decides)
        deciding = f"; {decides} decide" if point.feasible and decides else ""
        return f"{cells}  {point.verdict}{deciding}"


def _better(one: Solution, other: Solution) -> bool:
    """Whether a design is better than another by more than `_EQUAL`."""
    if one.feasible and other.feasible:
        return one.after.objective < (1 - _EQUAL) * other.after.objective
    return one.feasible


def _different(starts: list[np.ndarray]) -> list[np.ndarray]:
    """The starts without near duplicates."""
    kept: list[np.ndarray] = []
    for start in starts:
        if not any(np.max(np.abs(start - other)) < _EQUAL for other in kept):
            kept.append(start)
    return kept
