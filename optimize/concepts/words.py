"""The job's report of its points: the table, and the best concepts."""

import itertools

from fencejax.printing import shown

from ..common import report
from .outcome import Outcome
from .problem import mass, torque
from .quantities import FORCE, LOAD, UNITS
from .search import Point

TITLES = (
    "concept", "peak force", "peak load", "drive torque", "fence mass", "", "what decides",
)  # fmt: skip


def rows(outcome: Outcome, minimised: str, rate: float) -> list[list[str]]:
    """The concepts at a rate, the best first, a row each, under `TITLES`."""
    return [
        [
            point.concept.title, shown(point.worst(FORCE.name), "N"),
            f"{point.worst(LOAD.name):.3g} g", shown(torque(point.values), "N m", 3),
            shown(mass(point.values), "kg", 3), point.verdict if not point.feasible
            else "confirmed" if point.confirmed else "not confirmed",
            ", ".join(name.replace("_", " ") for name in point.decides) if point.feasible else "",
        ]
        for point in outcome.of(minimised, rate)
    ]  # fmt: skip


def table(outcome: Outcome, minimised: str) -> str:
    """The same as text, for every rate."""
    every = {rate: rows(outcome, minimised, rate) for rate in outcome.config.paces}
    # The columns are as wide at every rate.
    head, *lines = report.aligned([TITLES, *itertools.chain(*every.values())], left=(0, 5, 6))
    parts = [f"least {minimised.replace('_', ' ')}, at {outcome.config.verify}", head]
    for rate, found in every.items():
        parts += [f"{rate:g} parcels an hour", *lines[: len(found)]]
        lines = lines[len(found) :]
    return "\n".join(parts)


def wins(outcome: Outcome) -> str:
    """The best concept at each rate, with the runner-up and the rigid fence, a line each."""
    lines = []
    for name in outcome.minimised:
        unit = UNITS[name]
        for rate in outcome.config.paces:
            best = outcome.winner(name, rate)
            if best is None:
                lines.append(f"At {rate:g}/h no concept holds all limits and is confirmed.")
                continue
            others = [p for p in outcome.of(name, rate) if p.confirmed and p is not best]
            compared = [f"{p.concept.title} {_value(p, unit)}" for p in _compared(others)]
            if name == FORCE.name:
                compared.append(f"a constant push would need {shown(outcome.push(best), 'N', 3)}")
            lines.append(
                f"At {rate:g}/h {best.concept.title} has the least {name.replace('_', ' ')}, "
                f"{_value(best, unit)}" + (f" ({'; '.join(compared)})." if compared else ".")
            )
    return "\n".join(lines)


def _compared(others: list[Point]) -> list[Point]:
    """The runner-up and the rigid fence."""
    stiff = [p for p in others[1:] if p.concept.name == "rigid"]
    return [*others[:1], *stiff]


def _value(point: Point, unit: str) -> str:
    return f"{point.finer.objective:.4g} {unit}"


def design_text(outcome: Outcome, point: Point) -> str:
    """The numbers of a design that its concept has, each with its unit."""
    group = outcome.group(point)
    own = {number.path for number in point.concept.numbers}
    numbers = [
        f"{path.rpartition('.')[2].replace('_', ' ')} "
        f"{shown(value, group.problem.unit(path), 3)}"
        for path, value in point.design.items() if path in own or path not in group.fixed
    ]  # fmt: skip
    return ", ".join(numbers)


def stacked(outcome: Outcome, concept, minimised: str) -> list[Point]:
    """The points of a concept, the slowest rate first."""
    found = [p for p in outcome.points if p.concept == concept and p.minimised == minimised]
    return sorted(found, key=lambda p: p.rate)
