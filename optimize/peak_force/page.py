"""The page of the job: `report.html`, with the fence's drawing and its DXF file."""

import numpy as np

from fencejax.printing import shown
from fencejax.results import counted

from ..common import nearby, pages, report
from ..common.amounts import plain
from ..common.html_report import Report, Section, Table
from .configuration import PeakForceConfig
from .impacts import Impacts
from .outcome import Outcome

_UNITS = {
    "thickness": "m", "rigid_length": "m", "flexible_length": "m", "youngs_modulus": "Pa",
    "fence_mass": "kg", "peak_force": "N", "rigid_obstacle_over_peak": "1",
    "peak_force_in_sorts": "N",
}  # fmt: skip
_TITLES = {"rigid_obstacle_over_peak": "rigid obstacle's force over it"}
_FIGURES = {
    "force": "Force on the parcel in the impact in which the optimum's is largest.",
    "tip_deflection": "Deflection of the tip in the impact in which it is largest for the optimum.",
    "convergence": "The search: the worst case, violation and residual at every evaluation.",
    "gradient": "What 1 % more of a number does in percent, by the exact gradient.",
}


def write(
    config: PeakForceConfig, outcome: Outcome, impacts: Impacts, verdict: str,
    side_by_side: dict[str, dict],
) -> None:  # fmt: skip
    """Write the page and its files."""
    space, optimum, measured = outcome.space, outcome.optimum, outcome.measured
    quantity, limits = outcome.objective, outcome.limits
    fence, drive = space.apply(outcome.after)
    designs = {"two-link": "before", "one-link": "one_link", "optimum": "after"}
    margins = rows(outcome, impacts)
    title = "paper's impacts" if config.machine is None else config.machine.title
    lanes = pages.many(len(impacts.lanes), "impact")
    name = f"Optimum for {lanes}"
    material = ""
    if config.machine is not None and "youngs_modulus" not in " ".join(space.names):
        material = config.machine.materials[0].name
    Report(
        f"The least {plain(quantity.name)}: {title}",
        f"Which {', '.join(plain(n) for n in space.names)} make the worst {plain(quantity.name)} "
        f"over {lanes} least, within {pages.many(len(limits), 'limit')}?",
        pages.sentences(
            mine(config, outcome, impacts),
            verdict.removeprefix(report.conditions(optimum)),
        ),
        outcome.succeeded,
        [
            pages.machine_section(
                config.machine, impacts.scene(space.fence, space.drive, *impacts.lanes[0]),
                config.notes, parcels=False,
            ),
            Section("The design", [
                pages.design_table(space, {"before": outcome.before, "after": outcome.after}),
                *pages.fence_parts(config.out, fence, name, material),
            ]),
            Section("Results and limits", [
                _comparison(config, side_by_side),
                pages.limit_table(limits, {t: measured[k] for t, k in designs.items()}),
                _impacts(outcome, impacts, designs),
            ]),
            pages.figures(config.out, _FIGURES if config.plots else {}),
            Section("What decides", nearby.price_parts(space, optimum, margins, quantity.unit)),
            Section("Tolerances", nearby.tolerance_parts(
                space, optimum, margins, quantity.unit, config.reserve
            )),
            Section("Statuses and checks", [
                pages.status_table(counted(measured["after"]["status"]), "Impacts at the optimum"),
                pages.search_text(optimum),
            ]),
            pages.assumptions(
                f"The impacts start at the first contact, the drive at {config.drive_angle:g} rad; "
                "that they are diverted is asked of them, and of whole sorts afterwards.",
            ),
            pages.again(config, "peak_force"),
        ],
    ).write(config.out)  # fmt: skip


def rows(outcome: Outcome, impacts: Impacts) -> list[nearby.Rows]:
    """The description of the search's margins, in their order."""
    return [nearby.Rows.of(limit, len(impacts.lanes)) for limit in outcome.limits]


def mine(config: PeakForceConfig, outcome: Outcome, impacts: Impacts) -> str:
    """The result for the machine in one sentence."""
    quantity = outcome.objective
    values = np.asarray(outcome.measured["after"][quantity.name])
    lane = int(np.argmax(values))
    distance, mass = impacts.lanes[lane]
    of = f"largest {plain(quantity.name)} over {pages.many(len(impacts.lanes), 'impact')}"
    of += " of the paper's fence and drive" if config.machine is None else ""
    force = float(outcome.stiff[lane]) if quantity.name == "peak_force" else None
    where = f"R = {distance:g} m, {mass:g} kg"
    feasible = outcome.optimum.feasible
    return report.mine(float(values[lane]), quantity, of, where, obstacle=force, feasible=feasible)


def _comparison(config: PeakForceConfig, side_by_side: dict[str, dict]) -> Table:
    """The three fences, the worst of each number over the impacts."""
    names = [n for n in next(iter(side_by_side.values())) if n in _UNITS]
    rows = [
        [_TITLES.get(name, plain(name)),
         *("" if row[name] is None else shown(row[name], _UNITS[name])
           for row in side_by_side.values())]
        for name in names
    ]  # fmt: skip
    caption = "The paper's fences beside the optimum"
    if config.machine is not None:
        caption = (
            "The sorter's own fence (two-link) and the same without its rigid link (one-link) "
            "beside the optimum"
        )
    return Table(["", *side_by_side], rows, caption)


def _impacts(outcome: Outcome, impacts: Impacts, designs: dict[str, str]) -> Table:
    """The objective in every impact."""
    quantity = outcome.objective
    rows = [
        [f"R = {distance:g} m, {mass:g} kg",
         *(shown(float(outcome.measured[k][quantity.name][lane]), quantity.unit)
           for k in designs.values()), shown(float(outcome.stiff[lane]), "N")]
        for lane, (distance, mass) in enumerate(impacts.lanes)
    ]  # fmt: skip
    titles = ["impact", *designs, "rigid obstacle's force"]
    return Table(titles, rows, f"The {plain(quantity.name)} in every impact")
