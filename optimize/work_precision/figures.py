"""The diagrams: fronts, knobs one at a time, components of the gradient, costs, random impacts."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fencejax.plot import legend_above, panel, style

from ..common.files import write_figure
from .cases import SYMBOLS, TITLES, VARIABLES
from .errors import spread

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .errors import Errors
    from .findings import Report, Rung
    from .ladder import Point

# A marker with each, for colour-blind readers.
_COLORS = (*style.LINES, style.INK)
_MARKERS = "osD^v<>P"
_PAGE = 6.9
_LOG_KNOBS = {
    "modes": "modes kept [1]",
    "longest_stride": "longest stride [s]",
    "slip_speed": r"slip_speed $\varepsilon$ [m/s]",
    "step": "step [s]",
}
# Errors are drawn down to here, round-off and below.
_LEAST = 1e-9


def _figure(height: float) -> "Figure":
    return style.figure(height, _PAGE)


def _shares(axes: "Axes", axis: str) -> None:
    """A logarithmic axis of errors, its ticks in per cent."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    which = axes.xaxis if axis == "x" else axes.yaxis
    (axes.set_xscale if axis == "x" else axes.set_yscale)("log")
    which.set_major_formatter(FuncFormatter(lambda v, _: f"{100 * v:g} %"))
    which.set_minor_formatter(NullFormatter())


def _times(axes: "Axes") -> None:
    """A logarithmic axis of times upwards, its ticks plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_yscale("log")
    low, high = axes.get_ylim()
    subs = (1.0,) if high / low > 30 else (1.0, 2.0, 5.0)
    axes.yaxis.set_major_locator(LogLocator(subs=subs))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _knobs(report: "Report") -> "dict[str, list[tuple[Point, Errors]]]":
    """The measured points of the knobs that are drawn over a logarithmic axis."""
    drawn = (name for name in _LOG_KNOBS if report.knobs.get(name))
    return {name: [(p, e) for p, e in report.knobs[name] if p.size > 0] for name in drawn}


def _over_knob(axes: "Axes", name: str, points: "list[tuple[Point, Errors]]") -> None:
    """Errors over a knob: both axes logarithmic, every number of modes a tick of its own."""
    axes.set_xscale("log")
    _shares(axes, "y")
    from matplotlib.ticker import LogFormatterMathtext, LogLocator, NullLocator

    axes.xaxis.set_minor_locator(NullLocator())
    if name == "modes":
        axes.set_xticks([p.size for p, _ in points], [p.label for p, _ in points])
        return
    sizes = [p.size for p, _ in points]
    subs = (1.0,) if max(sizes) > 10 * min(sizes) else (1.0, 2.0, 5.0)
    axes.xaxis.set_major_locator(LogLocator(subs=subs))
    axes.xaxis.set_major_formatter(LogFormatterMathtext(labelOnlyBase=False))


def front_figure(report: "Report") -> "Figure":
    """Time of one lane in a batch over error, of value and gradient: grid, rungs and front."""
    figure = _figure(3.6)
    lanes = len(report.truth.values)
    for axes, kind in zip(figure.subplots(1, 2), ("value", "gradient"), strict=True):
        title = "peak force" if kind == "value" else "its gradient in eight variables"
        panel(
            axes, f"error of the {kind}, 95 % of impacts", f"time a lane of {lanes} [ms]", title
        )

        def place(rung: "Rung", kind=kind) -> tuple[float, float]:
            times = rung.value_times[lanes] if kind == "value" else rung.gradient_time
            return rung.error(kind), 1e3 * times.median

        seen = set()
        for rung in sorted(report.grid, key=lambda r: r.fidelity.mode_count):
            count = rung.fidelity.mode_count
            key = (1, 2, 3, 4, 6).index(count) if count in (1, 2, 3, 4, 6) else 5
            label = None if count in seen else f"{count} mode" + ("s" if count > 1 else "")
            seen.add(count)
            axes.plot(*place(rung), _MARKERS[key], color=_COLORS[key], markersize=4.5, label=label)
        points = [place(rung) for rung in report.front(kind)]
        axes.plot(*zip(*points, strict=True), color=style.GRAY, linewidth=1.0, zorder=1)
        for rung in report.rungs:
            x, y = place(rung)
            axes.plot(
                x, y, "*", color="black", markersize=9, zorder=5,
                label="named rung" if rung is report.rungs[0] else None,
            )  # fmt: skip
            axes.annotate(
                rung.name, (x, y), (6, 4), textcoords="offset points", fontsize="small", zorder=6
            )
        _shares(axes, "x")
        axes.margins(x=0.14, y=0.08)
        _times(axes)
    legend_above(figure.axes[0], 6)
    return figure


def _spreads(axes: "Axes", kind: str, points: "list[tuple[Point, Errors]]") -> None:
    """Errors of each quantity over the points' sizes: a line of medians, a band up to 95 %."""
    sizes = [point.size for point, _ in points]
    for k, title in enumerate(TITLES):
        rows = [spread(getattr(errors, kind)[:, k]) for _, errors in points]
        middle = np.maximum([r["median"] for r in rows], _LEAST)
        upper = np.maximum([r["95 %"] for r in rows], _LEAST)
        axes.plot(
            sizes, middle, _MARKERS[k] + "-", color=_COLORS[k], markersize=3.5, linewidth=1.2,
            label=title,
        )  # fmt: skip
        axes.fill_between(sizes, middle, upper, color=_COLORS[k], alpha=0.15, linewidth=0)


