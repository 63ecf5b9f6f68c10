"""The table of a sorter's limits: a row each, by its name in a sorter file.

To add a limit, add a row: the quantity, the bounded side, and the default bound. A quantity may
depend on numbers that the file gives with the limit, or that each parcel has itself. Its value and
gradient are exact; it is computed in every sort, or once where it depends on the design alone
(`Quantity.fields` empty). Any other quantity of `fencejax.OBJECTIVES` can be limited by its own
name, without a row.
"""

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol

import jax.numpy as jnp

from .. import _check
from .._check import Bounds
from ..design import (
    OBJECTIVES,
    RING_AMPLITUDE,
    Limit,
    Quantity,
    drivability,
    fatigue,
    objectives,
    shock,
    sorting,
)
from ..parts import AbstractDrive, AbstractTorqueDrive, Belt, DataSheet, HeldDrive, Motor, Parcel
from ..results import DEEPEST, LARGEST_BEND
from .amounts import amount, nearest, refuse_unknown

# Quantities that can be negative, by name, and so can their bounds.
_SIGNED = frozenset((
    "crossing", "furthest_y", "leave_x", "leave_y", "net_work", "ring_energy", "tip_clearance",
))  # fmt: skip
_SENSES = {"at_most": "at most", "at_least": "at least"}


class Bounding(Protocol):
    """The numbers of a sorter on which usual bounds and units of margins depend."""

    @property
    def belt(self) -> Belt:
        """The belt."""
        ...

    @property
    def motor(self) -> Motor:
        """The motor."""
        ...

    @property
    def drive(self) -> AbstractDrive:
        """The drive's law."""
        ...

    @property
    def period(self) -> float | None:
        """The time from one parcel to the next [s]."""
        ...

    @property
    def drive_varies(self) -> bool:
        """Whether numbers of the drive are free or chosen."""
        ...


@dataclasses.dataclass(frozen=True)
class LimitRow:
    """A limit that a sorter may have.

    **Fields:**

    - `name`: its key in the table of limits.
    - `quantity`: the limited quantity.
    - `sense`: `"at most"` or `"at least"`.
    - `usual`: the default bound, from the sorter and the fence's material; without it, or where it
      gives `None`, there is no limit by default.
    - `scale` [the quantity's unit]: the unit of the margin; by default the bound's magnitude.
      `scale_of` reads it from a sorter instead.
    - `of`: the quantity for a sorter and the settings, instead of `quantity`, whose unit it has.
    - `settings`: numbers that the file gives with the limit, by name; `chosen` are those given
      [SI]. `own`: those that the parcels may have themselves, with their names there.
    - `asked`: whether it holds only where the file names it, for example by `true` for the usual
      bound.
    - `over`: `"worst"` for a limit on every parcel, or `"mean"` for a limit on the mean over the
      parcels, weighted by their frequencies.
    - `unit`: of the number in the file, where that is not yet a bound on the quantity; `bound_of`
      computes the bound for a sorter and a material, or `None` where the material lacks a number.
    """

    name: str
    quantity: Quantity
    sense: str = "at most"
    usual: Callable[[Bounding, DataSheet], Any] | None = None
    scale: float | None = None
    of: Callable[[Bounding, Mapping[str, float]], Quantity] | None = None
    settings: Mapping[str, Bounds] = dataclasses.field(default_factory=dict)
    chosen: Mapping[str, float] = dataclasses.field(default_factory=dict)
    own: Mapping[str, str] = dataclasses.field(default_factory=dict)
    asked: bool = False
    over: str = "worst"
    unit: str | None = None
    bound_of: Callable[[float, Bounding, DataSheet], Any] | None = None
    scale_of: Callable[[Bounding], Any] | None = None

    def __post_init__(self):
        _check.choice("sense", self.sense, tuple(_SENSES.values()))

    @property
    def given_unit(self) -> str:
        """The unit of the number in a file."""
        return self.quantity.unit if self.unit is None else self.unit


def _of_material(sorter: Bounding, sheet: DataSheet):
    return sheet.allowed_stress


def _of_motor(sorter: Bounding, sheet: DataSheet):
    return sorter.motor.torque


def _of_lasting_use(sorter: Bounding, sheet: DataSheet):
    return sorter.motor.rated_torque


