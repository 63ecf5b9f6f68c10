"""The page of the job: `report.html`."""

import numpy as np

from fencejax.printing import shown
from fencejax.study import Sweep

from ..common import html_report, pages
from ..common.amounts import plain
from ..common.html_report import Part, Report, Section, Table
from .configuration import SweepConfig
from .outcome import Outcome

_MOST_FIGURES = 24


def write(
    config: SweepConfig, sweep: Sweep, outcome: Outcome, quantiles: dict[str, dict[str, float]],
    drawn: tuple[str, ...],
) -> None:  # fmt: skip
    """Write the page; `drawn`: names of the figures in the folder."""
    table, samples = outcome.table, sweep.samples
    varied = ", ".join(plain(name) for name in samples.names)
    share = 1 - float(np.mean(table.good))
    rows = [
        [plain(v.name), shown(v.lower, v.unit), shown(v.upper, v.unit), v.scaling]
        for v in samples.variables
    ]
    outputs = [
        [plain(name), *(shown(value, table.units.get(name, "1")) for value in row.values())]
        for name, row in quantiles.items()
    ]
    figures = {name: f"{plain(name)} over {varied}." for name in drawn[:_MOST_FIGURES]}
    Report(
        f"Sweep of {plain(config.scene)} over {varied}",
        f"What do {', '.join(map(plain, config.outputs))} become as {varied} vary, at "
        f"{samples.count} points?",
        f"{samples.count} simulations, of which {100 * share:.3g} % have no good numbers "
        f"(tolerated: {100 * config.tolerated:g} %).",
        outcome.succeeded,
        [
            Section("What varied", [
                Table(["number", "from", "to", "scaling"], rows, f"{config.sampling} points"),
            ]),
            Section("What was constant", _fixed(config, sweep, outcome)),
            Section("Results", [
                Table(["output", "least", "5 %", "median", "95 %", "most"], outputs,
                      "Outputs over the points with good numbers"),
            ]),
            Section("Figures", html_report.figures(config.out, figures)),
            Section("Statuses", [pages.status_table(table.counts())]),
            pages.assumptions(),
            pages.again(config, "sweep"),
        ],
    ).write(config.out)  # fmt: skip


def _fixed(config: SweepConfig, sweep: Sweep, outcome: Outcome) -> list[Part | str]:
    """The numbers of a point with a scene."""
    good = np.flatnonzero(outcome.table.good)
    if not good.size:
        return ["No point has good numbers."]
    scene = sweep.family.scene(np.asarray(sweep.samples.values[good[0]]))
    table = pages.scene_table(scene, "The scene of the first point with good numbers")
    return [table, *([pages.sentences(*config.notes)] if config.notes else [])]
