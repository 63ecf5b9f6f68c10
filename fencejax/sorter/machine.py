"""A sorter as parts, read from its tables and checked."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .. import _check, printing
from .._identity import refused, text
from ..parts import (
    AbstractDrive,
    AbstractFriction,
    Belt,
    Border,
    DataSheet,
    Fence,
    Motor,
    Parcel,
    on_cover,
)
from ..printing import Readable, as_table, shown
from ..scenes import OnBelt, Scene, numbers as scene_numbers
from ..study import SceneFamily
from . import limits as limit_table, objective, parcels as parcel_table, plausibility, reading
from .amounts import amount, refuse_unknown
from .objective import Objective
from .parcels import Parcels
from .reading import Reading, Span, Table

SECTIONS = (
    "title", "period", "belt", "parcels", "fence", "drive", "motor", "border", "fence_friction",
    "limits", "objective",
)  # fmt: skip
"""The keys of a sorter file."""


class MachineParts(eqx.Module):
    """The parts whose numbers have names, under their names in a scene: those of a machine, and the
    first parcel with its place."""

    belt: Belt
    fence: Fence
    drive: AbstractDrive
    fence_friction: AbstractFriction | None
    border: Border | None
    motor: Motor | None
    parcel: Parcel
    start: OnBelt


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Machine(Readable):
    """A sorter's parts, its parcels, its free numbers, its limits and its objective.

    **Fields:**

    - `title`: its name.
    - `belt`, `fence`, `drive`, `motor`, `fence_friction`, `border`: the parts, with free numbers at
      their start values and the fence of the first material.
    - `materials`: those that the fence may have.
    - `parcels`: those that are sorted, with their places.
    - `period` [s]: from one parcel to the next; `None` where it is not given.
    - `free`: lower and upper bounds [SI] of the free numbers, by path; `choices`: the lists of
      numbers to choose from [SI], by path.
    - `bounds`: the rows of the table of limits, with the given bounds.
    - `objective`: of the design.
    """

    title: str
    belt: Belt
    fence: Fence
    drive: AbstractDrive
    motor: Motor
    fence_friction: AbstractFriction | None
    border: Border | None
    materials: tuple[DataSheet, ...]
    parcels: Parcels
    period: float | None
    free: Mapping[str, Span]
    choices: Mapping[str, tuple[float, ...]]
    bounds: tuple[limit_table.Bound, ...]
    objective: Objective

    def _printed(self) -> printing.Table:
        rows: list[tuple[str, str | printing.Table]] = [
            ("belt", as_table(self.belt)),
            ("fence", as_table(self.fence)),
            ("materials", ", ".join(sheet.name for sheet in self.materials)),
            ("drive", as_table(self.drive)),
            ("motor", as_table(self.motor)),
            ("fence friction", repr(self.fence_friction)),
            ("border", repr(self.border)),
            ("parcels", as_table(self.parcels)),
        ]
        if self.period is not None:
            rows.append(("period", shown(self.period, "s")))
        for path, values in self.choices.items():
            rows.append((path, "one of " + ", ".join(self._text(path, v) for v in values)))
        for path, span in self.free.items():
            ends = (self._text(path, end) for end in span[:2])
            rows.append((path, "free, " + " ... ".join(ends)))
        sheet = self.materials[0]
        several = f" ({sheet.name})" if len(self.materials) > 1 else ""
        rows += [
            (f"limit {name}", f"{limit.sense} {shown(limit.bound, limit.quantity.unit)}{several}")
            for name, limit in limit_table.settled(self.bounds, self, sheet)
        ]
        rows.append(("objective", f"{self.objective.over} {self.objective.quantity.name}"))
        return printing.Table(f"Sorter: {self.title}" if self.title else "Sorter", tuple(rows))

    def _text(self, path: str, value: float) -> str:
        """A free or chosen number with its unit."""
        return shown(value, self.unit(path))

    def unit(self, path: str) -> str:
        """The unit [SI] of a number by its path."""
        name = scene_numbers.elements(self.parts, scene_path(path))[0]
        return scene_numbers.number(self.parts, name).unit

    @property
    def parts(self) -> MachineParts:
        """All parts with numbers, under their names in a scene."""
        first = {path: float(values[0]) for path, values in self.parcels.columns.items()}
        place = OnBelt(*(jnp.asarray(first[f"start.{name}"]) for name in parcel_table.PLACES))
        return MachineParts(
            self.belt, self.fence, self.drive, self.fence_friction, self.border, self._motor,
            self._parcel, place,
        )  # fmt: skip

    @property
    def _motor(self) -> Motor | None:
        return self.motor if self.motor.known else None

    @property
    def _parcel(self) -> Parcel:
        """The first parcel."""
        numbers: dict[str, Any] = {
            path.removeprefix("parcel.").replace("given_", ""): float(values[0])
            for path, values in self.parcels.columns.items()
            if path.startswith("parcel.")
        }
        return Parcel(**numbers)

    @property
    def duration(self) -> float:
        """The duration of a simulated sort [s]: the period, or the drive's cycle."""
        return float(self.drive.cycle) if self.period is None else self.period

    @property
    def signature(self) -> str:
        """The identity of a machine, as text: all of its numbers and choices, without the title. Of
        the parcels it has the corners and the names of the given numbers; the numbers themselves
        are a problem's data.

        Raises `ValueError` for a part or a limit whose identity cannot be determined.
        """
        fields = (field.name for field in dataclasses.fields(self))
        parts = {name: getattr(self, name) for name in fields if name not in ("title", "parcels")}
        parts["parcels"] = tuple(self.parcels.columns), self.parcels.corners
        return refused("sorter", lambda: text(parts))

    @property
    def drive_varies(self) -> bool:
        """Whether numbers of the drive are free or chosen."""
        return any(path.startswith("drive.") for path in (*self.free, *self.choices))

    def family(
        self,
        names: Sequence[str] = (),
        *,
        kind: str = "whole_sort",
        fixed: Mapping[str, float] | None = None,
        material: DataSheet | None = None,
        duration: float | None = None,
    ) -> SceneFamily:
        """Scenes of this machine in which some numbers vary by name: for problems, sweeps and
        studies. Numbers of the parcel and its place that are neither in `names` nor in `fixed` are
        those of the first parcel."""
        fence = self.fence
        if material is not None:
            fence = eqx.tree_at(lambda f: f.material, fence, material.material)
        whole = kind == "whole_sort"
        first = {path: float(values[0]) for path, values in self.parcels.columns.items()}
        given = {*names, *(fixed or {})}
        moved = any(name.startswith("motor.") for name in given)
        places = {
            f"start.{name}": first[f"start.{name}"]
            for name in parcel_table.PLACES
            if whole and not given & {name, f"start.{name}"}
        }
        return SceneFamily(
            kind,
            names,
            fixed={**places, **(fixed or {})},
            fence=fence,
            drive=self.drive,
            parcel=self._parcel,
            belt=self.belt,
            fence_friction=self.fence_friction,
            border=self.border,
            # Bounds alone cost nothing.
            motor=self._motor if self.motor.differs_from_hinge or moved else None,
            duration=self.duration if whole and duration is None else duration,
            options={"fence_corners": self.parcels.corners} if whole else {},
        )

    def scene(self, lane: int = 0, material: DataSheet | None = None) -> Scene:
        """The sort of one parcel, with free numbers at their start values.

        Raises `ValueError` where there is no such parcel or no such scene.
        """
        if not 0 <= lane < self.parcels.count:
            raise ValueError(
                f"Argument `lane` must be within 0 ... {self.parcels.count - 1}, but is {lane}."
            )
        names = tuple(self.parcels.columns)
        values = [column[lane] for column in self.parcels.columns.values()]
        try:
            return self.family(names, material=material).scene(jnp.asarray(values))
        except ValueError as error:
            raise ValueError(f"parcel {self.parcels.text(lane)}: {error}") from error

    def scenes(self, material: DataSheet | None = None) -> Scene:
        """The sorts of all parcels as one batch, each leaf with the lanes first."""
        names = tuple(self.parcels.columns)
        family = self.family(names, material=material)
        self.scene(0, material)
        rows = jnp.asarray(np.stack(list(self.parcels.columns.values()), axis=1))
        return jax.vmap(family.scene)(rows)

    def doubts(self) -> tuple[str, ...]:
        """Implausible numbers: a line each, with what was probably meant."""
        parts = self.parts
        names = scene_numbers.names(parts)
        found = [
            (name, float(value), scene_numbers.number(parts, name).unit)
            for name, value in zip(names, scene_numbers.read(parts, names), strict=True)
            # Free numbers are checked by their bounds, choices one by one, parcels by their range.
            if name not in map(scene_path, (*self.free, *self.choices))
            and not name.startswith(("parcel.", "start."))
        ]
        for sheet in self.materials:
            for key, bounds in {**sheet.material.bounds, **sheet.bounds}.items():
                value = getattr(sheet.material, key, getattr(sheet, key, None))
                if value is not None:
                    found.append((f"fence.material.{key}", float(value), bounds.unit))
        for path, column in self.parcels.columns.items():
            unit = parcel_table.FIELDS[path.rpartition(".")[2].replace("given_", "")].unit
            found += [
                (self.parcels.origin(path, int(lane)), float(column[lane]), unit)
                for lane in (np.argmin(column), np.argmax(column))
            ]
        for path, values in (*self.choices.items(), *((p, s[:2]) for p, s in self.free.items())):
            found += [(path, float(value), self.unit(path)) for value in values]
        if self.period is not None:
            found.append(("period", self.period, "s"))
        found += [
            (f"limits.{row.name}", bound, row.given_unit)
            for row, bound in self.bounds
            if bound is not None
        ]
        return plausibility.doubts(found)


