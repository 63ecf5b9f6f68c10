"""Sections of the pages of several jobs: the machine, the fence, statuses, assumptions, the
command."""

import importlib.metadata
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import fencejax as fj
from fencejax import plot
from fencejax.design import DesignSpace, Limit, Optimum, fatigue
from fencejax.printing import shown
from fencejax.results import Status
from fencejax.scenes import AnyScene, names as scene_names, numbers as scene_numbers

from . import flags, html_report, machine as machines
from .amounts import plain
from .html_report import Figure, Part, Section, Table, Text, Verbatim

DXF = "fence.dxf"

_MODEL = (
    "The fence's links lie on one line; the rigid one does not bend, and the flexible one is a "
    "linear Euler-Bernoulli beam in its lowest bending modes: good while the tip deflects by less "
    "than a quarter of its length.",
    "The material is linear elastic, damped in proportion to its stiffness; nothing creeps, heats "
    "or wears, and the hinge and its bearings have neither play nor give.",
    "Parcels are rigid rectangles with soft corners: the contact law of Piątkowski (2010), with a "
    "stiffness and a damping that are measured on parcels and not known from their weight.",
    "Friction is dry and the same all over belt and fence; the parcel stays flat on the belt and "
    "does not tip over; the drive follows its law whatever the load.",
)  # fmt: skip


# ---- the machine

_PARTS = {
    "belt": "belt", "fence": "fence", "drive": "drive", "fence_friction": "friction on the fence",
    "border": "border", "parcel": "parcel", "start": "start",
}  # fmt: skip


def scene_table(
    scene: AnyScene, caption: str = "", leave_out: Sequence[str] = (),
    remarks: Mapping[str, str] | None = None,
) -> Table:  # fmt: skip
    """The numbers of a scene with their units, without some parts; `remarks` by path."""
    remarks = {} if remarks is None else remarks
    rows = []
    for path in scene_numbers.names(scene):
        if any(path.startswith(f"{part}.") for part in leave_out):
            continue
        number, value = scene_numbers.number(scene, path), scene_numbers.read(scene, [path])[0]
        rows.append([
            _title(path),
            shown(float(value), number.unit), remarks.get(path, ""),
        ])  # fmt: skip
    law = getattr(scene, "drive", None)
    if law is not None and "drive" not in leave_out:
        rows.append(["drive: law", _word(law, fj.parts.DRIVES), ""])
    return _slim(Table(["number", "value", "remark"], rows, caption))


def machine_tables(
    machine: fj.sorter.Machine, most: int = 24, *, first: bool = False
) -> list[Part | str]:
    """A sorter's numbers with units, which of them are free, and its parcels; of its materials
    the `first` alone, if no other is used."""
    remarks = {
        path: f"free, {shown(s.lower, machine.unit(path))} ... {shown(s.upper, machine.unit(path))}"
        for path, s in machine.free.items()
    } | {
        path: "one of " + ", ".join(shown(value, machine.unit(path)) for value in values)
        for path, values in machine.choices.items()
    }
    table = scene_table(
        machine.scene(0), "Parts", ("parcel", "start", "fence.material", "motor"),
        {fj.sorter.scene_path(path): text for path, text in remarks.items()},
    )  # fmt: skip
    where = "at its shaft" if machine.motor.at_shaft else "at the hinge"
    rows: list[Sequence[Any]] = [*table.rows]
    for name, bounds in machine.motor.bounds.items():
        value, path = getattr(machine.motor, name), f"motor.{name}"
        if value is not None:
            remark = remarks.get(path, where if bounds.unit in ("N m", "rad/s") else "")
            rows.append([_title(path), shown(float(value), bounds.unit), remark])
    known = {row[0] for row in rows}
    for path, text in remarks.items():
        if _title(path) not in known:
            rows.append([_title(path), "", text])
    if machine.period is not None:
        rows.append(["from one parcel to the next", shown(machine.period, "s"), ""])
    full = [[*row, ""][:3] for row in rows]
    parts = _slim(Table(["number", "value", "remark"], full, "Parts"))
    used = machine.materials[:1] if first else machine.materials
    return [parts, material_table(used), parcel_table(machine.parcels, most)]


def material_table(sheets: Sequence[fj.parts.DataSheet]) -> Table:
    """Materials with their allowed stresses."""

    def stress(value: Any) -> str:
        return "" if value is None else shown(float(value), "Pa")

    def exponent(sheet: fj.parts.DataSheet) -> str:
        given = sheet.fatigue_strength is not None
        return shown(float(fatigue.exponent_of(sheet.material)), "1", 3) if given else ""

    rows = [
        [sheet.name, f"{float(sheet.material.youngs_modulus) / 1e9:.4g} GPa",
         shown(float(sheet.material.density), "kg/m^3"), f"{float(sheet.material.damping_ratio):g}",
         stress(sheet.allowed_stress), stress(sheet.fatigue_strength), exponent(sheet),
         sheet.conditions]
        for sheet in sheets
    ]  # fmt: skip
    titles = ["material", "Young's modulus", "density", "damping ratio", "allowed stress",
              "amplitude borne 1e7 times", "exponent of that line", "at"]  # fmt: skip
    caption = "The material" if len(rows) == 1 else "Materials, each designed for itself"
    return _slim(Table(titles, rows, caption))


