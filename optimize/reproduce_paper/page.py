"""The page of the job: `report.html`."""

import numpy as np

from fencejax.results import counted

from ..common import pages
from ..common.html_report import Report, Section, Table, Verbatim
from . import tables
from .configuration import PaperConfig
from .fences import NAMES
from .outcome import Outcome

_FIGURES = {
    "figure_08_impact": "The impact near the tip, as the paper's Fig. 8.",
    "figure_09_force": "Drop of the force over mass and place, as the paper's Fig. 9.",
    "figure_10_tip": "Tip deflection over mass and place, as the paper's Fig. 10.",
    "figure_11_slide": "The slide along the fence, as the paper's Fig. 11.",
    "sensitivities": "Sensitivities of the peak force, which the paper could not give.",
}


def write(config: PaperConfig, outcome: Outcome) -> None:
    """Write the page."""
    rows = [[f.says, f.found, f.verdict, "" if f.verdict == "yes" else f.remark]
            for f in outcome.findings]  # fmt: skip
    yes, no = (sum(f.verdict == word for f in outcome.findings) for word in ("yes", "no"))
    stiff, rigid = outcome.stiff, outcome.rigid
    numbers = [
        ["normal approach speed there", f"{stiff.speed[0]:.2f} m/s"],
        ["normal approach speed at the tip", f"{stiff.tip_speed[0]:.2f} m/s"],
        ["N_stiff, rigid obstacle", f"{stiff.peak[0]:.0f} N"],
        ["undeformable fence in the same sort", f"{rigid.peak_force[0]:.0f} N"],
    ]
    sorts = [
        [f"{what}, {name}", f"{cycle.peak_force[k]:.0f} N",
         f"{1e3 * cycle.tip_deflection[k]:.1f} mm"]
        for what, cycle in (("impact", outcome.impact), ("slide", outcome.slide))
        for k, name in enumerate(NAMES)
    ]  # fmt: skip
    dependence = []
    if outcome.variants:
        text = tables.dependence_table(outcome.coarse, outcome.variants)
        dependence = [Verbatim(text, "One number at a time, maps on the coarse grid:")]
    statuses = np.concatenate([outcome.impact.status, outcome.slide.status])
    Report(
        "The paper recomputed",
        "Does the model give what T. Piątkowski, Active fence with flexible link, J. Theor. Appl. "
        "Mech. 48(1), 87-109, 2010, reports?",
        f"{yes} of the paper's {len(outcome.findings)} statements hold as they stand; {no} the "
        f"model contradicts: see why below. {' '.join(tables.CHOSEN.split())}",
        outcome.agrees,
        [
            Section("Statements", [
                Table(["the paper says", "we get (two-link / one-link)", "agrees", "why"], rows),
            ]),
            Section("Numbers", [
                Table(["number", "value"], numbers, f"The impact at R = {config.distance:g} m"),
                Table(["sort, fence", "peak force", "tip deflection"], sorts, "Whole sorts"),
            ]),
            pages.figures(config.out, _FIGURES if config.plots else {}),
            Section("Numbers that the paper leaves open", dependence),
            Section("Statuses", [
                pages.status_table(counted(statuses), "Whole sorts"),
                pages.status_table(outcome.maps.counts(), "Maps"),
            ]),
            pages.assumptions("Numbers that the paper does not print are as the table of open "
                              "numbers has them."),
            pages.again(config, "reproduce_paper"),
        ],
    ).write(config.out)  # fmt: skip