def _of_line(sorter: Bounding, sheet: DataSheet):
    return None if sorter.motor.no_load_speed is None else 1.0


def _torque(sorter: Bounding, chosen: Mapping[str, float]) -> Quantity:
    """The motor's torque; without inertia, losses or a shaft of its own the torque at the hinge,
    which needs no further measure."""
    return drivability.MOTOR_TORQUE if sorter.motor.differs_from_hinge else objectives.PEAK_TORQUE


def _clear(sorter: Bounding, chosen: Mapping[str, float]) -> Quantity:
    driven = isinstance(sorter.drive, AbstractTorqueDrive)
    return sorting.CLEAR_PERIOD_OF_TORQUE if driven else sorting.CLEAR_PERIOD


def _line(sorter: Bounding, chosen: Mapping[str, float]) -> Quantity:
    if sorter.motor.line is None:
        raise ValueError(
            "Argument `limits.speed_torque` must be left out for a motor without a line of torque "
            "over speed. Or give motor.no_load_speed, with a torque."
        )
    return drivability.SPEED_TORQUE


def _of_period(sorter: Bounding, sheet: DataSheet):
    # For a drive without free numbers `SorterProblem` checks it once; a held fence is never away.
    leaves = sorter.drive_varies and not isinstance(sorter.drive, HeldDrive)
    return sorter.period if leaves else None


_LIFE = fatigue.ENDURANCE


def _for_life(sorts: float, sorter: Bounding, sheet: DataSheet):
    strength = sheet.fatigue_strength
    exponent = fatigue.exponent_of(sheet.material)
    return None if strength is None else fatigue.amplitude_for(sorts, strength, exponent)


DEFLECTION_SHARE = Quantity(
    "deflection_share", "1", "largest tip deflection over the flexible link's length",
    lambda result, scene: result.tip_deflection / scene.fence.flexible_length,
    needs=("fence",),
    fields=("tip_deflection",),
)  # fmt: skip
INDENTATION_SHARE = Quantity(
    "indentation_share", "1", "how far a corner is pressed in, over the parcel's shorter side",
    lambda result, scene: result.deepest / jnp.minimum(scene.parcel.length, scene.parcel.breadth),
    fields=("deepest",),
)  # fmt: skip

_FRAGILITY = {
    name: Parcel.bounds[name] for name in ("critical_load", "critical_velocity_change")
}

_ROWS = (
    # The parcel's centre passes the belt's far edge. The margin is relative to the belt's width,
    # which is 0.7 m of the paper's, as in `fj.LIMITS`.
    LimitRow(
        "sorted", objectives.CROSSING, "at least", lambda *_: 0.0,
        scale_of=lambda sorter: sorter.belt.width,
    ),
    LimitRow("tip_deflection", objectives.TIP_DEFLECTION),
    LimitRow("stress", objectives.PEAK_STRESS, usual=_of_material),
    # Given in sorts: the material's fatigue strength, for so many.
    LimitRow(
        "life", fatigue.FATIGUE_STRESS, unit="1", bound_of=_for_life,
        usual=lambda sorter, sheet: _for_life(_LIFE, sorter, sheet),
    ),
    LimitRow("torque", objectives.PEAK_TORQUE, usual=_of_motor, of=_torque),
    LimitRow("rms_torque", drivability.RMS_TORQUE, usual=_of_lasting_use),
    LimitRow("speed_torque", drivability.SPEED_TORQUE, usual=_of_line, of=_line),
    LimitRow("power", drivability.PEAK_POWER),
    # Over a cycle: nothing recovered, or all of it.
    LimitRow("energy", drivability.DRIVE_WORK),
    LimitRow("net_energy", drivability.NET_WORK),
    LimitRow("ring", RING_AMPLITUDE),
    # As an acceleration in g, a velocity change, and the boundary where both do damage.
    LimitRow("peak_load", shock.PEAK_LOAD),
    LimitRow("velocity_change", shock.VELOCITY_CHANGE),
    LimitRow(
        "damage", shock.damage_boundary(), usual=lambda *_: 1.0, settings=_FRAGILITY,
        own={name: name for name in _FRAGILITY}, asked=True,
        of=lambda sorter, chosen: shock.damage_boundary(**chosen),
    ),
    # For a population of parcels with scattered critical values.
    LimitRow(
        "share_damaged", shock.damage_chance(1.0), usual=lambda *_: 0.01,
        settings={"spread": Bounds(above=0, size=0.2), **_FRAGILITY},
        own={name: name for name in _FRAGILITY}, asked=True, over="mean",
        of=lambda sorter, chosen: shock.damage_chance(**chosen),
    ),
    LimitRow(
        "tipping", sorting.tipping(None, 0.0), usual=lambda *_: 1.0,
        settings={
            "center_height": Bounds("m", least=0, size=0.2),
            "contact_height": Bounds("m", least=0, size=0.2),
        },
        own={"center_height": "height"}, asked=True,
        of=lambda sorter, chosen: sorting.tipping(**{"center_height": None, **chosen}),
    ),
    # A tenth: the fence's end may graze the parcel, but not take part in the sort.
    LimitRow("tip_share", sorting.TIP_SHARE, usual=lambda *_: 0.1, asked=True),
    LimitRow("crossing_time", sorting.CROSSING_TIME),
    # The drive is home again before the next parcel comes.
    LimitRow("cycle", objectives.CYCLE_TIME, usual=_of_period),
    # The next parcel does not touch the returning fence.
    LimitRow(
        "clear_period", sorting.CLEAR_PERIOD, usual=lambda sorter, sheet: sorter.period,
        asked=True, of=_clear,
    ),
    # The range of the model, as in `Status.LARGE_DEFLECTION` and `Status.DEEP_PENETRATION`.
    LimitRow("deflection_share", DEFLECTION_SHARE, usual=lambda *_: LARGEST_BEND),
    LimitRow("indentation_share", INDENTATION_SHARE, usual=lambda *_: DEEPEST),
)  # fmt: skip
LIMIT_ROWS: Mapping[str, LimitRow] = {row.name: row for row in _ROWS}
"""Every row by name."""

