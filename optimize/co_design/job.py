"""Fence, material and the drive's free-form motion designed together.

    python -m optimize.co_design --out out

The motion is a spline through free control angles over a cycle of free length, within a fixed
period from parcel to parcel. The largest peak force of several whole sorts is minimised, with
limits on the fence (tip deflection, stress), on the sort (the parcel gets across), on the drive
(speed, acceleration and jerk, exact for the spline; torque, parcel included) and on the fence's
residual oscillation when the next cycle begins. Searches start from the paper's fence, with the
spline nearest to the paper's drive, and from other fences with that drive, as each search may end
in another local optimum. After some evaluations only the most promising one continues to its end.

Every evaluation is written to `evaluations.jsonl` at once: the same command with the same folder
goes on where it was interrupted.
"""

import dataclasses
import time
from collections.abc import Callable

import numpy as np

from fencejax.design import Journal, Optimum, Stop, minimize, objectives, verify
from fencejax.printing import shown
from fencejax.results import counted

from ..common import command, designs, evaluations, machine, nearby, pages, report, starts
from ..common.amounts import plain
from . import page
from .configuration import CoDesignConfig, configure
from .outcome import Outcome
from .problem import Joint


def main(config: CoDesignConfig | None = None, *, quiet: bool = False) -> Outcome:
    """Run the job, print its progress, and write its files into `config.out`."""
    say = command.begin(quiet)
    begin = time.perf_counter()
    config = CoDesignConfig() if config is None else config
    joint = Joint(config)
    joint.check()
    config.out.mkdir(parents=True, exist_ok=True)
    journal = evaluations.journal(config, say)
    for line in machine.notes(config.machine):
        say(line)
    say(
        f"{joint.encounters.lanes} sorts, {len(joint.space.names)} variables: "
        f"{', '.join(joint.space.names)}; compiling (minutes, the first time) ..."
    )
    tried, optimum = _search(joint, journal, say)
    given = joint.starts[0]
    say(f"\nstopped: {optimum.stop.value} ({len(optimum.history)} evaluations)")
    measured = {
        "before": joint.measure(given), "after": joint.measure(optimum.point),
    }  # fmt: skip
    verified = verify(
        lambda z: (*joint.combined(measured["after"], 0.0), measured["after"]["status"]),
        optimum,
        agreement=config.agreement,
        feasibility=config.feasibility,
    )
    before, after = (np.asarray(joint.space.from_shares(z)) for z in (given, optimum.point))
    outcome = Outcome(
        config, joint, tuple(tried), optimum, before, after, measured, verified,
        joint.stiff(optimum.point), joint.push(optimum.point), time.perf_counter() - begin,
    )  # fmt: skip
    say("\n" + _table(outcome) + "\n\n" + _verdict(outcome) + "\n\n" + _mine(outcome))
    _write(outcome, journal)
    say(f"wrote {config.out} ({time.perf_counter() - begin:.1f} s in all)")
    return outcome


def _search(
    joint: Joint, journal: Journal, say: Callable[[str], None]
) -> tuple[list[Optimum], Optimum]:
    """The results of the first searches from several starts, and of the one that was continued."""
    config = joint.config

    def search(start: np.ndarray, budget: int, known: int = 0) -> Optimum:
        return minimize(
            joint.program,
            start,
            data=(joint.encounters,),
            tolerance=config.tolerance,
            feasibility=config.feasibility,
            budget=budget,
            journal=journal,
            progress=lambda one: say(report.progress_line(one)) if one.evaluation > known else None,
        )

    if len(joint.starts) == 1:
        return [], search(joint.starts[0], config.budget)
    few = min(config.scouting, config.budget)
    tried, which = starts.scouted(search, joint.starts, few)
    say(f"\n{starts.summary(tried)}")
    # Its first evaluations are in the journal and are not made again.
    return tried, search(joint.starts[which], config.budget, few)


def _worst(outcome: Outcome, when: str) -> dict[str, float]:
    """The smallest margin of every limit at the finer fidelity."""
    rows = outcome.joint.margins(outcome.measured[when])
    return {name: float(np.min(row)) for name, row in rows.items()}


