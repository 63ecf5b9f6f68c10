"""The front beside its physical bound, and the designs along it."""

import math
from pathlib import Path

import numpy as np

from fencejax.plot import COLORS, figure as new_figure, prepared
from fencejax.printing import multiple

from ..common.files import write_figure
from .problem import Tradeoff
from .trace import Point


def front(tradeoff: Tradeoff, points: list[Point], good, least, start, out: Path) -> None:
    """Worst peak force over the other quantity: the front, the other points, the bound."""
    size, unit = multiple(max(p.other for p in points), tradeoff.quantity.unit)
    factor = 1 / size
    figure = new_figure(4.4)
    axes = prepared(figure.subplots())
    other = factor * np.array([p.other for p in points])
    force = np.array([p.force for p in points])
    order = np.argsort(other)
    kept = [i for i in order if good[i]]
    axes.plot(other[kept], force[kept], "o-", color=COLORS[1], label="front")
    rest = [i for i in order if not good[i]]
    if rest:
        axes.plot(
            other[rest], force[rest], "x", color=COLORS[0], label="dominated or infeasible"
        )
    finer = [i for i in kept if points[i].finer is not None]
    if finer:
        axes.plot(
            [factor * points[i].finer.other for i in finer],  # type: ignore[union-attr]
            [points[i].finer.force for i in finer],  # type: ignore[union-attr]
            "+", color="black", label=f"same designs, {tradeoff.config.verify}",
        )  # fmt: skip
    axes.plot(
        other[kept], np.asarray(least)[kept], "--", color=COLORS[2],
        label="stop at a constant force over each design's travel",
    )  # fmt: skip
    axes.plot(
        [factor * start.other], [start.force], "s", color=COLORS[3], label="paper's fence"
    )
    axes.set_xlabel(f"{tradeoff.quantity.name.replace('_', ' ')} [{unit}]")
    axes.set_ylabel("worst peak force [N]")
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False, fontsize="small")
    write_figure(out / "front.png", figure)


def designs(tradeoff: Tradeoff, points: list[Point], good, out: Path) -> None:
    """Every variable over the other quantity, its bounds as dotted lines."""
    size, unit = multiple(max(p.other for p in points), tradeoff.quantity.unit)
    factor = 1 / size
    kept = sorted((p for p, g in zip(points, good, strict=True) if g), key=lambda p: p.other)
    variables = tradeoff.space.variables
    rows = math.ceil(len(variables) / 2)
    figure = new_figure(0.4 + 2.0 * rows)
    every = figure.subplots(rows, 2, sharex=True, squeeze=False).ravel()
    for index, (axes, variable) in enumerate(zip(every, variables, strict=False)):
        prepared(axes)
        values = [p.values[index] for p in kept]
        axes.plot([factor * p.other for p in kept], values, "o-", color=COLORS[1], markersize=4)
        for end in (variable.lower, variable.upper):
            axes.axhline(end, color="black", linestyle=":", linewidth=1)
        axes.set_ylabel(f"{variable.name.replace('_', ' ')} [{variable.unit}]")
        if index >= len(variables) - 2:
            axes.tick_params(labelbottom=True)
            axes.set_xlabel(f"{tradeoff.quantity.name.replace('_', ' ')} [{unit}]")
    for axes in every[len(variables):]:
        axes.remove()
    write_figure(out / "designs.png", figure)
