"""Effects of manufacturing tolerances: every number of the design is changed by itself.

The effects are predicted by the exact gradient at the end of the search, and simulated again with
the changed numbers by the program that has measured the design, without compiling anything.
"""

import dataclasses
import math
from collections.abc import Iterator

import equinox as eqx
import numpy as np

from fencejax import Fidelity
from fencejax.design import Evaluation
from fencejax.results import Status
from fencejax.sorter import Candidate, Look, Solution, SorterProblem

from ..common.nearby import NOTHING, SHARE, along

_MATERIAL = {"youngs_modulus": "Pa", "density": "kg/m^3", "damping_ratio": "1"}


@dataclasses.dataclass(frozen=True)
class Moved:
    """A number changed by a share of itself, and the effect on the design.

    **Fields:**

    - `name`, `unit`, `value`, `share`: the number, its value in the design, its relative change
      [1].
    - `predicted`, `predicted_margin`: the objective and the least margin by the gradient; `None`
      for numbers without a gradient in the search.
    - `simulated`, `margin`, `limit`: the objective, the least margin and its limit, simulated.
    - `doubtful`: the number of sorts without reliable numbers.
    - `room`: the number of such changes until a limit breaks, by the gradient; `None` without one,
      infinite where no limit comes nearer.
    """

    name: str
    unit: str
    value: float
    share: float
    predicted: float | None
    predicted_margin: float | None
    simulated: float
    margin: float
    limit: str
    doubtful: int
    room: float | None


@dataclasses.dataclass(frozen=True)
class Tolerances:
    """`rows`: two for each number. `objective`, `margin`, `doubtful`: of the design itself,
    measured in the same way. `still`: numbers that are 0 and have no relative change."""

    rows: tuple[Moved, ...]
    objective: float
    margin: float
    doubtful: int
    still: tuple[str, ...]


def tolerances(problem: SorterProblem, solution: Solution, fidelity: Fidelity) -> Tolerances:
    """Every free number changed by `SHARE` either way, and those of the material and from lists,
    where they are arguments of the compiled program: where there are several of them.

    `fidelity`: that at which the solution was measured.
    """
    after, candidate = solution.after, solution.candidate

    def measured(point: np.ndarray, other: Candidate) -> Look:
        found = problem.measure(point, other, fidelity, refine=False)
        objectives, margins, _ = problem.judged(found, candidate)
        return Look(point, np.asarray(objectives), np.asarray(margins), found)

    here, at = measured(after.point, candidate), _gradient(solution)
    scale = 1.0 if solution.optimum is None else solution.optimum.scale
    rows = []
    names = {name for name, *_ in _moves(problem, solution)}
    still = tuple(name for name in problem.variable_names if name not in names)
    for name, unit, value, share, point, other in _moves(problem, solution):
        found, step = measured(point, other), point - after.point
        linear = None if at is None or other is not candidate else along(
            at, scale, here.objectives, here.margins, step
        )  # fmt: skip
        index = int(np.argmin(found.margins)) if found.margins.size else 0
        rows.append(Moved(
            name, unit, value, share,
            None if linear is None else linear.objective, None if linear is None else linear.margin,
            found.objective, _least(found), problem.margin(index)[0] if found.margins.size else "",
            _doubtful(found),
            None if linear is None else linear.room,
        ))  # fmt: skip
    return Tolerances(tuple(rows), here.objective, _least(here), _doubtful(here), still)


def _moves(
    problem: SorterProblem, solution: Solution
) -> Iterator[tuple[str, str, float, float, np.ndarray, Candidate]]:
    """Name, unit, value and share of every change, with the resulting point and candidate."""
    point, candidate = solution.after.point, solution.candidate
    for index, name in enumerate(problem.variable_names):
        assert problem.space is not None
        variable, value = problem.space.variables[index], problem.values(point)[name]
        nothing = NOTHING * max(abs(variable.lower), abs(variable.upper))
        for share in (-SHARE, SHARE) if abs(value) > nothing else ():
            moved = np.array(point)
            moved[index] = float(variable.share((1 + share) * value))
            yield name, variable.unit, value, share, moved, candidate
    if len(problem.machine.materials) > 1:
        for field, unit in _MATERIAL.items():
            value = float(getattr(candidate.material.material, field))
            for share in (-SHARE, SHARE):
                sheet = eqx.tree_at(
                    lambda s, field=field: getattr(s.material, field), candidate.material,
                    replace_fn=lambda number, share=share: number * (1 + share),
                )  # fmt: skip
                other = candidate._replace(material=sheet)
                yield f"material.{field}", unit, value, share, point, other
    for path, value in candidate.numbers.items():
        for share in (-SHARE, SHARE) if value else ():
            numbers = {**candidate.numbers, path: (1 + share) * value}
            unit = problem.machine.unit(path)
            yield path, unit, value, share, point, candidate._replace(numbers=numbers)


def _gradient(solution: Solution) -> Evaluation | None:
    """The evaluation of the search at the design, with its derivatives."""
    if solution.optimum is None:
        return None
    ends = (solution.optimum.last, solution.optimum.first)
    return next((at for at in ends if np.array_equal(at.point, solution.after.point)), None)


def _doubtful(look: Look) -> int:
    return int(np.sum(look.measured.statuses > Status.LEFT_OVER_TIP))


def _least(look: Look) -> float:
    return float(np.min(look.margins, initial=math.inf))
