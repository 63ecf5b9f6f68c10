"""Designs near an optimum, from the derivatives at the end of its search: shadow prices of limits
and bounds, and effects of tolerances."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fencejax.design import (
    Bounded,
    DesignSpace,
    Evaluation,
    Limit,
    Optimum,
    Relaxation,
    conflict,
    relaxations,
    shadow_prices,
)
from fencejax.printing import shown

from .amounts import changed, plain
from .html_report import Part, Table

SHARE = 0.05
"""The share of itself by which each number of a design is changed."""
NOTHING = 1e-6
"""Below this share of the larger bound a number counts as 0 and has no relative tolerance."""
# No fence is made more exactly.
_LEAST_PERCENT = 0.01


class Rows(NamedTuple):
    """Consecutive margins of a search that belong to one limit: its name, its bound in `unit`, the
    unit of the margins, and the number of lanes."""

    name: str
    bound: float
    unit: str
    unit_of_margin: float
    at_most: bool
    lanes: int

    @classmethod
    def of(cls, limit: Limit, lanes: int) -> "Rows":
        """The margins of a limit, one a lane."""
        return cls(
            limit.name, limit.bound, limit.quantity.unit, limit.unit_of_margin,
            limit.sense == "at most", lanes,
        )  # fmt: skip


class Linear(NamedTuple):
    """The largest objective and the least margin after a step, the index of that margin, and the
    number of such steps until a margin is 0."""

    objective: float
    margin: float
    tightest: int
    room: float


def along(
    at: Evaluation, scale: float, objectives: np.ndarray, margins: np.ndarray, step: np.ndarray
) -> Linear:
    """The linear prediction of a step in the shares from the derivatives of an evaluation, starting
    at `objectives` and `margins`; `scale`: by which the search's objectives were divided."""
    objective = float(np.max(objectives + scale * at.objective_rows @ step))
    change = at.margin_rows @ step
    moved, shrinking = margins + change, change < 0
    steps = margins[shrinking] / -change[shrinking]
    room = max(0.0, float(np.min(steps, initial=math.inf)))
    tightest = int(np.argmin(moved)) if moved.size else 0
    return Linear(objective, float(np.min(moved, initial=math.inf)), tightest, room)


def room_text(room: float) -> str:
    """The tolerance of a number in percent, from the number of steps of `SHARE`."""
    percent = 100 * SHARE * room
    if percent > 100:
        return "> 100 %"
    return f"{percent:.2g} %" if percent >= _LEAST_PERCENT else f"< {_LEAST_PERCENT:g} %"


def tolerance_parts(
    space: DesignSpace, optimum: Optimum, rows: Sequence[Rows], unit: str, reserve: float
) -> list[Part | str]:
    """The effect of 5 % of each number of the design on objective and margins, by the exact
    gradient; `reserve`: the search's reserve in each margin. A design that breaks a limit has no
    room until one is used up."""
    if optimum.last.failed:
        return ["The design cannot be evaluated."]
    at, names = optimum.last, [row.name for row in rows for _ in range(row.lanes)]
    values = np.asarray(space.from_shares(optimum.point))
    margins = at.margins + reserve
    least = float(np.min(margins, initial=math.inf))
    holds = optimum.feasible or least >= 0
    table, zero = [], []
    for index, variable in enumerate(space.variables):
        if abs(values[index]) <= NOTHING * max(abs(variable.lower), abs(variable.upper)):
            zero.append(plain(variable.name))
            continue
        for share in (-SHARE, SHARE):
            step = np.zeros(optimum.point.size)
            step[index] = float(variable.share((1 + share) * values[index])) - optimum.point[index]
            found = along(at, optimum.scale, optimum.objectives, margins, step)
            table.append([
                plain(variable.name), shown(float(values[index]), variable.unit),
                f"{100 * share:+.0f} %", changed(found.objective, optimum.objective),
                f"{found.margin:+.3f}", plain(names[found.tightest]) if names else "",
                *([room_text(found.room)] if holds else []),
            ])  # fmt: skip
    titles = ["number", "value", "moved by", "objective", "least margin", "of the limit"]
    note = (
        "By the exact gradient at the optimum, along a straight line: nothing is simulated again. "
        f"The design as it is: {shown(optimum.objective, unit)}, least margin {least:+.3f}."
    )
    if holds:
        titles.append("may be off by so much")
        note += (
            " The last column: how far the number may be off that way until the first limit is "
            "used up."
        )
    parts: list[Part | str] = [Table(titles, table, "", note)]
    if zero:
        parts.append(f"Of {', '.join(zero)} no share can be taken: it is 0.")
    return parts


