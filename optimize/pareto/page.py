"""The page of the job: `report.html`, with the drawing of a fence from the front and its DXF."""


import fencejax as fj
from fencejax.design import objectives
from fencejax.printing import shown

from ..common import nearby, pages, report
from ..common.amounts import plain
from ..common.html_report import Part, Report, Section, Table
from .outcome import Front
from .trace import Point

_FIGURES = {
    "front": "The front: the least worst peak force over what it costs, beside the bound.",
    "designs": "The numbers of the designs along the front.",
}


def chosen(front: Front) -> Point | None:
    """The front's knee; `None` where there is no front."""
    return None if front.knee is None else front.points[front.knee]


def mine(front: Front) -> str:
    """The result for the machine, at the front's knee, in one sentence."""
    if front.knee is None:
        return ""
    point, machine = front.points[front.knee], front.config.machine
    kind = front.config.kind.removesuffix("s")
    of = f"largest peak force over {pages.many(front.tradeoff.encounters.lanes, kind)}"
    of += f" of {machine.title}" if machine is not None and machine.title else ""
    name = plain(front.tradeoff.quantity.name)
    where = f"{name} {shown(point.other, front.tradeoff.quantity.unit)}, the front's knee"
    return report.mine(point.force, objectives.PEAK_FORCE, of, where, front.stiff)


def rows(front: Front, point: Point, of_margin: float) -> list[nearby.Rows]:
    """The description of the margins of the search for a point, in their order."""
    tradeoff, lanes = front.tradeoff, front.tradeoff.encounters.lanes
    found = [nearby.Rows.of(limit, lanes) for limit in tradeoff.limits]
    left = point.optimum.margins.size - lanes * len(found)
    # The bound that the front steps; of the points without one it is loose, and decides nothing.
    name = f"{tradeoff.quantity.name}, as the front steps it"
    bound = nearby.Rows(name, point.bound, tradeoff.quantity.unit, of_margin, True, left)
    return [*found, bound]


def write(front: Front, verdict: str, unit_of_margin: float) -> None:
    """Write the page and its files; `unit_of_margin`: the unit of the other quantity's margin in
    the search."""
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
        pages.sentences(mine(front), verdict),
        front.succeeded,
        [
            pages.machine_section(machine, scene, config.notes),
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
    table, best = [], chosen(front)
    strong = set()
    for point, good, least in zip(front.points, front.on_front, front.least_force, strict=True):
        design = [
            shown(float(value), v.unit)
            for v, value in zip(tradeoff.space.variables, point.values, strict=True)
        ]
        if point is best:
            strong.add(len(table))
        table.append([
            shown(point.other, unit), shown(point.force, "N"), shown(float(least), "N"), *design,
            "on the front" if good else "left out", "sound" if point.sound else "not sound",
        ])  # fmt: skip
    titles = [
        name, "worst peak force", "constant-force stop", *map(plain, tradeoff.space.names), "", "",
    ]  # fmt: skip
    note = "Sound: feasible, sought to the end and confirmed. In bold: the fence drawn below."
    return Table(titles, table, "Points", note, frozenset(strong))


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
    tradeoff, margins = front.tradeoff, rows(front, point, of_margin)
    return [
        *nearby.price_parts(tradeoff.space, point.optimum, margins, "N"),
        *nearby.tolerance_parts(tradeoff.space, point.optimum, margins, "N", 0.0),
    ]


def _checks(front: Front) -> list[Part | str]:
    counts: dict[str, int] = {}
    for point in front.points:
        for name, count in point.found.statuses.items():
            counts[name] = counts.get(name, 0) + count
    contradicted = [
        f"- {shown(p.other, front.tradeoff.quantity.unit)}: {p.verified.text}"
        for p in front.points if p.verified is not None and not p.verified.confirmed
    ]  # fmt: skip
    parts: list[Part | str] = [pages.status_table(counts, "Encounters of all points")]
    if not contradicted:
        return parts
    return [*parts, "Contradicted by the finer fidelity:", "\n".join(contradicted)]
