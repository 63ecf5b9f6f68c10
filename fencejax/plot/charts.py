"""Charts of studies and optimisations: maps, fronts, convergence, gradients."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from jaxtyping import ArrayLike

from . import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def heat_map(
    x: ArrayLike,
    y: ArrayLike,
    values: ArrayLike,
    *,
    x_label: str,
    y_label: str,
    label: str,
    good: ArrayLike | None = None,
    contours: bool = True,
    color_map: str = style.MAP,
    axes: "Axes | None" = None,
) -> "Axes":
    """A quantity over two variables as colors, with lines of equal value.

    **Arguments:**

    - `x` (n,), `y` (m,), rising; `values` (m, n): the quantity at each of their pairs.
    - `x_label`, `y_label`, `label`: of the axes and the colors, each with a unit: `"mass [kg]"`.
    - `good` (m, n): where the values are valid; elsewhere, and where they are not finite, the map
      is hatched.
    - `contours`: draw the lines.
    - `color_map`: matplotlib's name.
    - `axes`: where to draw; by default a figure of page width.

    Raises `ValueError` where the shapes do not fit or a label has no unit.

    >>> names = {"x_label": "mass [kg]", "y_label": "R [m]", "label": "peak force [N]"}
    >>> axes = fj.plot.heat_map([5, 15], [0.8, 1.0], [[600, 900], [700, 1000]], **names)
    """
    style.check_labels(x_label=x_label, y_label=y_label, label=label)
    across, up = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    table = np.asarray(values, dtype=float)
    if across.ndim != 1 or up.ndim != 1 or table.shape != (up.size, across.size):
        raise ValueError(
            "Arguments `x`, `y` and `values` must have the shapes (n,), (m,) and (m, n), but have "
            f"{across.shape}, {up.shape} and {table.shape}."
        )
    for name, given in (("x", across), ("y", up)):
        if not np.all(np.diff(given) > 0):
            raise ValueError(f"Argument `{name}` must rise, but does not.")
    sound = np.isfinite(table)
    if good is not None:
        sound = sound & np.asarray(good, dtype=bool)
    axes = style.prepared(axes, height=3.8)
    axes.grid(False)
    # The hatching is below the colors, which cover it where there is a value.
    style.hatched(axes)
    shown = np.ma.masked_where(~sound, table)
    mesh = axes.pcolormesh(across, up, shown, shading="nearest", cmap=color_map, zorder=1)
    spread = shown.compressed()
    if contours and min(table.shape) > 1 and spread.size and np.ptp(spread) > 0:
        lines = axes.contour(across, up, shown, colors="white", linewidths=0.7, zorder=2)
        axes.clabel(lines, fontsize="x-small", fmt="%g")
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.colorbar(mesh, ax=axes, label=label)
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    return axes


def non_dominated(points: ArrayLike) -> np.ndarray:
    """Which of the points (n, k) no other point dominates, by being at most as large in every
    column and smaller in one. Equal points all count; points that are not finite do not. Shape
    (n,).

    >>> fj.plot.non_dominated(np.array([[60, 1200], [80, 1000], [80, 1100]]))
    array([ True,  True, False])
    """
    table = np.asarray(points, dtype=float)
    finite = np.all(np.isfinite(table), axis=1)
    kept = finite.copy()
    for k in np.flatnonzero(finite):
        below = np.all(table[finite] <= table[k], axis=1)
        kept[k] = not np.any(below & np.any(table[finite] < table[k], axis=1))
    return kept


def front(
    points: ArrayLike | Mapping[str, ArrayLike],
    *,
    x_label: str,
    y_label: str,
    names: Sequence[str] | None = None,
    bound: ArrayLike | None = None,
    bound_label: str = "physical bound",
    logarithmic: bool = False,
    axes: "Axes | None" = None,
) -> "Axes":
    """Points of two quantities to be minimised, and their Pareto front: non-dominated points joined
    by a line, the others pale.

    **Arguments:**

    - `points` (n, 2): x and y; or several of these by name, each with a front of its own.
    - `x_label`, `y_label`: of the axes, each with a unit.
    - `names`: one for each point of a single set, written beside it.
    - `bound` (b, 2): a line below which no point is possible, `bound_label` its name.
    - `logarithmic`: both axes.
    - `axes`: where to draw; by default a figure of page width.

    Raises `ValueError` where the shapes do not fit or a label has no unit.

    >>> designs = [[60, 1200], [80, 1000], [80, 1100]]
    >>> axes = fj.plot.front(designs, x_label="tip deflection [mm]", y_label="peak force [N]")
    """
    style.check_labels(x_label=x_label, y_label=y_label)
    sets: dict[str, Any] = dict(points) if isinstance(points, Mapping) else {"": points}
    tables = {title: np.asarray(given, dtype=float) for title, given in sets.items()}
    for title, table in tables.items():
        if table.ndim != 2 or table.shape[1] != 2:
            which = f" for {title!r}" if title else ""
            raise ValueError(
                f"Argument `points` must have the shape (n, 2){which}, but has {table.shape}."
            )
    if names is not None and (len(tables) > 1 or len(names) != len(next(iter(tables.values())))):
        raise ValueError(
            "Argument `names` must hold one name for each point of a single set, but holds "
            f"{len(names)}."
        )
    axes = style.prepared(axes)
    for index, (title, table) in enumerate(tables.items()):
        color = style.LINES[index % len(style.LINES)]
        best = non_dominated(table)
        axes.plot(*table[~best].T, "o", color=color, alpha=0.25, markersize=4)
        picks = np.flatnonzero(best)[np.argsort(table[best, 0], kind="stable")]
        axes.plot(
            *table[picks].T, "o-", color=color, markersize=5, linewidth=1.2, label=title or None
        )
        for k in np.flatnonzero(np.all(np.isfinite(table), axis=1)):
            if names is not None:
                at = (float(table[k, 0]), float(table[k, 1]))
                axes.annotate(
                    names[int(k)], at, (5, 4), textcoords="offset points", fontsize="small",
                    color="black" if best[k] else style.GRAY,
                )  # fmt: skip
    if bound is not None:
        line = np.asarray(bound, dtype=float)
        if line.ndim != 2 or line.shape[1] != 2:
            raise ValueError(f"Argument `bound` must have the shape (b, 2), but has {line.shape}.")
        axes.plot(*line.T, "--", color="black", linewidth=1, label=bound_label)
    if logarithmic:
        _logarithmic(axes)
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    style.legend(axes)
    return axes


def _logarithmic(axes: "Axes") -> None:
    """Make the axes logarithmic, with plain numbers as ticks."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        axis.set_major_locator(LogLocator(subs=(1.0,) if high / low > 100 else (1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


