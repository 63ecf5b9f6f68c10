"""Figures of the blows before and after, and of the search."""

from pathlib import Path

import numpy as np

from fencejax.plot import COLORS, figure, legend, prepared

from ..common.files import write_figure
from ..common.report import save
from .confidence import measure_of
from .configuration import RobustConfig
from .descent import Found

_NAMES = {"force": "peak force", "g_load": "g-load F / (m g)", "drop_height": "equivalent drop"}


def _title(config: RobustConfig) -> str:
    return f"{_NAMES[config.severity]} [{config.unit}]"


def exceedance(config: RobustConfig, before, after, good, out: Path) -> None:
    """The share of parcels that are hit harder than a severity, before and after."""
    axes = prepared(None, 3.8)
    for index, (name, read) in enumerate((("paper's fence", before), ("robust design", after))):
        values = np.sort(read["severity"][good])
        share = 1 - np.arange(values.size) / values.size
        color = COLORS[index]
        axes.semilogy(values, share, color=color, label=name)
        for measure, style in (("mean", ":"), ("cvar", "--")):
            label = "mean" if measure == "mean" else f"CVaR {config.level:g}"
            axes.axvline(
                float(measure_of(values, measure, config.level)), color=color, linestyle=style,
                linewidth=1, label=f"{label}, {name}",
            )  # fmt: skip
    axes.set_xlabel(_title(config))
    axes.set_ylabel("share of parcels hit harder [1]")
    axes.set_xlim(left=0)
    legend(axes)
    save(axes, out / "exceedance.png")


def by_mass(config: RobustConfig, masses, before, after, good, out: Path) -> None:
    """The severity of every fresh parcel over its mass, before and after."""
    axes = prepared(None, 3.8)
    for index, (name, read) in enumerate((("paper's fence", before), ("robust design", after))):
        axes.scatter(
            masses[good], read["severity"][good], s=5, alpha=0.5, color=COLORS[index],
            linewidths=0, label=name,
        )  # fmt: skip
    axes.set_xscale("log")
    if config.severity != "force":
        axes.set_yscale("log")
    axes.set_xlabel("parcel mass [kg]")
    axes.set_ylabel(_title(config))
    legend(axes)
    save(axes, out / "by_mass.png")


def search(config: RobustConfig, found: Found, out: Path) -> None:
    """The measure and the violation at every evaluation."""
    drawn = figure(4.4)
    upper, lower = drawn.subplots(2, 1, sharex=True)
    prepared(upper)
    prepared(lower)
    number = np.arange(1, len(found.steps) + 1)
    upper.plot(number, [s.objective for s in found.steps], "o-", color=COLORS[1], markersize=3)
    upper.set_ylabel(f"{config.measure} [{config.unit}]")
    lower.plot(number, [s.violation for s in found.steps], "o-", color=COLORS[2], markersize=3)
    lower.set_ylabel("largest violation [1]")
    lower.set_xlabel("evaluation" if config.method == "sample" else "step, each a fresh batch")
    write_figure(out / "search.png", drawn)