Bound = tuple[LimitRow, float | None]
"""A row, and the bound [SI] that a sorter gives for it; `None` for the row's usual one."""


def quantities() -> dict[str, Quantity]:
    """Every quantity without settings, by name."""
    rows = {row.quantity.name: row.quantity for row in _ROWS if not row.settings}
    behind = drivability.MOTOR_TORQUE
    return {**rows, behind.name: behind, **OBJECTIVES}


def known_names() -> tuple[str, ...]:
    """Every name that a limit can have."""
    return tuple(dict.fromkeys((*LIMIT_ROWS, *OBJECTIVES)))


def read(table: Mapping[str, Any], own: Iterable[str] = ()) -> tuple[Bound, ...]:
    """The limits that a table gives, with the default ones; `own`: names of the numbers that every
    parcel has itself.

    A value is a bound, with or without a unit, on the side that the row bounds; `{at_most = ...}`
    or `{at_least = ...}` gives the side, together with a row's settings; `True` stands for a row's
    usual bound, and `False` switches a limit off.

    Raises `ValueError` for unknown names and impossible bounds.
    """
    rows = dict(LIMIT_ROWS)
    given: dict[str, float | None] = {}
    for name, raw in table.items():
        if isinstance(raw, Limit):
            rows[name] = LimitRow(name, raw.quantity, raw.sense, scale=raw.scale)
            given[name] = raw.bound
            continue
        if name not in rows:
            if name not in OBJECTIVES:
                raise ValueError(
                    f"`limits` holds the unknown key `{name}`.{nearest(name, known_names())} It "
                    f"may hold {', '.join(known_names())}."
                )
            rows[name] = LimitRow(name, OBJECTIVES[name])
        if raw is False:
            del rows[name]
            continue
        named = dataclasses.replace(rows[name], asked=False)
        rows[name], raw = _with_settings(named, raw, frozenset(own))
        if raw is True:
            if rows[name].usual is None:
                raise ValueError(
                    f"Argument `limits.{name}` must be a number, but is true, and it has no usual "
                    "bound."
                )
            continue
        if isinstance(raw, Mapping):
            ((side, value),) = raw.items() if len(raw) == 1 else ((None, None),)
            if side not in _SENSES:
                raise ValueError(
                    f"Argument `limits.{name}` must hold `at_most` or `at_least` alone, but holds "
                    f"{', '.join(map(str, raw))}."
                )
            rows[name], raw = dataclasses.replace(rows[name], sense=_SENSES[side]), value
        if raw is None:
            continue
        row = rows[name]
        bound = given[name] = amount(f"limits.{name}", raw, row.given_unit)
        if row.unit is not None or (bound < 0 and row.quantity.name not in _SIGNED):
            _check.scalar(f"limits.{name}", bound, above=0, unit=row.given_unit)
        if bound == 0 and row.scale is None and row.scale_of is None:
            raise ValueError(
                f"Argument `limits.{name}` must not be 0 [{row.quantity.unit}]: its margin would "
                "have no measure. Give a small number, or a `fencejax.Limit` with a `scale`."
            )
    return tuple((row, given.get(name)) for name, row in rows.items())


