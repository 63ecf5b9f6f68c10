"""Figures of a sweep: a map over two variables, a line over one, scatter and medians over more."""

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Protocol

import numpy as np
from jaxtyping import ArrayLike

from ..printing import multiple
from ..results import MEASURES, Status
from ..scenes import numbers
from . import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# More points than these cover each other.
_MOST_POINTS = 4000
_SLICES = 16


class Lanes(Protocol):
    """The columns to draw, as in a `fencejax.SweepTable`."""

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


@dataclasses.dataclass(frozen=True)
class _Columns:
    """The columns of a sweep without a table; see `Lanes`."""

    variables: Mapping[str, np.ndarray]
    outputs: Mapping[str, np.ndarray]
    units: Mapping[str, str]
    scalings: Mapping[str, str]
    shape: tuple[int, ...]
    is_grid: bool
    status: np.ndarray
    gradient: Mapping[str, np.ndarray] = dataclasses.field(default_factory=dict)
    gradient_of: str | None = None

    @property
    def good(self) -> np.ndarray:
        return (self.status >= 0) & (self.status <= Status.LEFT_OVER_TIP)

    def grid(self, name: str) -> np.ndarray:
        columns = {**self.variables, **self.outputs, "status": self.status}
        return columns[name].reshape(self.shape)


def _units(names: list[str], given: Mapping[str, str]) -> dict[str, str]:
    """The unit of each name: the given one, or that of a measure or of a scene's number."""
    found = {name: measure.unit for name, measure in MEASURES.items()}
    found.update(given)
    for name in names:
        if name not in found:
            try:
                found[name] = numbers.unit(name)
            except ValueError:
                raise ValueError(
                    f"Argument `units` must say the unit of {name!r}, which is neither a measure "
                    f'nor the path of a number of a scene. Write, for example, units={{"{name}": '
                    '"kg"}.'
                ) from None
    return found


def _logarithmic(values: np.ndarray) -> bool:
    """Whether values have equal ratios instead of equal differences."""
    distinct = np.unique(values)
    if distinct.size < 3 or distinct[0] <= 0:
        return False
    ratios, steps = np.diff(np.log(distinct)), np.diff(distinct)
    return bool(np.ptp(ratios) < 1e-6 * np.max(ratios) and np.ptp(steps) > 0.1 * np.max(steps))


def _columns(
    variables: Mapping[str, ArrayLike],
    outputs: Mapping[str, ArrayLike],
    status: ArrayLike | None,
    units: Mapping[str, str],
) -> _Columns:
    if not variables or not outputs:
        raise ValueError(
            "Arguments `variables` and `outputs` must hold at least one array each by name."
        )
    given = {name: np.asarray(values, dtype=float) for name, values in variables.items()}
    found = {name: np.asarray(values, dtype=float) for name, values in outputs.items()}
    shape = next(iter(found.values())).shape
    code = np.zeros(shape) if status is None else np.asarray(status)
    is_grid = len(given) == len(shape) <= 2
    if is_grid and all(values.ndim == 1 for values in given.values()):
        mesh = np.meshgrid(*given.values(), indexing="ij")
        given = dict(zip(given, mesh, strict=True))
    for name, values in {**given, **found, "status": code}.items():
        if values.shape != shape:
            raise ValueError(
                f"Argument `outputs` must hold arrays of one shape, with which `variables` and "
                f"`status` agree, or axes of a grid of it: {shape}, but {name!r} has "
                f"{values.shape}."
            )
    if is_grid and len(shape) == 1:
        is_grid = bool(np.all(np.diff(next(iter(given.values()))) > 0))
    return _Columns(
        variables={name: values.ravel() for name, values in given.items()},
        outputs={name: values.ravel() for name, values in found.items()},
        units=_units([*given, *found], units),
        scalings={n: "logarithmic" if _logarithmic(v) else "linear" for n, v in given.items()},
        shape=shape,
        is_grid=is_grid,
        status=code.ravel(),
    )


def sweep(
    variables: Lanes | Mapping[str, ArrayLike],
    outputs: Mapping[str, ArrayLike] | None = None,
    *,
    status: ArrayLike | None = None,
    units: Mapping[str, str] | None = None,
) -> dict[str, "Figure"]:
    """A figure of every output of a sweep, by name: a map of two variables on a grid, a line of
    one, else scatter, medians and the middle 80 % over each variable. Where there is a gradient,
    its `elasticities`, too. Lanes without good numbers are hatched or marked, and never drawn at 0.

    **Arguments:**

    - `variables`: a `fencejax.SweepTable`; or, of a sweep of one's own with `jax.vmap`, arrays [SI]
      by name: one value a lane, (N,), or the axes (n,) and (m,) of a grid.
    - `outputs`: arrays [SI] by name, (N,) or (n, m).
    - `status`: codes of `fencejax.Status` of the same shape; by default all are good.
    - `units`: the unit [SI] of each name that is neither a measure (`peak_force`) nor a path of
      `fencejax.scene_numbers` (`parcel.mass`).

    Raises `ValueError` where shapes differ or a unit is missing.

    >>> places, masses = np.linspace(0.7, 1.0, 3), np.linspace(5.0, 15.0, 4)
    >>> impact = lambda R, m: fj.scenes.normal_impact(distance=R, parcel=fj.Parcel(mass=m))
    >>> force = lambda R, m: fj.simulate(impact(R, m), only="peak_force").peak_force
    >>> grid = jax.vmap(jax.vmap(force, (None, 0)), (0, None))(places, masses)
    >>> axes = {"R": places, "parcel.mass": masses}
    >>> drawn = fj.plot.sweep(axes, {"peak_force": grid}, units={"R": "m"})
    >>> drawn["peak_force"].savefig("map.png")
    """
    if isinstance(variables, Mapping):
        return _drawn(_columns(variables, outputs or {}, status, units or {}))
    return _drawn(variables)


def _drawn(table: Lanes) -> dict[str, "Figure"]:
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
        axes.remove()
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