def _word(part: Any, known: Mapping[str, type]) -> str:
    """The word of a sorter file for the class of a part; the class's name where there is none."""
    kind = type(part)
    return next((name for name, each in known.items() if each is kind), kind.__name__)


def _profile(taper: fj.AbstractTaper) -> str:
    """A taper in words."""
    if isinstance(taper, fj.SteppedTaper):
        return f"{_profile(taper.profile)}, in {taper.steps} steps"
    return _word(taper, fj.parts.TAPERS)


def _title(path: str) -> str:
    """A number of a scene in words."""
    part, _, rest = path.partition(".")
    return f"{_PARTS.get(part, part)}: {plain(rest)}".replace(".", ", ") if rest else plain(path)


def machine_section(
    machine: fj.sorter.Machine | None, scene: AnyScene, notes: Sequence[str] = (),
    title: str = "The machine", *, parcels: bool = True,
) -> Section:  # fmt: skip
    """The sorter of a job for its first material or, without one, the numbers of one of its scenes.

    `notes`: what the job uses of the sorter, a line each; `parcels`: whether it sorts the sorter's
    parcels. Otherwise the parcel of the scene is shown.
    """
    if machine is not None:
        tables = machine_tables(machine, first=True)
        if not parcels:
            others = ("belt", "fence", "drive", "fence_friction", "border", "start", "motor")
            tables[-1] = scene_table(scene, "The parcel in the first of the impacts", others)
        return Section(title, [*tables, *([sentences(*notes)] if notes else [])])
    table = scene_table(scene, "The job's own numbers, one of its scenes")
    return Section(title, [table])


def parcel_table(parcels: fj.sorter.Parcels, most: int) -> Table:
    """The parcels at their places, with their weights where these differ, or the ranges of their
    numbers where there are many."""
    heads = [plain(path.rpartition(".")[2].removeprefix("given_")) for path in parcels.columns]
    units = [unit(path) for path in parcels.columns]
    columns, note = list(parcels.columns.values()), ""
    if np.ptp(parcels.weights) > 0:
        heads, units, columns = [*heads, "weight"], [*units, "1"], [*columns, parcels.weights]
        note = "The weights add up to 1."
    if parcels.count <= most:
        rows = [
            [lane + 1, *(shown(float(c[lane]), u) for c, u in zip(columns, units, strict=True))]
            for lane in range(parcels.count)
        ]
        return Table(["parcel", *heads], rows, f"The {parcels.count} parcels and places", note)
    rows = [
        [head, *(shown(float(np.quantile(c, q)), u) for q in (0, 0.5, 1))]
        for head, c, u in zip(heads, columns, units, strict=True)
    ]
    titles = ["number", "least", "median", "most"]
    return Table(titles, rows, f"The {parcels.count} parcels", note)


def unit(path: str) -> str:
    """The unit of a number of a sorter file."""
    number = scene_names.known(fj.sorter.scene_path(path))
    if number is not None:
        return number.unit
    part, _, name = path.rpartition(".")
    owner = {"motor": fj.Motor, "parcel": fj.Parcel, "parcels": fj.Parcel}.get(part)
    return "1" if owner is None or name not in owner.bounds else owner.bounds[name].unit


def _slim(table: Table) -> Table:
    """The table without empty columns."""
    kept = [k for k in range(len(table.titles)) if any(str(row[k]) for row in table.rows)]
    rows = [[row[k] for k in kept] for row in table.rows]
    return Table([table.titles[k] for k in kept], rows, table.caption, table.note, table.strong)


# ---- designs, limits, statuses


def design_table(space: DesignSpace, designs: Mapping[str, Any]) -> Table:
    """Designs [SI] side by side with the bounds of their variables."""
    rows = []
    for index, variable in enumerate(space.variables):
        values = [float(np.asarray(values)[index]) for values in designs.values()]
        share = float(variable.share(values[-1]))
        note = "on the lower one" if share < 1e-2 else "on the upper one" if share > 0.99 else ""
        name = plain(variable.name.rpartition(".")[2])
        rows.append([
            name, *(shown(value, variable.unit) for value in values),
            f"{shown(variable.lower, variable.unit)} ... {shown(variable.upper, variable.unit)}",
            note,
        ])  # fmt: skip
    return _slim(Table(["number", *designs, "bounds", "ends"], rows, "The numbers designed"))


def limit_table(
    limits: Sequence[Limit], designs: Mapping[str, Mapping[str, Any]], caption: str = "Limits"
) -> Table:
    """Every limit with the value and the margin of the lane with the least margin, for several
    designs."""
    rows = []
    for limit in limits:
        unit, sign = limit.quantity.unit, "≤" if limit.sense == "at most" else "≥"
        row = [plain(limit.name), f"{sign} {shown(limit.bound, unit, 3)}"]
        for measured in designs.values():
            values = np.atleast_1d(np.asarray(measured[limit.name], dtype=float))
            margin = np.asarray(limit.margin_of(values), dtype=float)
            lane = int(np.argmin(margin))
            row += [shown(float(values[lane]), unit), f"{margin[lane]:+.3f}"]
        rows.append(row)
    titles = [each for name in designs for each in (name, "margin")]
    return Table(["limit", "bound", *titles], rows, caption, "A limit holds at a margin of 0 or "
                 "more; of several sorts the tightest is shown.")  # fmt: skip