def _priced(space: DesignSpace, optimum: Optimum, rows: Sequence[Rows]) -> list[Relaxation]:
    """The gains from relaxing limits and bounds, the largest first."""
    prices = shadow_prices(optimum) if optimum.feasible else conflict(optimum.last)
    limits, start = [], 0
    for row in rows:
        own = range(start, start + row.lanes)
        start += row.lanes
        limits.append(
            Bounded(plain(row.name), row.bound, row.unit, row.unit_of_margin, row.at_most, own)
        )
    variables = {plain(variable.name): variable for variable in space.variables}
    return relaxations(limits, variables, prices, optimum.last.margins)


def _deciding(one: Relaxation, rows: Sequence[Rows]) -> str:
    """The number of a limit's active margins; empty for a bound."""
    lanes = {plain(row.name): row.lanes for row in rows}
    return f"{len(one.margins)} of {lanes[one.name]}" if one.name in lanes else ""


def _worth(optimum: Optimum, unit: str, gain: float) -> str:
    if optimum.feasible:
        return f"{shown(gain, unit, 3)} less"
    return less_violated(gain)


def less_violated(gain: float) -> str:
    """The decrease of a violation [1] in words: in percentage points, as it is itself in
    percent."""
    return f"the violation falls by {100 * gain:.3g} percentage points"


_UNKNOWN = "The design cannot be evaluated."
_FREE = "No limit decides, and no bound that could give way."


def price_parts(
    space: DesignSpace, optimum: Optimum, rows: Sequence[Rows], unit: str
) -> list[Part | str]:
    """The shadow prices of the limits and bounds that are active at the end of a search."""
    if optimum.last.failed:
        return [_UNKNOWN]
    kept = _priced(space, optimum, rows)
    if not kept:
        return [_FREE]
    table = [
        [one.name, shown(one.bound, one.unit), shown(one.relaxed, one.unit),
         _worth(optimum, unit, one.gain), _deciding(one, rows)]
        for one in kept
    ]  # fmt: skip
    head = (
        "What relaxing a limit or bound by a tenth is worth"
        if optimum.feasible
        else "No design that holds all limits was found. These fight"
    )
    titles = ["limit or bound", "now", "relaxed to", "worth", "margins that decide"]
    note = "Shadow prices: rates times a tenth of the bound, near the design and one at a time."
    return [Table(titles, table, head, note)]


def price_text(
    space: DesignSpace, optimum: Optimum, rows: Sequence[Rows], unit: str, most: int = 6
) -> str:
    """The same as lines, the first few."""
    if optimum.last.failed:
        return _UNKNOWN
    kept = _priced(space, optimum, rows)
    if not kept:
        return _FREE
    head = "What decides, and what relaxing it by a tenth is worth"
    if not optimum.feasible:
        head = "No design that holds all limits was found. These fight, and relaxing one is worth"
    lines = [
        f"  {one.name}: {shown(one.relaxed, one.unit)} instead of {shown(one.bound, one.unit)}, "
        f"{_worth(optimum, unit, one.gain)}"
        for one in kept[:most]
    ]
    return "\n".join([f"{head}:", *lines])
