"""The page of the job: `report.html`."""

from pathlib import Path
from typing import Any

from ..common import pages
from ..common.amounts import plain
from ..common.html_report import Report, Section, Table
from .scenes import AXES, ORDINARY, TITLES

_FIGURES = {
    "stability_axes": "Each number by itself, from end to end.",
    "stability_pairs": "Numbers in pairs.",
}


def write(config: Any, found: dict[str, Any], fine: bool) -> None:
    """Write the page with the counts by fidelity."""
    rungs: dict[str, dict[str, Any]] = found["fidelities"]
    kinds = ("right", "off", "warned", "refused")
    rows = [
        [name, *(rung[kind] for kind in kinds), f"{100 * found['promise'][name]:g} %",
         f"{100 * rung['largest error under a good status']:.2g} %"]
        for name, rung in rungs.items()
    ]  # fmt: skip
    off = [
        [name, ", ".join(
            f"{TITLES.get(k, plain(k))} {v:.3g}" for k, v in point.items() if k != "error"
        ), f"{100 * point['error']:.2g} %"]
        for name, rung in rungs.items() for point in rung["off at"]
    ]  # fmt: skip
    axes = [
        [f"{TITLES[name]} [{unit}]", f"{low:.3g}", f"{high:.3g}", f"{ORDINARY[name]:.3g}"]
        for name, (low, high, unit) in AXES.items()
    ]
    titles = ["fidelity", *kinds, "promised error", "largest error under a good status"]
    Report(
        "Where each fidelity is right",
        f"Over {found['impacts']} impacts with numbers from end to end of what a sweep may ask "
        "for: is a good status ever wrong?",
        "No point with a good status is beyond the fidelity's promise." if fine else
        "Points with a good status are beyond the fidelity's promise: see below.",
        fine,
        [
            Section("Results", [
                Table(titles, rows),
                *([Table(["fidelity", "at", "error"], off, "Off")] if off else []),
            ]),
            Section("What varied", [
                Table(["number", "from", "to", "otherwise"], axes, "Axes"),
            ]),
            pages.figures(Path(config.out), _FIGURES),
            Section("Statuses", [
                pages.status_table(rung["statuses"], name) for name, rung in rungs.items()
            ]),
            pages.assumptions("The reference, itself refined where it doubts, is the truth."),
            pages.again(config, "stability_map"),
        ],
    ).write(Path(config.out))  # fmt: skip
