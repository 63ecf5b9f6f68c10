"""The table of a sorter's limits: a row each, by the name that a sorter file has for it.

To limit something more, add a row: the quantity, which side is bounded, and which bound holds where
the file says nothing. A quantity may depend on the motor, or on numbers that the file gives with
the limit. A row's quantity is exact in value and gradient; it is read in every sort,
or once where it depends on the design alone (`Quantity.fields` empty). Any other quantity of
`fencejax.OBJECTIVES` can be limited by its own name, without a row.
"""

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple, Protocol

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
from ..parts import DataSheet, Motor
from .amounts import amount, nearest, refuse_unknown

_SENSES = {"at_most": "at most", "at_least": "at least"}


class Bounding(Protocol):
    """What a usual bound may be read from."""

    @property
    def motor(self) -> Motor:
        """The motor."""
        ...

    @property
    def period(self) -> float | None:
        """From one parcel to the next [s]."""
        ...

    @property
    def drive_varies(self) -> bool:
        """Whether the drive is designed."""
        ...


@dataclasses.dataclass(frozen=True)
class LimitRow:
    """A limit that a sorter may have.

    **Fields:**

    - `name`: its key in the table of limits.
    - `quantity`: what is limited.
    - `sense`: `"at most"` or `"at least"`.
    - `usual`: the bound where the sorter gives none, from the sorter and the fence's material;
      `None` for no limit then.
    - `scale` [the quantity's unit]: what the margin is measured in; by default the bound's
      magnitude.
    - `of`: the quantity for a sorter and the settings, in place of `quantity`, whose unit it has.
    - `settings`: numbers that the file gives with the limit, by name; without them there is none.
      `chosen` are those given [SI].
    - `asked`: whether it holds only where the file names it, be it by `true` for the usual bound.
    - `unit`: of what a file gives, where that is no bound on the quantity yet; `bound_of` makes it
      one for a sorter and a material, or `None` where the material lacks a number for it.
    """

    name: str
    quantity: Quantity
    sense: str = "at most"
    usual: Callable[[Bounding, DataSheet], Any] | None = None
    scale: float | None = None
    of: Callable[[Bounding, Mapping[str, float]], Quantity] | None = None
    settings: Mapping[str, Bounds] = dataclasses.field(default_factory=dict)
    chosen: Mapping[str, float] = dataclasses.field(default_factory=dict)
    asked: bool = False
    unit: str | None = None
    bound_of: Callable[[float, Bounding, DataSheet], Any] | None = None

    def __post_init__(self):
        _check.choice("sense", self.sense, tuple(_SENSES.values()))

    @property
    def given_unit(self) -> str:
        """The unit of what a file gives."""
        return self.quantity.unit if self.unit is None else self.unit


def _of_material(sorter: Bounding, sheet: DataSheet):
    return sheet.allowed_stress


def _of_motor(sorter: Bounding, sheet: DataSheet):
    return sorter.motor.torque


def _of_lasting_use(sorter: Bounding, sheet: DataSheet):
    return sorter.motor.rated_torque


def _of_line(sorter: Bounding, sheet: DataSheet):
    return None if sorter.motor.no_load_speed is None else 1.0


def _behind(quantity: Callable[[Motor], Quantity]):
    """A quantity of a sorter's motor."""
    return lambda sorter, chosen: quantity(sorter.motor)


def _of_period(sorter: Bounding, sheet: DataSheet):
    # Of a drive that is as it is, it is asked once, where the problem is made.
    return sorter.period if sorter.drive_varies else None


_LIFE = fatigue.ENDURANCE


def _for_life(sorts: float, sorter: Bounding, sheet: DataSheet):
    strength = sheet.fatigue_strength
    return None if strength is None else fatigue.amplitude_for(sorts, strength)


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

