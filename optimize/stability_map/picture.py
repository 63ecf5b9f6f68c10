"""The stability map's figures."""

import re
from pathlib import Path

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullLocator

from fencejax.plot import style

from ..common.files import write_figure
from .scenes import AXES, ORDINARY, TITLES

_NAMES = ("right", "off: good status, beyond the promise", "warned", "refused")
# Distinguishable for colour-blind readers, and in grey.
_COLORS = (style.BLUE, style.RED, style.CAUTION, style.GRAY)
_MAP = ListedColormap(_COLORS)
_COLUMNS = 2


def _legend(figure):
    handles = [
        Patch(facecolor=c, edgecolor="black", linewidth=0.4, label=n)
        for c, n in zip(_COLORS, _NAMES, strict=True)
    ]
    figure.legend(
        handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize="small"
    )


def _label(name: str) -> str:
    """An axis' title with its unit, powers raised."""
    unit = re.sub(r"\^(-?[\d.]+)", r"$^{\1}$", AXES[name][2])
    return f"{TITLES[name]} [{unit}]"


def _edges(values: np.ndarray) -> np.ndarray:
    """Borders half-way between neighbours, so that each value is in the middle of its cell."""
    ratio = np.sqrt(values[1] / values[0])
    return np.append(values / ratio, values[-1] * ratio)


def _scale(axis, name: str) -> None:
    low, high, _ = AXES[name]
    axis.set_major_locator(LogLocator(numticks=7 if high / low < 1e8 else 5))
    axis.set_minor_locator(NullLocator())


def draw_axes(path: Path, axes: dict[str, np.ndarray], kinds: dict) -> None:
    """A panel for every axis, in it a strip for every fidelity; a line at the ordinary value."""
    rows = -(-len(axes) // _COLUMNS)
    figure = style.figure((0.34 + 0.13 * len(kinds)) * rows + 0.5, 7.6)
    panels = figure.subplots(rows, _COLUMNS, squeeze=False).T.ravel()
    at = 0
    for panel, (name, values) in zip(panels, axes.items(), strict=False):
        strips = np.stack([kind[at : at + len(values)] for kind, _ in kinds.values()])
        rungs = np.arange(len(kinds) + 1)
        panel.pcolormesh(
            _edges(values), rungs, strips, cmap=_MAP, vmin=-0.5, vmax=3.5, rasterized=True
        )
        panel.hlines(rungs[1:-1], *_edges(values)[[0, -1]], color="white", linewidth=1.0)
        if ORDINARY[name] > 0:
            panel.axvline(ORDINARY[name], color="black", linewidth=1.2)
        panel.set_xscale("log")
        panel.invert_yaxis()
        panel.set_yticks(rungs[:-1] + 0.5, list(kinds))
        panel.tick_params(labelsize="x-small", pad=1.5, length=2)
        panel.tick_params(axis="y", length=0)
        panel.set_title(_label(name), loc="left", fontsize="small", pad=2)
        _scale(panel.xaxis, name)
        at += len(values)
    for panel in panels[len(axes) :]:
        panel.set_axis_off()
    _legend(figure)
    write_figure(path, figure, dpi=110)


def draw_pairs(path: Path, pairs, side: int, begin: int, kinds: dict) -> None:
    """A map for every pair of axes, a row for every fidelity; a cross at the ordinary values."""
    figure = style.figure(2.3 * len(kinds) + 0.4, 2.5 * len(pairs))
    grid = figure.subplots(len(kinds), len(pairs), squeeze=False, sharex="col", sharey="col")
    for row, (title, (kind, _)) in zip(grid, kinds.items(), strict=True):
        row[0].set_title(title, loc="left", fontsize="small", fontweight="bold")
        for n, (panel, (one, other)) in enumerate(zip(row, pairs, strict=True)):
            part = kind[begin + n * side**2 :][: side**2].reshape(side, side)
            x, y = (_edges(np.geomspace(*AXES[name][:2], side)) for name in (one, other))
            panel.pcolormesh(x, y, part.T, cmap=_MAP, vmin=-0.5, vmax=3.5, rasterized=True)
            if ORDINARY[one] > 0 and ORDINARY[other] > 0:
                panel.plot(ORDINARY[one], ORDINARY[other], "+", color="black", markersize=9)
            panel.set(xscale="log", yscale="log")
            panel.tick_params(labelsize="x-small", length=2)
            panel.set_ylabel(_label(other), fontsize="small")
            _scale(panel.xaxis, one)
            _scale(panel.yaxis, other)
    for panel, (one, _) in zip(grid[-1], pairs, strict=True):
        panel.set_xlabel(_label(one), fontsize="small")
    _legend(figure)
    write_figure(path, figure, dpi=110)
