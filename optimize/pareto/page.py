"""The page of the job: `report.html`, with the drawing of a fence from the front and its DXF."""

import numpy as np

import fencejax as fj
from fencejax.printing import shown

from ..common import nearby, pages
from ..common.amounts import plain
from ..common.html_report import Part, Report, Section, Table
from .outcome import Front
from .trace import Point

_FIGURES = {
    "front": "The front: the least worst peak force over what it costs, beside the bound.",
    "designs": "The numbers of the designs along the front.",
}


def chosen(front: Front) -> Point | None:
    """The front's knee: the point that is furthest on the good side of the line between its ends,
    both axes taken over their ranges; `None` where there is no front."""
    kept = [p for p, good in zip(front.points, front.on_front, strict=True) if good]
    if len(kept) < 2:
        return None
    plane = np.array([(p.other, p.force) for p in kept])
    spans = np.ptp(plane, axis=0)
    if not np.all(spans > 0):
        return kept[0]
    return kept[int(np.argmin(np.sum((plane - plane.min(axis=0)) / spans, axis=1)))]


def write(front: Front, verdict: str, unit_of_margin: float) -> None:
    """Write the page and what belongs to it; `unit_of_margin`: what the search measured the other
    quantity's margin in."""
    config, tradeoff, point = front.config, front.tradeoff, chosen(front)
    name, unit = plain(tradeoff.quantity.name), tradeoff.quantity.unit
    machine, space = config.machine, tradeoff.space
    encounters = tradeoff.encounters
    scene = tradeoff.course(fj.Fidelity.fast()).scene(
        space.fence, space.drive, encounters._replace(**encounters.named(0))
    )
    title = "the paper's sorter" if machine is None else machine.title
    Report(
        f"Peak force against {name}: {title}",
        f"How much less does the fence hit for more {name}, over "
        f"{pages.many(encounters.lanes, config.kind.removesuffix('s'))}, within the limits that "
        "hold in any case?",
        pages.sentences(verdict),
        front.succeeded,
        [
            pages.machine_section(machine, scene),
            Section("The front", [_points(front)]),
            pages.figures(config.out, _FIGURES if config.plots else {}),
            Section("A design from the front", _design(front, point)),
            Section("What decides there", _decides(front, point, unit_of_margin)),
            Section("Statuses and checks", _checks(front)),
            pages.assumptions(
                "Every point is a local optimum: another start may lead lower.",
                "The constant-force stop is a bound over the travel that each design itself shows.",
                f"Of the front's points the fence drawn is its knee: {shown(point.force, 'N')} at "
                f"{shown(point.other, unit)}; any other is as good for whom its {name} suits."
                if point is not None
                else "There is no front to choose a fence from.",
            ),
            pages.again(config, "pareto"),
        ],
    ).write(config.out)


def _points(front: Front) -> Table:
    tradeoff = front.tradeoff
    name, unit = plain(tradeoff.quantity.name), tradeoff.quantity.unit
    rows, best = [], chosen(front)
    strong = set()
    for point, good, least in zip(front.points, front.on_front, front.least_force, strict=True):
        design = [
            shown(float(value), v.unit)
            for v, value in zip(tradeoff.space.variables, point.values, strict=True)
        ]
        if point is best:
            strong.add(len(rows))
        rows.append([
            shown(point.other, unit), shown(point.force, "N"), shown(float(least), "N"), *design,
            "on the front" if good else "left out", "sound" if point.sound else "not sound",
        ])  # fmt: skip
    titles = [
        name, "worst peak force", "constant-force stop", *map(plain, tradeoff.space.names), "", "",
    ]  # fmt: skip
    note = "Sound: feasible, sought to the end and confirmed. In bold: the fence drawn below."
    return Table(titles, rows, "Points", note, frozenset(strong))


def _design(front: Front, point: Point | None) -> list[Part | str]:
    if point is None:
        return []
    space, machine = front.tradeoff.space, front.config.machine
    fence, _ = space.apply(point.values)
    start = space.from_shares(front.tradeoff.start)
    material = ""
    if machine is not None and not any("youngs_modulus" in n for n in space.names):
        material = machine.materials[0].name
    return [
        pages.design_table(space, {"before": start, "after": point.values}),
        pages.limit_table(front.tradeoff.limits, {"after": point.found.lanes}),
        *pages.fence_parts(front.config.out, fence, "Fence from the front's knee", material),
    ]


def _decides(front: Front, point: Point | None, of_margin: float) -> list[Part | str]:
    """Prices and tolerances at the design drawn."""
    if point is None:
        return []
    tradeoff, lanes = front.tradeoff, front.tradeoff.encounters.lanes
    rows = [nearby.Rows.of(limit, lanes) for limit in tradeoff.limits]
    left = point.optimum.margins.size - lanes * len(rows)
    unit, bound = tradeoff.quantity.unit, point.bound
    # The bound that the front steps; of the points without one it is loose, and decides nothing.
    name = f"{tradeoff.quantity.name}, as the front steps it"
    rows.append(nearby.Rows(name, bound, unit, of_margin, True, left))
    return [
        *nearby.price_parts(tradeoff.space, point.optimum, rows, "N"),
        *nearby.tolerance_parts(tradeoff.space, point.optimum, rows, "N", 0.0),
    ]


def _checks(front: Front) -> list[Part | str]:
    counts: dict[str, int] = {}
    for point in front.points:
        for name, count in point.found.statuses.items():
            counts[name] = counts.get(name, 0) + count
    told = [
        f"- {shown(p.other, front.tradeoff.quantity.unit)}: {p.verified.text}"
        for p in front.points if p.verified is not None and not p.verified.confirmed
    ]  # fmt: skip
    parts: list[Part | str] = [pages.status_table(counts, "Encounters of all points")]
    return [*parts, "Contradicted by the finer fidelity:", "\n".join(told)] if told else parts
