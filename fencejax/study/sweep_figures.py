"""Figures of a sweep: a map of two variables, a line of one, scatter and medians of more."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ..plot import style
from ..printing import multiple
from ..results import Status

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# More points than these hide each other.
_MOST_POINTS = 4000
_SLICES = 16


class Lanes(Protocol):
    """What is drawn: the columns of a `fencejax.SweepTable`."""

    @property
    def variables(self) -> Mapping[str, np.ndarray]: ...
    @property
    def outputs(self) -> Mapping[str, np.ndarray]: ...
    @property
    def gradient(self) -> Mapping[str, np.ndarray]: ...
    @property
    def gradient_of(self) -> str | None: ...
    @property
    def units(self) -> Mapping[str, str]: ...
    @property
    def scalings(self) -> Mapping[str, str]: ...
    @property
    def shape(self) -> tuple[int, ...]: ...
    @property
    def is_grid(self) -> bool: ...
    @property
    def good(self) -> np.ndarray: ...
    def grid(self, name: str) -> np.ndarray: ...


def draw(table: Lanes) -> dict[str, "Figure"]:
    """The figures of every output, and of the elasticities where there is a gradient, by name."""
    if table.is_grid and len(table.shape) == 2:
        one = heat_map
    elif table.is_grid and len(table.shape) == 1:
        one = line
    else:
        one = scatter
    drawn = {name.replace(".", "_"): one(table, name) for name in table.outputs}
    if table.gradient:
        drawn["elasticities"] = elasticities(table)
    return drawn


def _column(table: Lanes, name: str) -> tuple[np.ndarray, str]:
    """A column in the unit shown, and the label of its axis."""
    column = table.variables.get(name, table.outputs.get(name))
    assert column is not None
    largest = np.max(np.abs(column), initial=0, where=np.isfinite(column))
    size, unit = multiple(largest, table.units[name])
    words = name.replace("_", " ").replace(".", ": ")
    return column / size, f"{words} [{unit}]"


def _prepared(axes: "Axes", table: Lanes, x: str) -> "Axes":
    style.prepared(axes)
    axes.set_xlabel(_column(table, x)[1])
    _scale(axes.xaxis, axes.set_xscale, table, x)
    return axes


def _scale(axis, set_scale, table: Lanes, name: str) -> None:
    """A logarithmic axis where the variable was spaced so, marked with plain numbers."""
    if table.scalings[name] != "logarithmic":
        return
    from matplotlib.ticker import LogFormatter, LogLocator, NullFormatter

    set_scale("log")
    column = _column(table, name)[0]
    wide = column.max() >= 8 * column.min()
    marks = (1.0, 2.0, 5.0) if wide else (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)
    axis.set_major_locator(LogLocator(subs=marks))
    plain = 1e-3 <= column.min() and column.max() < 1e5
    axis.set_major_formatter("{x:g}" if plain else LogFormatter(labelOnlyBase=False))
    axis.set_minor_formatter(NullFormatter())


def heat_map(table: Lanes, name: str) -> "Figure":
    """An output over a grid of two variables; hatched where a lane has no good numbers."""
    (y, x), (height, label) = tuple(table.variables), _column(table, name)
    shown = np.where(table.good, height, np.nan).reshape(table.shape)
    places = {n: _column(table, n)[0].reshape(table.shape) for n in (x, y)}
    figure = style.figure(4.4, 5.8)
    axes = figure.subplots()
    mesh = axes.pcolormesh(
        places[x][0], places[y][:, 0], np.ma.masked_invalid(shown), cmap=style.MAP,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    axes.set_xlabel(_column(table, x)[1])
    axes.set_ylabel(_column(table, y)[1])
    _scale(axes.xaxis, axes.set_xscale, table, x)
    _scale(axes.yaxis, axes.set_yscale, table, y)
    figure.colorbar(mesh, ax=axes, label=label)
    handles = []
    over = table.grid("status") == Status.LEFT_OVER_TIP
    if np.any(over):
        handles += axes.plot(
            places[x][over], places[y][over], ".", color="white", markeredgecolor="black",
            markersize=4, markeredgewidth=0.4, label="a corner ran over the tip",
        )  # fmt: skip
    if not np.all(np.isfinite(shown)):
        style.hatched(axes)
        handles.append(style.hatched_patch("no good numbers"))
    if handles:
        figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
    return figure


def line(table: Lanes, name: str) -> "Figure":
    """An output over one variable; lanes without good numbers are marked below."""
    (x,), (height, label) = tuple(table.variables), _column(table, name)
    place = _column(table, x)[0]
    figure = style.figure(3.4, 5.8)
    axes = _prepared(figure.subplots(), table, x)
    axes.plot(place, np.where(table.good, height, np.nan), ".-", color=style.BLUE, markersize=4)
    axes.set_ylabel(label)
    _mark_bad(axes, place[~table.good])
    return figure


def _mark_bad(axes: "Axes", places: np.ndarray) -> None:
    if places.size:
        axes.plot(
            places, np.zeros(places.size), "x", color=style.RED, markersize=4, clip_on=False,
            transform=axes.get_xaxis_transform(), label="no good numbers",
        )  # fmt: skip


def scatter(table: Lanes, name: str) -> "Figure":
    """An output against each variable, the others being spread over their ranges: points, and the
    median and the middle 80 % of all of them in slices of the variable."""
    height, label = _column(table, name)
    good = table.good & np.isfinite(height)
    columns = min(3, len(table.variables))
    rows = -(-len(table.variables) // columns)
    figure = style.figure(0.5 + 2.5 * rows, max(4.0, 2.3 * columns))
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False)
    some = np.flatnonzero(good)[:: max(1, int(np.sum(good)) // _MOST_POINTS)]
    for axes in panels.flat[len(table.variables) :]:
        axes.set_visible(False)
    for index, variable in enumerate(table.variables):
        axes = _prepared(panels.flat[index], table, variable)
        place = _column(table, variable)[0]
        axes.plot(
            place[some], height[some], ".", color=style.GRAY, markersize=1.5, alpha=0.5,
            rasterized=True, label="lanes",
        )  # fmt: skip
        middle, low, median, high = _slices(place[good], height[good])
        axes.fill_between(
            middle, low, high, color=style.BLUE, alpha=0.2, linewidth=0, label="middle 80 %"
        )
        axes.plot(middle, median, color=style.BLUE, linewidth=1.5, label="median")
        bad = place[~table.good]
        _mark_bad(axes, bad[:: max(1, bad.size // 200)])
        if index % columns == 0:
            axes.set_ylabel(label)
    if np.all(height[good] >= 0):
        panels.flat[0].set_ylim(bottom=0)
    handles, labels = panels.flat[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside upper center", ncols=4, frameon=False, fontsize="small"
    )
    return figure


def _slices(place: np.ndarray, height: np.ndarray):
    """Middle of each slice with as many lanes, or of each value of a grid, and there the
    quantiles 0.1, 0.5 and 0.9 of the output."""
    distinct = np.unique(place)
    if len(distinct) <= _SLICES:
        parts = [np.flatnonzero(place == value) for value in distinct]
    else:
        parts = np.array_split(np.argsort(place), min(_SLICES, max(1, len(place) // 8)))
    parts = [part for part in parts if part.size]
    middle = np.array([np.median(place[part]) for part in parts])
    found = [np.quantile(height[part], (0.1, 0.5, 0.9)) for part in parts]
    return middle, *np.array(found).reshape(-1, 3).T


def elasticities(table: Lanes) -> "Figure":
    """Elasticities d ln Q / d ln p [1] of the output that was differentiated, over all good lanes:
    median, middle half and middle 90 %."""
    main = str(table.gradient_of)
    value = table.outputs[main]
    good = table.good & (value != 0)
    names = list(table.gradient)
    figure = style.figure(1.2 + 0.5 * max(2, len(names)), 5.8)
    axes = figure.subplots()
    style.prepared(axes)
    axes.grid(False, axis="y")
    for index, name in enumerate(names):
        slope = table.gradient[name][good] * table.variables[name][good] / value[good]
        slope = slope[np.isfinite(slope)]
        if not slope.size:
            continue
        least, low, median, high, most = np.quantile(slope, (0.05, 0.25, 0.5, 0.75, 0.95))
        ends = index == 0
        axes.plot(
            [least, most], [index, index], color=style.BLUE, linewidth=1.2,
            label="middle 90 %" if ends else None,
        )  # fmt: skip
        axes.barh(
            index, high - low, left=low, height=0.45, color=style.BLUE, alpha=0.35,
            label="middle half" if ends else None,
        )  # fmt: skip
        axes.plot(median, index, "o", color=style.BLUE, label="median" if ends else None)
    axes.axvline(0, color="black", linewidth=0.8)
    axes.set_yticks(range(len(names)), [name.replace("_", " ") for name in names])
    axes.invert_yaxis()
    axes.set_xlabel(f"elasticity d ln {main.replace('_', ' ')} / d ln p [1]")
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize="small")
    return figure
