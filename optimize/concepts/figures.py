"""Figures of the fronts of all concepts, with torque and mass."""

from pathlib import Path

import numpy as np

from fencejax.plot import COLORS, figure as new_figure, legend_above, panel

from ..common.files import write_figure
from . import words
from .outcome import Outcome
from .problem import mass, torque
from .quantities import FORCE, LOAD
from .search import Point

_MARKS = ("o-", "s--", "^:")


def fronts(outcome: Outcome, out: Path) -> None:
    """Force, acceleration, torque and mass over parcels an hour, a line a concept. Designs that
    break a limit are crosses off the line; unconfirmed ones have hollow marks."""
    figure = new_figure(6.4)
    places = figure.subplots(2, 2, sharex=True)
    (first, second), (third, fourth) = places
    shown = [
        (first, "least force", "worst peak force [N]", FORCE, lambda p: p.worst(FORCE.name)),
        (second, "least acceleration", "worst peak acceleration [g]", LOAD,
         lambda p: p.worst(LOAD.name)),
        (third, "torque of the least-force design", "largest drive torque [N m]", FORCE,
         lambda p: torque(p.values)),
        (fourth, "mass of the least-force design", "mass of the fence [kg]", FORCE,
         lambda p: mass(p.values)),
    ]  # fmt: skip
    if not outcome.config.load:
        second.remove()
        del shown[1]
    for each, title, label, minimised, read in shown:
        panel(each, "parcels an hour [1/h]" if each in places[1] else "", label, title)
        for index, concept in enumerate(outcome.config.read):
            color = COLORS[index % len(COLORS)]
            mark = _MARKS[index // len(COLORS) % len(_MARKS)]
            points = words.stacked(outcome, concept, minimised.name)
            _line(each, points, read, color, mark, concept.title)
        each.set_ylim(bottom=0)
    legend_above(first, columns=3)
    write_figure(out / "concepts.png", figure)


def _line(axes, points: list[Point], read, color: str, mark: str, title: str) -> None:
    """One concept: the line through its feasible designs, interrupted where there is none."""
    rates = np.array([p.rate for p in points])
    values = np.array([read(p) for p in points])
    feasible = np.array([p.feasible for p in points])
    sure = np.array([p.confirmed for p in points])
    axes.plot(
        rates, np.where(feasible, values, np.nan), mark[1:], color=color, linewidth=1.3
    )
    # One entry in the legend, whichever marks are drawn.
    axes.plot([], [], mark, color=color, markersize=4, label=title)
    drawn = (
        (sure, mark[0], dict(color=color)),
        (feasible & ~sure, mark[0], dict(markerfacecolor="white", markeredgecolor=color)),
        (~feasible & np.isfinite(values), "x", dict(color=color)),
    )
    for which, kind, look in drawn:
        axes.plot(rates[which], values[which], kind, linestyle="none", markersize=4, **look)
