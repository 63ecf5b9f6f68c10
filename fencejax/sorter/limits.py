"""The table of a sorter's limits: a row each, by the name that a sorter file has for it.

To limit something more, add a row: the quantity, which side is bounded, and which bound holds where
the file says nothing. A row's quantity is exact in value and gradient; it is read in every sort,
or once where it depends on the design alone (`Quantity.fields` empty). Any other quantity of
`fencejax.OBJECTIVES` can be limited by its own name, without a row.
"""

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol

import jax.numpy as jnp

from .. import _check
from ..design import OBJECTIVES, RING_AMPLITUDE, Limit, Quantity, objectives
from ..parts import DataSheet, Motor
from .amounts import amount, nearest

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
    """

    name: str
    quantity: Quantity
    sense: str = "at most"
    usual: Callable[[Bounding, DataSheet], Any] | None = None
    scale: float | None = None

    def __post_init__(self):
        _check.choice("sense", self.sense, tuple(_SENSES.values()))


def _of_material(sorter: Bounding, sheet: DataSheet):
    return sheet.allowed_stress


def _of_motor(sorter: Bounding, sheet: DataSheet):
    return sorter.motor.torque


def _of_period(sorter: Bounding, sheet: DataSheet):
    # Of a drive that is as it is, it is asked once, where the problem is made.
    return sorter.period if sorter.drive_varies else None


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
    LimitRow("torque", objectives.PEAK_TORQUE, usual=_of_motor),
    LimitRow("ring", RING_AMPLITUDE),
    # The drive is home again before the next parcel comes.
    LimitRow("cycle", objectives.CYCLE_TIME, usual=_of_period),
    # The range of the model, as `Status.LARGE_DEFLECTION` and `Status.DEEP_PENETRATION` have it.
    LimitRow("deflection_share", DEFLECTION_SHARE, usual=lambda *_: 0.25),
    LimitRow("indentation_share", INDENTATION_SHARE, usual=lambda *_: 0.5),
)
LIMIT_ROWS: Mapping[str, LimitRow] = {row.name: row for row in _ROWS}
"""Every row by name."""

Bound = tuple[LimitRow, float | None]
"""A row, and the bound [SI] that a sorter gives for it; `None` for the row's usual one."""


def known_names() -> tuple[str, ...]:
    """Every name that a limit can have."""
    return tuple(dict.fromkeys((*LIMIT_ROWS, *OBJECTIVES)))


def read(table: Mapping[str, Any]) -> tuple[Bound, ...]:
    """The limits that a table gives, with those that hold in any case.

    A value is a bound, with or without a unit, on the side that the row bounds; `{at_most = ...}`
    or `{at_least = ...}` says the side; `False` switches a limit off.

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
        if isinstance(raw, Mapping):
            ((side, raw),) = raw.items() if len(raw) == 1 else ((None, None),)
            if side not in _SENSES:
                raise ValueError(
                    f"Argument `limits.{name}` must hold `at_most` or `at_least` alone, but holds "
                    f"{', '.join(map(str, table[name]))}."
                )
            rows[name] = dataclasses.replace(rows[name], sense=_SENSES[side])
        row = rows[name]
        given[name] = amount(f"limits.{name}", raw, row.quantity.unit)
        if given[name] == 0 and row.scale is None:
            raise ValueError(
                f"Argument `limits.{name}` must not be 0 [{row.quantity.unit}]: its margin would "
                "have no measure. Give a small number, or a `fencejax.Limit` with a `scale`."
            )
    return tuple((row, given.get(name)) for name, row in rows.items())


def settled(
    bounds: Iterable[Bound], sorter: Bounding, sheet: DataSheet
) -> tuple[tuple[str, Limit], ...]:
    """The limits by name with their bounds for a material; what has no bound is left out."""
    found = []
    for row, given in bounds:
        usual = None if row.usual is None else row.usual(sorter, sheet)
        bound = usual if given is None else given
        if bound is not None:
            found.append((row.name, Limit(row.quantity, float(bound), row.sense, row.scale)))
    return tuple(found)