class Evaluated(Protocol):
    """The numbers of an evaluation that `convergence` draws: its number, the objective, the
    largest violation [1], the residual of the conditions of Karush, Kuhn and Tucker [1], and
    whether it failed."""

    @property
    def evaluation(self) -> int: ...
    @property
    def objective(self) -> float: ...
    @property
    def violation(self) -> float: ...
    @property
    def kkt(self) -> float: ...
    @property
    def failed(self) -> bool: ...


def convergence(
    history: Sequence[Evaluated],
    *,
    unit: str = "N",
    scale: float = 1.0,
    label: str = "worst case",
    tolerance: float | None = None,
    axes: "tuple[Axes, Axes] | None" = None,
) -> "tuple[Axes, Axes]":
    """Above, the objective [`unit`] at each evaluation; below, violation and the residual of the
    conditions of Karush, Kuhn and Tucker [1], with `tolerance` as a line. `label`: what the
    objective is, such as the worst case or a mean.

    Evaluations that failed are left out of the lines and marked on the horizontal axis; a point
    with no violation has no mark below.

    >>> optimum = fj.minimize(lambda z: (z**2, z - 0.5, jnp.zeros(1, int)), [0.9])
    >>> above, below = fj.plot.convergence(optimum.history, unit="1")
    """
    from matplotlib.ticker import MaxNLocator

    if axes is None:
        upper, lower = style.figure(1.6 * style.HEIGHT).subplots(2, 1, sharex=True)
    else:
        upper, lower = axes
    style.prepared(upper)
    style.prepared(lower)
    good = [record for record in history if not record.failed]
    number = [record.evaluation for record in good]
    objective = [scale * record.objective for record in good]
    upper.plot(number, objective, "o-", color=style.BLUE, markersize=3)
    upper.set_ylabel(f"{label} [{unit}]")
    for label, color, values in (
        ("largest violation", style.RED, [record.violation for record in good]),
        ("KKT residual", style.BLUE, [record.kkt for record in good]),
    ):
        shown = np.asarray(values, dtype=float)
        shown = np.where(shown > 0, shown, np.nan)
        lower.semilogy(number, shown, "o-", color=color, markersize=3, label=label)
    if tolerance is not None:
        lower.axhline(tolerance, color="black", linestyle="--", linewidth=1, label="tolerance")
    failed = [record.evaluation for record in history if record.failed]
    if failed:
        lower.plot(
            failed, [0] * len(failed), "x", color="black", clip_on=False, label="failed",
            transform=lower.get_xaxis_transform(),
        )  # fmt: skip
    lower.set_xlabel("evaluations [1]")
    lower.xaxis.set_major_locator(MaxNLocator(integer=True))
    lower.set_ylabel("violation, residual [1]")
    if not any(record.violation > 0 or record.kkt > 0 for record in good):
        lower.set_yscale("linear")
    style.legend(lower)
    return upper, lower


def gradient_bars(
    elasticities: Mapping[str, Mapping[str, float]], *, axes: "Axes | None" = None
) -> "Axes":
    """Elasticities d ln Q / d ln p [1] as bars: by quantity Q, then by variable p.

    1 means that a 1 % larger p makes Q 1 % larger. `fencejax.Gradient.elasticities` gives those of
    a quantity.

    >>> axes = fj.plot.gradient_bars({"peak_force": {"thickness": 0.8, "mass": 0.5}})
    >>> axes.get_xlabel()
    'elasticity d ln Q / d ln p [1]'
    """
    variables = list(dict.fromkeys(name for row in elasticities.values() for name in row))
    axes = style.prepared(axes, height=1.1 + 0.36 * max(4, len(variables)))
    thick = 0.8 / max(1, len(elasticities))
    places = np.arange(len(variables))
    for index, (quantity, row) in enumerate(elasticities.items()):
        axes.barh(
            places + (index - (len(elasticities) - 1) / 2) * thick,
            [row.get(name, 0.0) for name in variables],
            height=0.9 * thick,
            color=style.LINES[index % len(style.LINES)],
            label=quantity.replace("_", " "),
        )
    axes.set_yticks(places, [name.replace("_", " ") for name in variables])
    axes.invert_yaxis()
    axes.axvline(0, color="black", linewidth=0.8)
    axes.grid(False, axis="y")
    axes.set_xlabel("elasticity d ln Q / d ln p [1]")
    style.legend(axes)
    return axes
