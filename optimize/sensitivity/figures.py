"""Figures of the study: bars of elasticities, elasticities along a line, shares of variance."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fencejax import Status
from fencejax.plot import style

from .study import Global, Local

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LINES = (*style.LINES, style.INK)
_MARKED = "outside what the model answers for"


def _words(name: str) -> str:
    return name.replace("_", " ")


def bars(titles: Sequence[str], outputs, names, found: Local) -> "Figure":
    """Elasticities at each point, one panel a point and one bar an output."""
    figure = style.figure(1.4 + 0.42 * len(names), 3.4 + 2.6 * len(titles))
    panels = figure.subplots(1, len(titles), sharey=True, sharex=True, squeeze=False)[0]
    thick = 0.84 / len(outputs)
    places = np.arange(len(names))
    for index, (axes, title) in enumerate(zip(panels, titles, strict=True)):
        style.prepared(axes)
        for row, quantity in enumerate(outputs):
            axes.barh(
                places + (row - (len(outputs) - 1) / 2) * thick,
                found.elasticity[index, row],
                height=0.9 * thick,
                color=style.LINES[row % len(style.LINES)],
                label=_words(quantity.name) if index == 0 else None,
            )
        axes.set_yticks(places, [_words(name) for name in names])
        axes.axvline(0, color="black", linewidth=0.8)
        axes.grid(False, axis="y")
        axes.set_title(title, fontsize="medium", loc="left")
        axes.set_xlabel("elasticity d ln Q / d ln p [1]")
    panels[0].invert_yaxis()
    figure.legend(loc="outside upper left", ncols=len(outputs), frameon=False, fontsize="small")
    return figure


def along(label: str, at: np.ndarray, outputs, names, found: Local, most: int = 8) -> "Figure":
    """Elasticities along a line, one panel an output, of the most important inputs; shaded
    where the status says that the model is not valid."""
    rows = (len(outputs) + 1) // 2
    figure = style.figure(0.8 + 2.9 * rows, 9.2)
    panels = figure.subplots(rows, 2, sharex=True, squeeze=False)
    largest = np.max(np.abs(np.nan_to_num(found.elasticity)), axis=(0, 1))
    chosen = sorted(np.argsort(-largest, kind="stable")[:most])
    doubtful = np.isin(found.status, (Status.LEFT_OVER_TIP, *range(Status.LEFT_OVER_TIP, 100)))
    for row, (axes, quantity) in enumerate(zip(panels.flat, outputs, strict=False)):
        style.prepared(axes)
        for color, j in zip(_LINES, chosen, strict=False):
            axes.plot(
                at, found.elasticity[:, row, j], color=color, linewidth=1.3,
                label=_words(names[j]) if row == 0 else None,
            )  # fmt: skip
        axes.axhline(0, color="black", linewidth=0.7)
        for k, (start, end) in enumerate(_spans(at, doubtful)):
            axes.axvspan(
                start, end, color=style.GRID, alpha=0.6, linewidth=0, zorder=0,
                label=_MARKED if row == 0 and k == 0 else None,
            )  # fmt: skip
        axes.set_title(_words(quantity.name), loc="left", fontsize="medium")
        axes.set_ylabel("elasticity [1]")
        axes.tick_params(labelbottom=True)
        axes.set_xlabel(label)
    for axes in panels.flat[len(outputs) :]:
        axes.set_axis_off()
    figure.legend(loc="outside upper left", ncols=5, frameon=False, fontsize="small")
    return figure


def _spans(at: np.ndarray, marked: np.ndarray) -> list[tuple[float, float]]:
    """Where along the line the marked places lie, each as wide as its share of the line."""
    edges = np.concatenate([at[:1], 0.5 * (at[1:] + at[:-1]), at[-1:]])
    return [(edges[k], edges[k + 1]) for k in np.flatnonzero(marked)]


def shares(outputs, names, found: Global, confidence: float) -> "Figure":
    """Sobol' indices beside the bounds from derivatives, one panel an output, with intervals."""
    columns = 2 if len(outputs) > 1 else 1
    rows = (len(outputs) + columns - 1) // columns
    figure = style.figure(0.9 + rows * (0.8 + 0.34 * len(names)), 1.6 + 3.9 * columns)
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False)
    places = np.arange(len(names))
    series = (
        ("alone, S_i", found.indices.first, style.GRAY),
        ("total, S_Ti", found.indices.total, style.BLUE),
        ("bound on S_Ti from derivatives", found.measures.bound, style.RED),
    )
    for row, (axes, quantity) in enumerate(zip(panels.flat, outputs, strict=False)):
        style.prepared(axes)
        widest = max(float(np.max(e.high[row])) for _, e, _ in series)
        limit = 1.12 * min(max(widest, 0.3), 1.3)
        for k, (title, estimate, color) in enumerate(series):
            value = estimate.value[row]
            spread = np.stack([value - estimate.low[row], estimate.high[row] - value])
            where = places + (k - 1) * 0.27
            axes.barh(
                where, value, height=0.25, color=color, label=title if row == 0 else None,
                xerr=np.maximum(spread, 0), error_kw={"linewidth": 0.9, "capsize": 1.5},
            )  # fmt: skip
            for y, v in zip(where, value, strict=True):
                if v > limit:
                    axes.annotate(
                        f"{v:.2g} ", (limit, y), ha="right", va="center", fontsize="x-small",
                        color="white",
                    )  # fmt: skip
        axes.set_xlim(min(0.0, 1.05 * float(np.min(found.indices.first.low[row]))), limit)
        axes.set_yticks(places, [_words(name) for name in names])
        axes.axvline(0, color="black", linewidth=0.8)
        axes.grid(False, axis="y")
        axes.set_title(_words(quantity.name), loc="left", fontsize="medium")
        axes.set_xlabel("share of the variance [1]")
    panels.flat[0].invert_yaxis()
    for axes in panels.flat[len(outputs) :]:
        axes.set_axis_off()
    figure.legend(
        loc="outside upper left", ncols=3, frameon=False, fontsize="small",
        title=f"whiskers: {100 * confidence:g} % intervals", title_fontsize="small",
        alignment="left",
    )  # fmt: skip
    return figure
