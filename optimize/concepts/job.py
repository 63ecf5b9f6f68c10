"""Which concept of softening wins: each one's front of force over parcels an hour.

    python -m optimize.concepts --sorter paper --out out

The concepts soften a blow by a flexible fence, a rigid link before it, an elastic cover, a
compliant shaft, a slipping clutch, or another motion. Each of them, and some combinations, is
designed with its drive and start time for the least peak force, and for the least acceleration in
g, over the same parcels, within the same limits, at several rates. Every point is measured again
at the reference fidelity. Where a design breaks limits, the limits in conflict are named.

A rate is 3600 s over the period from parcel to parcel, at the sorter's own belt speed. Within the
period the drive has to be home and the fence clear of the next parcel. The tip may lag behind the
motor's position as far as the sorter allows it to deflect, by any compliance, and the residual
oscillation is limited from the time at which the drive is home.

Every evaluation is written to the folder at once: the same command with the same folder resumes an
interrupted job.
"""

import csv
import dataclasses
import io
import time
from typing import Any

from fencejax.results import counted

from ..common import command, machine
from ..common.files import write_whole
from ..common.report import write_json
from . import figures, page, words
from .configuration import ConceptsConfig, configure
from .outcome import Outcome
from .problem import grouped, mass, period, torque
from .quantities import FORCE, LOAD, UNITS
from .search import Point, Search


def main(config: ConceptsConfig | None = None, *, quiet: bool = False) -> Outcome:
    """Run the job, print its progress, and write its files into `config.out`."""
    say = command.begin(quiet)
    begin = time.perf_counter()
    config = ConceptsConfig() if config is None else config
    config.out.mkdir(parents=True, exist_ok=True)
    groups = grouped(config, config.read)
    for line in machine.notes(groups[0].problem.machine):
        say(line)

    def outcome(points: list[Point]) -> Outcome:
        return Outcome(
            config, groups, points, search.searches, search.evaluations, search.recalled,
            time.perf_counter() - begin,
        )  # fmt: skip

    search = Search(config, groups, say, lambda points: _write(outcome(points)))
    found = outcome(search.run())
    wins = words.wins(found)
    _write(found, wins, complete=True)
    if config.plots:
        figures.fronts(found, config.out)
    page.write(found, wins)
    for name in found.minimised:
        say("\n" + words.table(found, name))
    say("\n" + wins)
    say(f"wrote {config.out} ({time.perf_counter() - begin:.1f} s in all)")
    return found


def _row(point: Point) -> dict[str, Any]:
    """A point for a JSON file; its first part is the CSV file's."""
    return {
        "concept": point.concept.name,
        "minimised": point.minimised,
        "parcels_an_hour": point.rate,
        "period": period(point.rate),
        "peak_force": point.worst(FORCE.name),
        "peak_load": point.worst(LOAD.name),
        "drive_torque": torque(point.values),
        "fence_mass": mass(point.values),
        "feasible": point.feasible,
        "confirmed": point.confirmed,
        "verdict": point.verdict,
        "decides": "; ".join(point.decides),
    }


_UNITS = {
    "parcels_an_hour": "1/h", "period": "s", **UNITS, "drive_torque": "N m", "fence_mass": "kg",
}  # fmt: skip


def _write(outcome: Outcome, wins: str = "", complete: bool = False) -> None:
    config, points = outcome.config, outcome.points
    content = {
        "config": dataclasses.asdict(config),
        "complete": complete,
        "wins": wins.splitlines(),
        "searches": outcome.searches,
        "evaluations": outcome.evaluations,
        "recalled": outcome.recalled,
        "elapsed": outcome.elapsed,
        "least_force": _least(outcome) if complete else None,
        "designs": [
            _row(point) | {
                "design": point.design,
                "search": {
                    "objective": point.solution.after.objective,
                    "violation": point.solution.after.violation, "stop": point.solution.stop,
                },
                "error": point.error,
                "measured": point.values,
                "statuses": counted(point.finer.measured.statuses),
                "prices": [price._asdict() for price in point.solution.prices],
            }
            for point in points
        ],
    }  # fmt: skip
    write_json(config.out / "concepts.json", content)
    rows = [_row(point) for point in points]
    text = io.StringIO(newline="")
    titles = [f"{key} [{_UNITS[key]}]" if key in _UNITS else key for key in rows[0]]
    csv.writer(text).writerows([titles, *(row.values() for row in rows)])
    write_whole(config.out / "concepts.csv", text.getvalue())


def _least(outcome: Outcome) -> dict[str, float | None]:
    """The least confirmed force [N] at the slowest rate, by concept."""
    first = outcome.of(FORCE.name, outcome.config.paces[0])
    return {p.concept.name: p.finer.objective if p.confirmed else None for p in first}


def run():
    """The job from the command line."""
    command.run("concepts", configure, main, stopped=command.RESUMED)