def scene_path(path: str) -> str:
    """The path or name in a scene of a number of a sorter file."""
    derived = {"fence.reach": "reach", "fence.length_ratio": "length_ratio"}
    first, _, name = path.partition(".")
    if first == "parcels":
        return parcel_table.PATHS.get(name, path)
    return derived.get(path, path)


def read(tables: Table, folder: Path) -> Machine:
    """The machine described by some tables; the files that they name are in `folder`.

    Raises `ValueError` and `TypeError` where they cannot be read, naming the field.
    """
    refuse_unknown("a sorter", tables, SECTIONS)
    found = Reading()
    fence, sheets = reading.fence(tables.get("fence", {}), found)
    drive = reading.drive(tables.get("drive", {}), found)
    belt = reading.belt(tables.get("belt", {}), found)
    border = reading.border(tables.get("border", {}), found)
    friction = reading.friction("fence_friction", tables.get("fence_friction", on_cover()), found)
    motor = _motor(tables.get("motor", {}), found)
    for name, example in (("parcels", 'mass = "2 kg"'), ("limits", 'stress = "30 MPa"')):
        if not isinstance(tables.get(name, {}), Mapping):
            raise TypeError(
                f"Argument `{name}` must be a table, but is {tables[name]!r}. Write [{name}], once "
                f"and in single brackets, with {example} below it."
            )
    parcels = parcel_table.read(tables.get("parcels", {}), folder, found)
    _refuse_beside(belt, parcels, found)
    period = tables.get("period")
    if period is not None:
        period = amount("period", period, "s")
        _check.scalar("period", period, above=0, unit="s")
    moved = [path for path in (*found.spans, *found.choices) if path.startswith("drive.")]
    if moved and period is None:
        raise ValueError(
            f"Argument `period` [s] must be given where {', '.join(moved)} of the drive are free: "
            'how long a sort is followed. Write, for example, period = "1.5 s".'
        )
    return Machine(
        str(tables.get("title", "")),
        belt,
        fence,
        drive,
        motor,
        friction,
        border,
        sheets,
        parcels,
        period,
        found.spans,
        found.choices,
        limit_table.read(tables.get("limits", {}), parcels.given),
        objective.read(tables.get("objective", {})),
    )


