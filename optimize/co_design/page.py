"""The page of the job: `report.html`, with the fence's drawing and its DXF file."""

import numpy as np

import fencejax as fj
from fencejax.printing import shown
from fencejax.results import counted

from ..common import nearby, pages, report, starts
from ..common.amounts import plain
from ..common.encounters import Course
from ..common.html_report import Part, Report, Section, Table
from .outcome import Outcome

_FIGURES = {
    "motion": "The drive's motion before and after, with its limits.",
    "sorts": "Force, tip deflection and torque over the sort that is hardest after.",
    "search": "The search: the worst case, violation and residual at every evaluation.",
}


def write(outcome: Outcome, verdict: str) -> None:
    """Write the page and its files."""
    config, joint, optimum = outcome.config, outcome.joint, outcome.optimum
    space, measured = joint.space, outcome.measured
    fence, _ = space.apply(outcome.after)
    course = Course("sorts", config.seconds, fj.Fidelity.fast(), machine=config.machine)
    first = joint.encounters._replace(**joint.encounters.named(0))
    rows = joint.rows(measured["after"])
    title = "the paper's sorter" if config.machine is None else config.machine.title
    material = ""
    if config.machine is not None and not any("youngs_modulus" in n for n in space.names):
        material = config.machine.materials[0].name
    checked, *sentences = verdict.removeprefix(report.conditions(optimum)).splitlines()
    Report(
        f"Fence and motion together: {title}",
        "Which fence, and which motion of its drive, make the worst peak force over "
        f"{pages.many(joint.encounters.lanes, 'whole sort')} least, within the limits of fence, "
        "sort, drive and ring-down?",
        pages.sentences(*sentences, checked),
        outcome.succeeded,
        [
            pages.machine_section(
                config.machine, course.scene(space.fence, space.drive, first)
            ),
            Section("The design", [
                pages.design_table(space, {"before": outcome.before, "after": outcome.after}),
                *pages.fence_parts(config.out, fence, "Fence designed with its motion", material),
            ]),
            Section("Results and limits", _results(outcome)),
            pages.figures(config.out, _FIGURES if config.plots else {}),
            Section("What decides", nearby.price_parts(space, optimum, rows, "N")),
            Section("Tolerances", nearby.tolerance_parts(space, optimum, rows, "N", 0.0)),
            Section("Statuses and checks", [
                pages.status_table(counted(measured["after"]["status"]), "Sorts at the design"),
                pages.search_text(optimum),
                *filter(None, [starts.summary(outcome.tried)]),
            ]),
            pages.assumptions(
                "The drive follows the motion exactly; the torque it takes for that is limited, "
                "the parcel's force included.",
                "What the fence still holds when the next sort begins is taken for its first mode.",
            ),
            pages.again(config, "co_design"),
        ],
    ).write(config.out)  # fmt: skip


def _results(outcome: Outcome) -> list[Part | str]:
    """The worst of every limited number before and after, and every sort."""
    joint, measured, when = outcome.joint, outcome.measured, ("before", "after")
    margins = {name: joint.margins(measured[name]) for name in when}
    rows = [["peak force", "minimised", *(
        cell for name in when for cell in (shown(float(np.max(measured[name]["peak_force"])), "N"),
                                           "")
    )]]  # fmt: skip
    for one in joint.rows(measured["after"]):
        row = [plain(one.name), f"{'≤' if one.at_most else '≥'} {shown(one.bound, one.unit, 3)}"]
        for name in when:
            left = np.ravel(np.asarray(margins[name][one.name]))
            lane = int(np.argmin(left))
            value = float(np.ravel(measured[name][one.name])[lane])
            row += [shown(value, one.unit), f"{left[lane]:+.3f}"]
        rows.append(row)
    rows.append(["peak force of a fence that does not bend", "", "", "",
                 shown(outcome.stiff, "N"), ""])
    rows.append(["constant push", "", "", "", shown(outcome.push, "N"), ""])
    titles = ["", "bound", *(cell for name in when for cell in (name, "margin"))]
    every = [
        [f"{number['mass']:g} kg, {1e3 * number['offset']:g} mm from the border",
         *(shown(float(measured[name]["peak_force"][lane]), "N") for name in when)]
        for lane in range(joint.encounters.lanes)
        for number in [joint.encounters.named(lane)]
    ]  # fmt: skip
    return [
        Table(titles, rows, "Objective and limits", "Each at its tightest; a limit holds at a "
              "margin of 0 or more.", frozenset({0})),
        Table(["sort", *when], every, "Peak force of every sort"),
    ]  # fmt: skip