def knob_figure(report: "Report") -> "Figure | None":
    """Errors over modes, smoothing and step, one at a time: three values above, three gradients
    below; lines are medians, bands reach to 95 % of the impacts."""
    knobs = _knobs(report)
    if not knobs:
        return None
    figure = _figure(5.2)
    panels = figure.subplots(2, len(knobs), sharex="col", sharey="row", squeeze=False)
    for column, (name, points) in enumerate(knobs.items()):
        for row, kind in enumerate(("value", "gradient")):
            axes = panels[row, column]
            panel(
                axes, _LOG_KNOBS[name] if row else "", "" if column else f"error of the {kind}",
                "" if row else name,
            )  # fmt: skip
            _spreads(axes, kind, points)
            _over_knob(axes, name, points)
    legend_above(figure.axes[0], 3)
    return figure


def tolerance_figure(report: "Report") -> "Figure | None":
    """Error-controlled steps: the tolerance over the resulting error, of value and
    gradient; lines are medians, bands reach to 95 % of the impacts."""
    points = [(p, e) for p, e in report.knobs.get("step_tolerance", []) if p.size > 0]
    if not points:
        return None
    figure = _figure(3.3)
    asked = [point.size for point, _ in points]
    for axes, kind in zip(figure.subplots(1, 2, sharey=True), ("value", "gradient"), strict=True):
        panel(
            axes, "tolerance asked for", "error got" if kind == "value" else "",
            kind if kind == "value" else "gradient in eight variables",
        )  # fmt: skip
        _spreads(axes, kind, points)
        axes.plot(
            asked, asked, color="black", linewidth=0.7, linestyle=":", label="got what was asked"
        )
        _shares(axes, "x")
        _shares(axes, "y")
    legend_above(figure.axes[0], 4)
    return figure


def component_figure(report: "Report") -> "Figure | None":
    """Median error of each component of the peak force's gradient, relative to its norm, over
    modes, smoothing and step."""
    knobs = _knobs(report)
    if not knobs:
        return None
    figure = _figure(3.4)
    panels = figure.subplots(1, len(knobs), sharey=True, squeeze=False)[0]
    for axes, (name, points) in zip(panels, knobs.items(), strict=True):
        x = [point.size for point, _ in points]
        panel(
            axes, _LOG_KNOBS[name],
            "" if axes is not panels[0] else "error of a component of the\ngradient of the peak "
            "force / norm",
        )  # fmt: skip
        for j in range(len(VARIABLES)):
            rows = [
                np.nan if errors.component is None else spread(errors.component[:, 0, j])["median"]
                for _, errors in points
            ]
            axes.plot(
                x, np.maximum(rows, _LEAST), _MARKERS[j] + "-", color=_COLORS[j], markersize=3.5,
                linewidth=1.0, label=SYMBOLS[j],
            )  # fmt: skip
        _over_knob(axes, name, points)
    legend_above(figure.axes[0], 8)
    return figure