def _table(outcome: Outcome) -> str:
    config, joint, measured = outcome.config, outcome.joint, outcome.measured
    lines = [report.design_table(joint.space, outcome.before, outcome.after)]
    title = f"worst of the sorts, {config.verify}"
    lines.append(f"\n{title:<34}{'before':>22}{'after':>22}   limit")

    def line(title: str, cells: list[str], bound: str = "") -> None:
        lines.append(f"{title:<34}{cells[0]:>22}{cells[1]:>22}{bound}")

    forces = [float(np.max(measured[when]["peak_force"])) for when in ("before", "after")]
    line("peak force", [shown(force, "N") for force in forces])
    line("of a fence that does not bend", ["", shown(outcome.stiff, "N")])
    line("constant push, point mass", ["", shown(outcome.push, "N")])
    margins = {when: joint.margins(measured[when]) for when in ("before", "after")}
    for row in joint.rows(measured["after"]):
        cells = []
        for when in ("before", "after"):
            lane = int(np.argmin(np.ravel(margins[when][row.name])))
            value = float(np.ravel(measured[when][row.name])[lane])
            cells.append(shown(abs(value) if row.at_most else value, row.unit))
        sign = "at most" if row.at_most else "at least"
        line(plain(row.name), cells, f"   {sign} {shown(row.bound, row.unit)}")
    return "\n".join(lines)


def _mine(outcome: Outcome) -> str:
    """The result for the machine, and the active limits and bounds."""
    joint, optimum = outcome.joint, outcome.optimum
    if optimum.stop is Stop.FAILED_START:
        return ""
    found, machine = outcome.measured["after"], outcome.config.machine
    of = f"largest peak force over the {pages.many(joint.encounters.lanes, 'sort')}"
    of += "" if machine is None or not machine.title else f" of {machine.title}"
    lane = int(np.argmax(found["peak_force"]))
    result = report.mine(
        float(found["peak_force"][lane]), objectives.PEAK_FORCE, of, joint.encounters.text(lane),
        outcome.stiff, outcome.push, feasible=optimum.feasible,
    )  # fmt: skip
    return f"{nearby.price_text(joint.space, optimum, joint.rows(found), 'N')}\n\n{result}"


def _verdict(outcome: Outcome) -> str:
    optimum, verified, config = outcome.optimum, outcome.verified, outcome.config
    if optimum.stop is Stop.FAILED_START:
        return report.failed_start(
            outcome.joint.encounters.text, outcome.measured["before"]["status"]
        )
    text = report.conditions(optimum)
    text += report.verdict(config.verify, objectives.PEAK_FORCE, verified) + "\n"
    if not optimum.feasible:
        return text + report.infeasible(optimum)
    old, new = (float(np.max(outcome.measured[w]["peak_force"])) for w in ("before", "after"))
    change = f"{100 * (new / old - 1):+.1f} %"
    text += f"the worst peak force goes from {old:.1f} to {new:.1f} N ({change})"
    broken = [name for name, least in _worst(outcome, "before").items() if least < 0]
    if broken:
        named = ", ".join(broken).replace("_", " ")
        text += f"; the design before breaks the limits of {named}"
    if not optimum.converged:
        text += "\nnot shown to be optimal: " + optimum.stop.value
    return text


def _write(outcome: Outcome, journal: Journal) -> None:
    config, joint, optimum = outcome.config, outcome.joint, outcome.optimum
    space = joint.space
    content = {
        "config": dataclasses.asdict(config),
        "succeeded": outcome.succeeded,
        **report.ended(optimum),
        "recalled": journal.recalled,
        "starts": [
            {"lowest_force": starts.lowest(one), "stop": one.ended,
             "evaluations": len(one.history)}
            for one in outcome.tried
        ],
        "design": {"before": space.named(outcome.before), "after": space.named(outcome.after)},
        "on_bounds": designs.on_bounds(space, outcome.after),
        "encounters": [joint.encounters.named(i) for i in range(joint.encounters.lanes)],
        "verified": report.verified(config.verify, outcome.verified),
        "statuses": counted(outcome.measured["after"]["status"]),
        "measured": outcome.measured,
        "does_not_bend": outcome.stiff,
        "constant_push": outcome.push,
        "smallest_margins": {when: _worst(outcome, when) for when in ("before", "after")},
        "history": report.history_rows(space, optimum),
        "elapsed": outcome.elapsed,
    }
    report.write_json(config.out / "co_design.json", content)
    if config.plots:
        from . import figures

        figures.motion(joint, outcome.before, outcome.after, config.out)
        lane = int(np.argmax(outcome.measured["after"]["peak_force"]))
        figures.sorts(joint, outcome.before, outcome.after, lane, config.out)
        figures.search(joint, optimum, config.out)
    page.write(outcome, _verdict(outcome))


def run():
    """The job from the command line."""
    command.run("co_design", configure, main, stopped=command.RESUMED)
