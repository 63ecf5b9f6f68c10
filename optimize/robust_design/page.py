"""The page of the job: `report.html`, with the fence's drawing and its DXF file."""

import numpy as np

import fencejax as fj
from fencejax.printing import shown

from ..common import nearby, pages, report
from ..common.amounts import plain
from ..common.encounters import Course, Encounter
from ..common.html_report import Part, Report, Section, Table
from .confidence import Interval
from .configuration import RobustConfig
from .outcome import Outcome
from .problem import Population

_FIGURES = {
    "exceedance": "The share of the fresh parcels that are hit harder than a severity.",
    "by_mass": "The severity of every fresh parcel over its mass.",
    "search": "The search: the measure and the violation at every step.",
}
_WHEN = ("before", "after")
_MEASURES = {"mean": "mean", "cvar": "CVaR", "worst": "worst"}


def write(population: Population, outcome: Outcome, fresh: Encounter, verdict: str) -> None:
    """Write the page and its files."""
    config, space = outcome.config, population.space
    severity = plain(config.severity)
    fence, _ = space.apply(outcome.after)
    course = Course(config.scenes, config.seconds, fj.Fidelity.fast(), machine=config.machine)
    scene = course.scene(space.fence, space.drive, fresh._replace(**fresh.named(0)))
    title = "parcels as they come" if config.machine is None else config.machine.title
    material = ""
    if config.machine is not None and not any("youngs_modulus" in n for n in space.names):
        material = config.machine.materials[0].name
    Report(
        f"A robust fence: {title}",
        f"Which fence makes the {_MEASURES[config.measure]} of the {severity} least over parcels "
        f"as they come, with each limit met for {100 * config.fraction:g} % of them?",
        pages.sentences(
            mine(outcome), f"the {_MEASURES[config.measure]}{verdict.removeprefix(config.measure)}"
        ),
        outcome.succeeded,
        [
            pages.machine_section(config.machine, scene),
            Section("The parcels", [_parcels(fresh)]),
            Section("The design", [
                pages.design_table(space, {"before": outcome.before, "after": outcome.after}),
                *pages.fence_parts(config.out, fence, "Robust fence", material),
            ]),
            Section("Results and limits", _results(population, outcome)),
            pages.figures(config.out, _FIGURES if config.plots else {}),
            Section("What decides", _decides(population, outcome)),
            Section("Statuses and checks", _checks(outcome)),
            pages.assumptions(
                _spread(config),
                f"Intervals are of {100 * config.confidence:g} %: bootstrap for the measures, "
                "exact ones for the shares.",
                "Parcels without numbers count as breaking every limit.",
            ),
            pages.again(config, "robust_design"),
        ],
    ).write(config.out)  # fmt: skip


def rows(population: Population) -> list[nearby.Rows]:
    """The description of the search's margins, in their order: for each limit the margin that the
    stated fraction of parcels reaches."""
    return [nearby.Rows.of(limit, 1) for limit in population.limits]


def mine(outcome: Outcome) -> str:
    """The result for the machine in one sentence."""
    config = outcome.config
    own = outcome.judged["after"].measures[config.measure].value
    text = (
        f"{report.result_of(outcome.limits_hold)} {own:.4g} {config.unit}, the "
        f"{_MEASURES[config.measure]} of the {plain(config.severity)} over {config.fresh} parcels"
    )
    if config.machine is not None and config.machine.title:
        text += f" of {config.machine.title}"
    stiff = f"{outcome.stiff:.4g} {config.unit}"
    return f"{text}; by a fence of that shape that does not bend: {stiff}."


def _spread(config: RobustConfig) -> str:
    """What is assumed of the parcels' numbers."""
    if config.machine is None:
        return "The parcels' numbers are independent of each other, spread as the table says."
    return (
        "The parcels are those of the sorter file: its distributed numbers are independent of each "
        "other, and of the parcels that it lists each comes as often as its weight says. Of "
        "parcels that are not in the file the intervals say nothing."
    )


def _decides(population: Population, outcome: Outcome) -> list[Part | str]:
    optimum, space, unit = outcome.found.optimum, population.space, outcome.config.unit
    if optimum is None:
        return ["A search by fresh batches ends with no multipliers: it says no prices."]
    return [
        *nearby.price_parts(space, optimum, rows(population), unit),
        *nearby.tolerance_parts(space, optimum, rows(population), unit, 0.0),
    ]


def _parcels(fresh: Encounter) -> Table:
    """The ranges of the fresh parcels' numbers."""
    units = {
        "mass": "kg", "length": "m", "breadth": "m", "stiffness": "N/m^4", "offset": "m",
        "front": "m", "angle": "rad", "distance": "m", "drive_angle": "rad",
        "damping": "N s kg^-0.4 m^-3",
    }  # fmt: skip
    rows = []
    for name, values in fresh._asdict().items():
        column, unit = np.asarray(values, dtype=float), units.get(name, "1")
        if np.ptp(column) > 0:
            ends = (float(np.quantile(column, q)) for q in (0, 0.5, 1))
            rows.append([plain(name), *(shown(end, unit) for end in ends)])
    titles = ["number", "least", "median", "most"]
    return Table(titles, rows, f"The {fresh.lanes} fresh parcels that designs are judged on")


def _interval(interval: Interval, unit: str = "", factor: float = 1.0) -> list[str]:
    value, lower, upper = (f"{factor * number:.4g}" for number in interval)
    return [f"{value} {unit}".strip(), f"{lower} ... {upper}"]


def _results(population: Population, outcome: Outcome) -> list[Part | str]:
    config, judged = outcome.config, outcome.judged
    titles = ["", *(cell for when in _WHEN for cell in (when, "interval"))]
    measures = [
        [f"{_MEASURES[name]} {plain(config.severity)}",
         *(cell for when in _WHEN for cell in _interval(judged[when].measures[name], config.unit))]
        for name in _MEASURES
    ]  # fmt: skip
    strong = frozenset({list(_MEASURES).index(config.measure)})
    limits = [
        [plain(limit.name),
         f"{'≤' if limit.sense == 'at most' else '≥'} "
         f"{shown(limit.bound, limit.quantity.unit, 3)}",
         *(cell for when in _WHEN for cell in _interval(
             judged[when].shares[limit.name], "%", 100.0
         ))]
        for limit in population.limits
    ]  # fmt: skip
    measures.append([
        f"{_MEASURES[config.measure]}, fence that does not bend", "", "",
        f"{outcome.stiff:.4g} {config.unit}".strip(), "",
    ])  # fmt: skip
    note = f"Asked for: {100 * config.fraction:g} % of the parcels."
    return [
        Table(titles, measures, "The severity over the fresh parcels", "", strong),
        Table(["limit", "bound", *titles[1:]], limits, "Shares that hold each limit", note),
    ]


def _checks(outcome: Outcome) -> list[Part | str]:
    found, judged = outcome.found, outcome.judged
    ended = "as it should" if found.ended else "short of that"
    return [
        *(pages.status_table(judged[when].statuses, f"Fresh parcels, {when}") for when in _WHEN),
        f"The search ended after {len(found.steps)} steps, {ended}: {found.stop}. "
        f"{100 * judged['after'].excluded:.2g} % of the fresh parcels had no numbers.",
    ]
