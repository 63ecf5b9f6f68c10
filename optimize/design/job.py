"""The fence for one's own machine, described by a sorter file.

    python -m optimize.design --sorter machine.toml --out out

minimises the largest peak force, or the objective in the file, over all parcels and places in the
file, within its limits, in its free numbers. Each material in the file, combined with each number
from its lists (such as thicknesses as sold), is a candidate with a design of its own; one compiled
program serves all of them. The candidates are ranked. The report describes the best one in full,
with the prices of its limits and bounds and the force of a rigid fence. Where no design holds all
limits, it names the limits in conflict.
"""

import dataclasses
import time
from typing import Any

import fencejax as fj
from fencejax.design import Journal, objectives
from fencejax.results import counted
from fencejax.sorter import Solution, SorterProblem, constant_push, rigid, solve

from ..common import command, evaluations
from ..common.report import progress_line, write_json
from . import page, words
from .configuration import DesignConfig, configure
from .outcome import Outcome


def main(config: DesignConfig | None = None, *, quiet: bool = False) -> Outcome:
    """Run the job, print its progress, and write its files into `config.out`."""
    say = command.begin(quiet)
    begin = time.perf_counter()
    config = DesignConfig() if config is None else config
    machine = config.machine
    config.out.mkdir(parents=True, exist_ok=True)
    fidelity, check = (getattr(fj.Fidelity, n)() for n in (config.fidelity, config.check))
    problem = SorterProblem(machine, fidelity, reserve=config.reserve, rungs=config.rungs)
    journal = None if problem.space is None else evaluations.journal(config, say)
    several = "s" if len(problem.candidates) > 1 else ""
    say(
        f"{problem.machine.title or config.sorter}: {problem.machine.parcels.count} parcels and "
        f"places, free {', '.join(problem.variable_names) or 'nothing'}, "
        f"{len(problem.candidates)} candidate{several}; compiling (minutes, the first time, and "
        "again where sorts are computed finer) ..."
    )
    quantity = problem.machine.objective.quantity
    solutions = []
    for candidate in problem.candidates:
        say(f"\n{candidate.name}")
        found = solve(
            problem, candidate, check=check, budget=config.budget, tolerance=config.tolerance,
            feasibility=config.feasibility, agreement=config.agreement, journal=journal,
            progress=lambda record: say("  " + progress_line(record, quantity)),
        )  # fmt: skip
        solutions.append(found)
        say(f"  {words.verdict(found)}; {found.stop}{words.start_troubles(problem, found)}")
    solutions.sort(key=lambda one: one.rank)
    best = solutions[0]
    stiff, push = compared(problem, best, check)
    outcome = Outcome(config, problem, solutions, stiff, push, time.perf_counter() - begin)
    say("\n" + report_text(outcome))
    _write(outcome, journal)
    page.write(outcome)
    say(f"wrote {config.out} ({time.perf_counter() - begin:.1f} s in all)")
    return outcome


def compared(
    problem: SorterProblem, best: Solution, check: fj.Fidelity
) -> tuple[float, float | None]:
    """The objective of a rigid fence of the design's shape and, where it is a force, that of
    constant pushes [N], by the same measure over the parcels."""
    quantity = problem.machine.objective.quantity
    stiff = words.measured(problem, rigid(problem, best, check).values[quantity.name])
    if quantity is not objectives.PEAK_FORCE:
        return stiff, None
    return stiff, words.measured(problem, constant_push(problem, best))


def report_text(outcome: Outcome) -> str:
    """The report that the job prints at the end."""
    problem, best = outcome.problem, outcome.best
    parts = [
        words.ranking(problem, outcome.solutions),
        f"{best.candidate.name}\n" + words.before_and_after(problem, best),
    ]
    trouble = problem.troubles(best.after.measured.statuses)
    if trouble:
        parts.append("Not to be relied on:\n" + "\n".join(f"  {text}" for text in trouble))
    if best.optimum is not None:
        parts.append(words.decides(problem, best))
    for other in outcome.solutions[1:]:
        if other.prices:
            parts.append(f"{other.candidate.name}. {words.decides(problem, other)}")
    if not best.improved and best.optimum is not None:
        parts.append("Nothing better than the start was found.")
    checked = words.doubts(best)
    parts += [checked] if checked else []
    parts.append(words.mine(problem, best, outcome.stiff, outcome.push))
    return "\n\n".join(parts)


def _write(outcome: Outcome, journal: Journal | None) -> None:
    problem = outcome.problem

    def row(one: Solution) -> dict[str, Any]:
        return {
            "candidate": one.candidate.name,
            "numbers": one.candidate.numbers,
            "feasible": one.feasible,
            "violation": one.after.violation,
            "stop": one.stop,
            "objective": {"before": one.before.objective, "after": one.after.objective},
            "design": {
                "before": problem.values(one.before.point),
                "after": problem.values(one.after.point),
            },
            "improved": one.improved,
            "measured": one.after.measured.values,
            "statuses": counted(one.after.measured.statuses),
            "limits": {
                name: {
                    "bound": limit.bound,
                    "sense": limit.sense,
                    "worst": words.worst(problem, one.after, name)[0],
                }
                for name, limit in problem.limits(one.candidate)
            },
            "prices": [price._asdict() for price in one.prices],
            "confirmed": None if one.verified is None else one.verified.confirmed,
            "doubts": None if one.verified is None else one.verified.doubts,
            "evaluations": 0 if one.optimum is None else len(one.optimum.history),
        }

    parcels = problem.machine.parcels
    content = {
        "config": dataclasses.asdict(outcome.config),
        "succeeded": outcome.succeeded,
        "parcels": [parcels.text(lane) for lane in range(parcels.count)],
        "weights": parcels.weights.tolist(),
        "solutions": [row(one) for one in outcome.solutions],
        "does_not_bend": outcome.stiff,
        "constant_push": outcome.push,
        "recalled": 0 if journal is None else journal.recalled,
        "elapsed": outcome.elapsed,
    }
    write_json(outcome.config.out / "design.json", content)


def run():
    """The job from the command line."""
    command.run("design", configure, main, stopped=command.RESUMED)