def status_table(counts: Mapping[str, int], caption: str = "Statuses of the simulations") -> Table:
    """The number of simulations with each status, and its meaning."""
    text = {status.name: status.text for status in Status}
    rows = [[name, n, text.get(name, "there is no such scene")] for name, n in counts.items()]
    return Table(["status", "how many", "what it means"], rows, caption)


def search_text(optimum: Optimum) -> str:
    """How a search ended, in sentences."""
    left = optimum.residual
    limits = "holds all limits" if optimum.feasible else "breaks limits"
    return (
        f"The search stopped after {len(optimum.history)} evaluations: {optimum.ended}. What "
        f"it ended with {limits}. Residuals of the conditions of Karush, Kuhn and Tucker: "
        f"stationarity {left.stationarity:.1e}, complementarity {left.complementarity:.1e}, "
        f"violation {left.violation:.1e}."
    )


def sentences(*texts: str) -> str:
    """Lines of texts as sentences with a capital and a full stop, a paragraph each."""
    lines = [line.strip() for text in texts for line in text.splitlines() if line.strip()]
    return "\n".join(f"{x[0].upper()}{x[1:]}{'' if x[-1] in '.:!?' else '.'}" for x in lines)


def many(count: int, name: str) -> str:
    """`"1 impact"`, `"2 impacts"`."""
    return f"{count} {name}{'' if count == 1 else 's'}"


# ---- the fence


def fence_parts(
    folder: Path, fence: fj.Fence, title: str, material: str = "", conditions: str = ""
) -> list[Part | str]:
    """The drawing sheet of a fence and a table of its dimensions; writes its DXF file."""
    shape = plot.write_dxf(folder / DXF, fence, title)
    named = f"{material} ({conditions})" if conditions else material
    tip = -float(shape.y[shape.x >= shape.x.max()].min())
    notes = [
        "The face, the upper edge from above, is straight and meets the parcels.",
        "The axis of the hinge lies on the face; bearings are not drawn.",
        "Exact outline: fence.dxf, lines and arcs within 0.01 mm of h(x).",
    ]
    if shape.joint > 0:
        notes.append("Where the links meet is the dashed line: the rigid one must not bend.")
    if tip == 0:
        notes.append("The profile ends with no thickness: blunt the tip as the material asks.")
    sheet = plot.fence_drawing(fence, title=title, material=named, notes=notes)
    section = float(fence.width) * float(fence.material.density)
    rows = [
        ["rigid link, l_s", shown(float(fence.rigid_length), "m", 5)],
        ["flexible link, l_p", shown(float(fence.flexible_length), "m", 5)],
        ["reach, l_s + l_p", shown(float(fence.reach), "m", 5)],
        ["thickness at the root, h_1", shown(float(fence.thickness), "m", 5)],
        ["thickness at the tip", shown(tip, "m", 5)],
        ["width, z", shown(float(fence.width), "m", 5)],
        ["profile h(x)", _profile(fence.taper)],
        ["mass", shown(section * shape.area, "kg")],
    ]
    return [
        Table(["dimension", "value"], rows, "Dimensions"),
        Figure.of_axes(sheet, "The fence to scale. Printed on A4 at 100 % a millimetre of the "
                       "sheet is as many of the fence as the scale says.", sheet=True),
        f"The outline for the workshop is {DXF} in the same folder (millimetres; layers OUTLINE, "
        "JOINT, HINGE, DIMENSIONS): one closed line of straight pieces and arcs, whose area times "
        "width and density is the mass above.",
    ]  # fmt: skip


# ---- assumptions and the command


def assumptions(*own: str, model: bool = True) -> Section:
    """The assumptions of the job, and those of any simulation."""
    lines = [*own, *(_MODEL if model else ())]
    return Section("Assumptions", [Text("\n".join(f"- {line}" for line in lines))])


def again(configuration: Any, job: str) -> Section:
    """The command that makes the page again, versions, and the sorter file as it was read."""
    versions = ", ".join(
        f"{name} {importlib.metadata.version(name)}" for name in ("fencejax", "jax", "numpy")
    )
    parts: list[Part | str] = [
        Verbatim(flags.command(configuration, f"optimize.{job}"), "The command:", wrapped=True),
        f"Computed with {versions}, in double precision.",
    ]
    named = getattr(configuration, "sorter", machines.NONE)
    if named != machines.NONE:
        path = machines.file_of(named)
        text = path.read_text(encoding="utf-8")
        parts.append(Verbatim(text, f"The sorter file {path.name}, as it was read:"))
    return Section("How to make this page again", parts)


def figures(folder: Path, captions: Mapping[str, str]) -> Section:
    """The figures in a job's folder."""
    return Section("Figures", html_report.figures(folder, dict(captions)))
