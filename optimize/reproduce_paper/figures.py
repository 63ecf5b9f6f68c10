"""The figures: the panels of Figs. 8-11 of the paper, and the sensitivities it could not give."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import fencejax as fj
from fencejax.plot import legend_above, panel, style

from ..common.files import write_figure
from . import fences
from .case import lane
from .cycle import Cycle, Stiff, first_and_last
from .maps import Maps
from .sensitivity import VARIABLES, Sensitivities
from .statements import BELT_WIDTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLORS = style.LINES[:2]
_STYLES = ("-", "--")
_PAGE = 6.9
_UNSOUND = "the corner runs over the tip (or the beam bends too far for a linear one)"
_PLATE = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6}


def _figure(height: float) -> "Figure":
    return style.figure(height, _PAGE)


def _points(axes: "Axes", cycle: Cycle, values, across=None, offsets=((5, 5), (5, -11))) -> None:
    """Mark the first and the last contact of both fences; number them once."""
    for index in range(len(fences.NAMES)):
        picks = first_and_last(lane(cycle, index))
        x = np.asarray(cycle.time if across is None else across)[index]
        y = np.asarray(values)[index]
        for number, pick in enumerate(picks):
            axes.plot(
                x[pick], y[pick], "os"[index], color=_COLORS[index], markerfacecolor="white",
                markersize=4.5, zorder=5,
            )  # fmt: skip
            if index == 0:
                axes.annotate(
                    str(number + 1), (x[pick], y[pick]), offsets[number], fontsize="small",
                    textcoords="offset points", fontweight="bold", zorder=6, bbox=_PLATE,
                )  # fmt: skip


def _lines(axes: "Axes", x, y, factor: float = 1.0) -> None:
    for index, name in enumerate(fences.NAMES):
        axes.plot(
            np.asarray(x)[index], factor * np.asarray(y)[index], _STYLES[index],
            color=_COLORS[index], linewidth=1.4, label=name,
        )  # fmt: skip


def _path(axes: "Axes", cycle: Cycle, parcel: fj.Parcel) -> None:
    axes.axhspan(0.0, BELT_WIDTH, color=style.PALE, zorder=0, linewidth=0)
    axes.axhline(0.0, color="black", linewidth=1.2)
    axes.axhline(BELT_WIDTH, color="black", linewidth=0.8, linestyle=":")
    first = lane(cycle, 0)
    corners = np.array([[float(v) for v in parcel.corner(k)] for k in (1, 2, 3, 4, 1)])
    reach = fences.REACH
    for pick in (*first_and_last(first), int(np.argmax(first.drive_angle))):
        turn = float(first.drive_angle[pick])
        axes.plot(
            [0, reach * np.cos(turn)], [0, reach * np.sin(turn)], color=style.GRAY, alpha=0.6,
            zorder=1,
        )  # fmt: skip
    for pick in first_and_last(first):
        cosine, sine = np.cos(float(first.angle[pick])), np.sin(float(first.angle[pick]))
        axes.plot(
            float(first.x[pick]) + cosine * corners[:, 0] - sine * corners[:, 1],
            float(first.y[pick]) + sine * corners[:, 0] + cosine * corners[:, 1],
            color=style.BLUE, alpha=0.45, linewidth=0.8, zorder=1,
        )  # fmt: skip
    _lines(axes, cycle.x, cycle.y)
    _points(axes, cycle, cycle.y, cycle.x, ((-10, 4), (-10, 4)))
    axes.set_aspect("equal", adjustable="box")
    low = min(-0.05, np.asarray(cycle.x)[:, 0].min() - 0.25)
    axes.set_xlim(low, low + 1.65)
    axes.set_ylim(-0.1, 1.15)


def cycle_figure(
    cycle: Cycle, parcel: fj.Parcel, stiff: Stiff | None, rigid: Cycle | None
) -> "Figure":
    """Fig. 8 or 11: (a) path of C_s over the conveyor, (b) tip deflection over the cycle, (c) N and
    N_stiff over N_max, (d) belt friction F_1; points 1 and 2, first and last contact, in each.

    N_stiff is that of a rigid obstacle (`stiff`), from the first contact on, or, where there is no
    impact, of the same sort by an undeformable fence (`rigid`).
    """
    figure = _figure(5.6)
    (a, b), (c, d) = figure.subplots(2, 2)
    panel(a, "x along the belt [m]", "y across the belt [m]", "(a)")
    _path(a, cycle, parcel)
    panel(b, "time t [s]", "tip deflection, pushed back [mm]", "(b)")
    _lines(b, cycle.time, cycle.deflection, 1e3)
    _points(b, cycle, 1e3 * np.asarray(cycle.deflection), None, ((-11, 6), (9, -13)))
    largest = np.asarray(cycle.peak_force)[:, None]
    panel(c, "time t [s]", r"$N / N_{max}$,  $N_{stiff} / N_{max}$ [1]", "(c)")
    _lines(c, cycle.time, np.asarray(cycle.force) / largest)
    picks = [first_and_last(lane(cycle, i)) for i in range(len(fences.NAMES))]
    begin, end = (float(np.asarray(cycle.time)[0, pick]) for pick in picks[0])
    if stiff is not None:
        since = np.asarray(stiff.time)[0] + begin
        c.plot(
            since, np.asarray(stiff.force)[0] / largest[0], color=style.INK, linewidth=1.2,
            linestyle=(0, (1, 1)), label="rigid obstacle", zorder=4,
        )  # fmt: skip
    if rigid is not None:
        c.plot(
            np.asarray(rigid.time)[0], np.asarray(rigid.force)[0] / largest[0], color=style.INK,
            linewidth=1.2, linestyle=(0, (1, 1)), label="undeformable fence", zorder=4,
        )  # fmt: skip
    _points(c, cycle, np.asarray(cycle.force) / largest, None, ((-9, 4), (3, 5)))
    margin = 0.15 * (end - begin)
    c.set_xlim(begin - margin, end + margin)
    c.set_ylim(bottom=0)
    panel(d, "time t [s]", r"belt friction $|F_1|$ [N]", "(d)")
    _lines(d, cycle.time, cycle.belt_force)
    d.axhline(
        float(np.asarray(cycle.hold)[0]), color="black", linewidth=0.8, linestyle=":",
    )  # fmt: skip
    d.annotate(
        r"$\mu_{1s} m_p g$", (1.0, float(np.asarray(cycle.hold)[0])), (-2, 2), fontsize="small",
        xycoords=("axes fraction", "data"), textcoords="offset points", ha="right",
    )  # fmt: skip
    _points(d, cycle, cycle.belt_force)
    d.set_ylim(0, 1.15 * float(np.asarray(cycle.hold)[0]))
    legend_above(c, 3)
    return figure


def map_figure(maps: Maps, quantity: str) -> "Figure":
    """Fig. 9 (`quantity` "force", N_stiff,max / N_max) or Fig. 10 ("tip", tip deflection [mm]) over
    (m_p, R), one panel a fence.

    Hatched: the corner runs over the tip, or the beam bends beyond what a linear one holds for.
    """
    drawn, label = {
        "force": (maps.ratio, r"$N_{stiff,max} / N_{max}$ [1]"),
        "tip": (1e3 * maps.tip, "tip deflection [mm]"),
    }[quantity]
    shown = np.where(maps.sound, drawn, np.nan)
    top = float(np.nanmax(shown))
    step = 0.25 if quantity == "force" else 10.0
    lowest = np.floor(float(np.nanmin(shown)) / step) * step
    levels = np.arange(lowest, top + step, step)
    figure = _figure(3.7)
    panels = figure.subplots(1, len(fences.NAMES), sharey=True)
    for index, (axes, name) in enumerate(zip(panels, fences.NAMES, strict=True)):
        mass = "" if index else r"parcel mass $m_p$ [kg]"
        panel(axes, "place of the first contact R [m]", mass, f"({'ab'[index]})")
        axes.set_title(name, fontsize="small")
        filled = axes.contourf(
            maps.distances, maps.masses, shown[index], levels=levels, cmap=style.MAP
        )
        lines = axes.contour(
            maps.distances, maps.masses, shown[index], levels=levels[::2], colors="white",
            linewidths=0.6,
        )  # fmt: skip
        axes.clabel(lines, fontsize="x-small", fmt="%g")
        if not np.all(maps.sound[index]):
            axes.contourf(
                maps.distances, maps.masses, (~maps.sound[index]).astype(float),
                levels=[0.5, 1.5], colors=[style.EMPTY], hatches=["////"],
            )  # fmt: skip
        if index == 0:
            axes.axvline(fences.JOINT, color="white", linewidth=1.2, linestyle="--")
            axes.annotate(
                "joint", (fences.JOINT, maps.masses[-1]), (3, -9), fontsize="x-small",
                textcoords="offset points", color="white",
            )  # fmt: skip
        if index == 1:
            bar = figure.colorbar(filled, ax=list(panels), shrink=0.95)
            bar.set_label(label, fontsize="small")
            bar.ax.tick_params(labelsize="small")
    if not np.all(maps.sound):
        figure.legend(
            handles=[style.hatched_patch(_UNSOUND)], loc="outside lower center", frameon=False,
            fontsize="small",
        )  # fmt: skip
    return figure


def sensitivity_figure(found: Sensitivities) -> "Figure":
    """N_max and its sensitivities over R: elasticities d ln N_max / d ln p, and
    d ln N_max / d(l_s / l_p) at constant reach."""
    figure = _figure(6.2)
    panels = figure.subplots(3, 2, sharex=True).ravel()
    place = "place of the first contact R [m]"
    across = np.broadcast_to(found.distances, found.force.shape)
    first = panel(panels[0], "", r"$N_{max}$ [N]", "(a)")
    _lines(first, across, found.force)
    first.set_ylim(bottom=0)
    for index, (words, symbol) in enumerate(VARIABLES.values()):
        axes = panels[index + 1]
        plain = words == "length ratio"
        below = f"d({symbol})" if plain else rf"d\,\ln {symbol}"
        slope = rf"$d\,\ln N_{{max}} \,/\, {below}$ [1]"
        panel(axes, place if index >= 3 else "", slope, f"({'bcdef'[index]})")
        axes.set_title(words, fontsize="small")
        axes.axhline(0.0, color="black", linewidth=0.8)
        _lines(axes, across, found.slope[..., index])
    for axes in panels:
        axes.axvline(fences.JOINT, color=style.GRAY, linewidth=0.8, linestyle=":")
    legend_above(first, 2)
    return figure


def save(figures: dict[str, "Figure"], folder: Path) -> None:
    """Write every figure into `folder` as a PNG of its name."""
    for name, figure in figures.items():
        write_figure(folder / f"{name}.png", figure)