_ROWS = (
    # The parcel's centre passes the belt's far edge; margins in belt widths, as `fj.LIMITS` has it.
    LimitRow("sorted", objectives.CROSSING, "at least", lambda *_: 0.0, 0.7),
    LimitRow("tip_deflection", objectives.TIP_DEFLECTION),
    LimitRow("stress", objectives.PEAK_STRESS, usual=_of_material),
    # Given in sorts: the material's fatigue strength, for so many.
    LimitRow(
        "life", fatigue.FATIGUE_STRESS, unit="1", bound_of=_for_life,
        usual=lambda sorter, sheet: _for_life(_LIFE, sorter, sheet),
    ),
    LimitRow(
        "torque", objectives.PEAK_TORQUE, usual=_of_motor, of=_behind(drivability.motor_torque)
    ),
    LimitRow(
        "rms_torque", drivability.rms_torque(), usual=_of_lasting_use,
        of=_behind(drivability.rms_torque),
    ),
    LimitRow(
        "speed_torque", drivability.SPEED_TORQUE, usual=_of_line,
        of=_behind(drivability.speed_torque),
    ),
    LimitRow("power", drivability.peak_power(), of=_behind(drivability.peak_power)),
    # Over a cycle: nothing recovered, or all of it.
    LimitRow("energy", drivability.drive_work(), of=_behind(drivability.drive_work)),
    LimitRow("net_energy", drivability.net_work(), of=_behind(drivability.net_work)),
    LimitRow("ring", RING_AMPLITUDE),
    # As an acceleration in g, a velocity change, and the boundary where both do damage.
    LimitRow("peak_load", shock.PEAK_LOAD),
    LimitRow("velocity_change", shock.VELOCITY_CHANGE),
    LimitRow(
        "damage", shock.damage_boundary(1.0, 1.0), usual=lambda *_: 1.0,
        settings={
            "critical_load": Bounds(above=0, size=50.0),
            "critical_velocity_change": Bounds("m/s", above=0, size=1.0),
        },
        of=lambda sorter, chosen: shock.damage_boundary(**chosen),
    ),
    LimitRow(
        "tipping", sorting.tipping(1.0, 0.0), usual=lambda *_: 1.0,
        settings={
            "center_height": Bounds("m", least=0, size=0.2),
            "contact_height": Bounds("m", least=0, size=0.2),
        },
        of=lambda sorter, chosen: sorting.tipping(**chosen),
    ),
    # A tenth: what the fence's end does is a graze, and no part of the sort.
    LimitRow("tip_share", sorting.TIP_SHARE, usual=lambda *_: 0.1, asked=True),
    LimitRow("crossing_time", sorting.CROSSING_TIME),
    # The drive is home again before the next parcel comes.
    LimitRow("cycle", objectives.CYCLE_TIME, usual=_of_period),
    # The returning fence is out of the next parcel's way.
    LimitRow(
        "clear_period", sorting.CLEAR_PERIOD, usual=lambda sorter, sheet: sorter.period, asked=True
    ),
    # The range of the model, as `Status.LARGE_DEFLECTION` and `Status.DEEP_PENETRATION` have it.
    LimitRow("deflection_share", DEFLECTION_SHARE, usual=lambda *_: 0.25),
    LimitRow("indentation_share", INDENTATION_SHARE, usual=lambda *_: 0.5),
)  # fmt: skip
LIMIT_ROWS: Mapping[str, LimitRow] = {row.name: row for row in _ROWS}
"""Every row by name."""

Bound = tuple[LimitRow, float | None]
"""A row, and the bound [SI] that a sorter gives for it; `None` for the row's usual one."""


class _Motored(NamedTuple):
    """A sorter of which the motor alone counts."""

    motor: Motor
    period: float | None = None
    drive_varies: bool = False


def quantities(motor: Motor) -> dict[str, Quantity]:
    """Every quantity by name that needs no settings, behind a motor where it is one of it."""
    found = dict(OBJECTIVES)
    for row in _ROWS:
        lineless = row.quantity is drivability.SPEED_TORQUE and motor.no_load_speed is None
        if row.quantity.name not in found and not row.settings and not lineless:
            made = row.quantity if row.of is None else row.of(_Motored(motor), {})
            found[row.quantity.name] = made
    return found


def known_names() -> tuple[str, ...]:
    """Every name that a limit can have."""
    return tuple(dict.fromkeys((*LIMIT_ROWS, *OBJECTIVES)))


def read(table: Mapping[str, Any]) -> tuple[Bound, ...]:
    """The limits that a table gives, with those that hold in any case.

    A value is a bound, with or without a unit, on the side that the row bounds; `{at_most = ...}`
    or `{at_least = ...}` says the side, with a row's settings beside; `True` is a row's usual
    bound, and `False` switches a limit off.

    Raises `ValueError` for names and bounds that cannot be.
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
        rows[name], raw = _with_settings(dataclasses.replace(rows[name], asked=False), raw)
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
        if row.unit is not None:
            _check.scalar(f"limits.{name}", bound, above=0, unit=row.unit)
        if bound == 0 and row.scale is None:
            raise ValueError(
                f"Argument `limits.{name}` must not be 0 [{row.quantity.unit}]: its margin would "
                "have no measure. Give a small number, or a `fencejax.Limit` with a `scale`."
            )
    return tuple((row, given.get(name)) for name, row in rows.items())


def _with_settings(row: LimitRow, raw: Any) -> tuple[LimitRow, Any]:
    """The row with the settings that a table gives, and what else that gives: `None` for
    nothing."""
    if not row.settings:
        return row, raw
    names = ", ".join(f"{name} = ..." for name in row.settings)
    if not isinstance(raw, Mapping) or not set(row.settings) <= set(raw):
        raise ValueError(
            f"Argument `limits.{row.name}` must be a table with {', '.join(row.settings)}, but is "
            f"{raw!r}. Write {row.name} = {{{names}}}."
        )
    refuse_unknown(f"limits.{row.name}", raw, (*row.settings, *_SENSES))
    chosen = {}
    for name, bounds in row.settings.items():
        path = f"limits.{row.name}.{name}"
        chosen[name] = amount(path, raw[name], bounds.unit)
        _check.scalar(path, chosen[name], **bounds._asdict())
    rest = {side: value for side, value in raw.items() if side in _SENSES}
    return dataclasses.replace(row, chosen=chosen), rest or None


def settled(
    bounds: Iterable[Bound], sorter: Bounding, sheet: DataSheet
) -> tuple[tuple[str, Limit], ...]:
    """The limits by name with their bounds for a material; what has no bound is left out.

    Raises `ValueError` where a bound is given that the material lacks a number for.
    """
    found = []
    for row, given in bounds:
        if row.asked or set(row.chosen) != set(row.settings):
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
            # What is given in another unit is told by what it bounds.
            name = row.name if row.bound_of is None else quantity.name
            found.append((name, Limit(quantity, float(bound), row.sense, row.scale)))
    return tuple(found)
