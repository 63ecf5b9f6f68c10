"""The stability map's figures."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch
from matplotlib.ticker import NullFormatter

from .scenes import AXES

_NAMES = ("right", "off: good status, beyond the promise", "warned", "refused")
_COLOURS = ("#4c9f70", "#c1121f", "#f2c14e", "#8d99ae")
_MAP = ListedColormap(_COLOURS)


def _legend(figure):
    handles = [Patch(color=c, label=n) for c, n in zip(_COLOURS, _NAMES, strict=True)]
    figure.legend(handles=handles, loc="lower center", ncols=4, frameon=False)


def draw_axes(path: Path, axes: dict[str, np.ndarray], kinds: dict) -> None:
    """A strip for every axis, a column for every fidelity."""
    figure, grid = plt.subplots(
        len(axes), len(kinds), figsize=(5.2 * len(kinds) + 1.5, 0.62 * len(axes) + 1), squeeze=False
    )
    at = 0
    for row, (name, values) in zip(grid, axes.items(), strict=True):
        unit = AXES[name][2]
        for place, (title, (kind, _)) in zip(row, kinds.items(), strict=True):
            edges = np.geomspace(values[0], values[-1], len(values) + 1)
            strip = kind[at : at + len(values)][None]
            place.pcolormesh(edges, [0, 1], strip, cmap=_MAP, vmin=-0.5, vmax=3.5)
            place.set_xscale("log")
            place.xaxis.set_minor_formatter(NullFormatter())
            place.set_yticks([])
            place.tick_params(labelsize=7, pad=1)
            if at == 0:
                place.set_title(title)
        label = f"{name.replace('_', ' ')}\n[{unit}]"
        row[0].set_ylabel(label, rotation=0, ha="right", va="center", fontsize=7)
        at += len(values)
    figure.tight_layout(rect=(0, 0.03, 1, 1), h_pad=0.1)
    _legend(figure)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def draw_pairs(path: Path, pairs, side: int, begin: int, kinds: dict) -> None:
    """A map for every pair of axes, a row for every fidelity."""
    figure, grid = plt.subplots(
        len(kinds), len(pairs), figsize=(3.6 * len(pairs), 3.3 * len(kinds) + 0.5), squeeze=False
    )
    for row, (title, (kind, _)) in zip(grid, kinds.items(), strict=True):
        for n, (place, (one, other)) in enumerate(zip(row, pairs, strict=True)):
            part = kind[begin + n * side**2 :][: side**2].reshape(side, side)
            x, y = (np.geomspace(*AXES[name][:2], side + 1) for name in (one, other))
            place.pcolormesh(x, y, part.T, cmap=_MAP, vmin=-0.5, vmax=3.5)
            place.set(xscale="log", yscale="log", title=title)
            place.set_xlabel(f"{one.replace('_', ' ')} [{AXES[one][2]}]")
            place.set_ylabel(f"{other.replace('_', ' ')} [{AXES[other][2]}]")
    figure.tight_layout(rect=(0, 0.06, 1, 1))
    _legend(figure)
    figure.savefig(path, dpi=120)
    plt.close(figure)