def _with_settings(row: LimitRow, raw: Any, own: frozenset[str]) -> tuple[LimitRow, Any]:
    """The row with the settings of a table, except those that the parcels have themselves, and the
    rest of the table: `None` where nothing is left."""
    if not row.settings:
        return row, raw
    asked = [name for name in row.settings if row.own.get(name) not in own]
    given = raw if isinstance(raw, Mapping) else {}
    if not set(asked) <= set(given):
        names = ", ".join(f"{name} = ..." for name in asked)
        parcels = [row.own[name] for name in asked if name in row.own]
        instead = f", or give {' and '.join(parcels)} with the parcels" if parcels else ""
        raise ValueError(
            f"Argument `limits.{row.name}` must be a table with {', '.join(asked)}, but is "
            f"{raw!r}. Write {row.name} = {{{names}}}{instead}."
        )
    if not isinstance(raw, Mapping):
        return row, raw
    refuse_unknown(f"limits.{row.name}", given, (*row.settings, *_SENSES))
    chosen = {}
    for name, bounds in row.settings.items():
        if name in given:
            path = f"limits.{row.name}.{name}"
            chosen[name] = amount(path, given[name], bounds.unit)
            _check.scalar(path, chosen[name], **bounds._asdict())
    rest = {side: value for side, value in given.items() if side in _SENSES}
    return dataclasses.replace(row, chosen=chosen), rest or None


def means(bounds: Iterable[Bound]) -> frozenset[str]:
    """The names of the limits that bound a mean over the parcels."""
    return frozenset(row.name for row, _ in bounds if row.over == "mean")


def settled(
    bounds: Iterable[Bound], sorter: Bounding, sheet: DataSheet
) -> tuple[tuple[str, Limit], ...]:
    """The limits by name with their bounds for a material; those without a bound are left out.

    Raises `ValueError` for a bound that needs a number which the material lacks.
    """
    found = []
    for row, given in bounds:
        if row.asked:
            continue
        bound = given
        if given is None:
            bound = None if row.usual is None else row.usual(sorter, sheet)
        elif row.bound_of is not None:
            bound = row.bound_of(given, sorter, sheet)
            if bound is None:
                raise ValueError(
                    f"Argument `limits.{row.name}` must be left out for {sheet.name}, which has no "
                    "`fatigue_strength`. Give it in `fence.material`."
                )
        if bound is not None:
            quantity = row.quantity if row.of is None else row.of(sorter, row.chosen)
            # A limit given in another unit has the name of the quantity that it bounds.
            name = row.name if row.bound_of is None else quantity.name
            scale = row.scale if row.scale_of is None else float(row.scale_of(sorter))
            found.append((name, Limit(quantity, float(bound), row.sense, scale)))
    return tuple(found)


# The limits by numbers of the material, with these and the limits' keys.
_BY_MATERIAL = {
    "stress": ("allowed_stress", "stress"),
    fatigue.FATIGUE_STRESS.name: ("fatigue_strength", "life"),
}


def refuse_unlike(*found: tuple[str, list[str]]) -> None:
    """Raise `ValueError` where a limit holds for one of two materials alone, each with its name and
    its limits' names."""
    for (name, names), (other, others) in (found, found[::-1]):
        for limit in (each for each in others if each not in names):
            number, key = _BY_MATERIAL.get(limit, (limit, limit))
            raise ValueError(
                f"Argument `fence.material` must give `{number}` for {name}, as for {other}. "
                f"Or write limits.{key} = false, which leaves the limit out for all."
            )