def random_figure(report: "Report") -> "Figure":
    """Share of the impacts whose error is at most so large, by rung."""
    figure = _figure(3.0)
    for axes, kind in zip(figure.subplots(1, 2, sharey=True), ("value", "gradient"), strict=True):
        panel(
            axes, f"error of the peak force's {kind}",
            "share of the impacts [1]" if kind == "value" else "",
        )  # fmt: skip
        for k, rung in enumerate(report.rungs):
            found = np.sort(np.maximum(getattr(rung.errors, kind)[:, 0], 1e-6))
            axes.step(
                found, (1 + np.arange(len(found))) / len(found), where="post", color=_COLORS[k],
                linestyle=("-", "--", "-.", ":")[k % 4], linewidth=1.4, label=rung.name,
            )  # fmt: skip
        axes.axhline(0.95, color="black", linewidth=0.7, linestyle=":")
        axes.axvline(0.01 if kind == "value" else 0.05, color="black", linewidth=0.7, linestyle=":")
        _shares(axes, "x")
        axes.tick_params(axis="x", labelsize="x-small")
        axes.set_ylim(0, 1.02)
    legend_above(figure.axes[0], 4)
    return figure


def _costs(report: "Report") -> dict[str, list[tuple["Rung", float, float, float]]]:
    """The costs of the rungs, by title: the rung, median, 10 and 90 % quantile."""
    found: dict = {}
    for rung in report.rungs:
        for lanes, t in sorted(rung.value_times.items()):
            rows = found.setdefault(f"value, a lane of {lanes} [ms]", [])
            rows.append((rung, 1e3 * t.median, 1e3 * t.low, 1e3 * t.high))
        t = rung.gradient_time
        rows = found.setdefault(f"gradient, a lane of {len(report.truth.values)} [ms]", [])
        rows.append((rung, 1e3 * t.median, 1e3 * t.low, 1e3 * t.high))
        for kind in ("value", "gradient") if rung.cold else ():
            own = rung.cold[kind] if rung.cold else {}
            rows = found.setdefault(f"one {kind} [ms]", [])
            rows.append((rung, *(1e3 * own["run"][k] for k in ("median", "low", "high"))))
            rows = found.setdefault(f"compiling the {kind}, cold [s]", [])
            rows.append((rung, *[own["compile [s]"]] * 3))
        if rung.cold:
            memory = rung.cold["gradient"]["peak resident [B]"] / 2**20
            found.setdefault("peak resident memory [MiB]", []).append((rung, *[memory] * 3))
    return found


def cost_figure(report: "Report") -> "Figure":
    """Every cost of the rungs over their errors: value filled, gradient open."""
    costs = _costs(report)
    rows = -(-len(costs) // 3)
    figure = _figure(0.5 + 1.9 * rows)
    panels = figure.subplots(rows, 3, squeeze=False).ravel()
    for axes in panels[len(costs):]:
        axes.set_axis_off()
    for axes, (title, points) in zip(panels, costs.items(), strict=False):
        panel(axes, "error of the peak force", "", "")
        axes.set_title(title, loc="left", fontsize="small")
        for fill, (kind, color) in enumerate((("value", _COLORS[0]), ("gradient", _COLORS[1]))):
            x = [rung.error(kind) for rung, *_ in points]
            y = np.array([row[1:] for row in points])
            reach = np.abs(y[:, 1:] - y[:, :1]).T
            axes.errorbar(
                x, y[:, 0], yerr=reach, fmt="o-" if not fill else "s--", color=color, capsize=2,
                markersize=4, linewidth=1.0, label=f"error of the {kind}",
            )  # fmt: skip
        _shares(axes, "x")
        if "compiling" in title or "memory" in title:
            axes.set_ylim(0, axes.get_ylim()[1])
        else:
            _times(axes)
    legend_above(figure.axes[0], 2)
    return figure


def draw(report: "Report", out: Path) -> None:
    """Write all diagrams into `out`."""
    drawn = {
        "front": front_figure(report),
        "knobs": knob_figure(report),
        "tolerance": tolerance_figure(report),
        "components": component_figure(report),
        "random_impacts": random_figure(report),
        "costs": cost_figure(report),
    }
    for name, figure in drawn.items():
        if figure is not None:
            write_figure(out / f"{name}.png", figure)