def _refuse_beside(belt: Belt, parcels: Parcels, found: Reading) -> None:
    """Refuse a parcel that starts beside the belt, however wide the belt may get."""
    choices = found.choices.get("belt.width", (float(belt.width),))
    width = found.spans["belt.width"].upper if "belt.width" in found.spans else max(choices)
    offsets = parcels.columns["start.offset"]
    lane = int(np.argmax(offsets))
    span = found.spans.get("parcels.offset")
    offset = float(offsets[lane]) if span is None else span.upper
    if offset >= width:
        raise ValueError(
            f"Argument `{parcels.origin('start.offset', lane)}` must be below the belt's width, "
            f"{shown(width, 'm')}, but is {shown(offset, 'm')}: the parcel would start beside "
            "the belt. It is the distance of the parcel's nearest corner from the border."
        )


def _motor(raw: Any, found: Reading) -> Motor:
    if isinstance(raw, Motor):
        return raw
    if not isinstance(raw, Mapping):
        _check.part("motor", raw, Motor, "motor=fj.Motor(torque=400.0)")
    refuse_unknown("motor", raw, (*Motor.bounds, "at_shaft"))
    numbers = {
        name: found.number(f"motor.{name}", value, Motor.bounds[name])
        for name, value in raw.items()
        if name != "at_shaft"
    }
    for name in ("torque", "rated_torque"):
        if f"motor.{name}" in found.spans:
            raise ValueError(
                f"Argument `motor.{name}` must be one number or a list, but is free: it is the "
                "bound of a limit, and `What decides` shows the gain from a larger one. Free "
                "motor.gear_ratio, with at_shaft = true."
            )
    return Motor(**numbers, at_shaft=raw.get("at_shaft", False))
