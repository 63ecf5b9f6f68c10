"""Figures of the identification: recording and fit, residuals, correlation of the estimates."""

from typing import TYPE_CHECKING

import numpy as np

from fencejax.plot import style
from fencejax.study import SIGNALS, Experiment, Fit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SHOWN = {"N": (1.0, "N"), "m": (1e3, "mm"), "rad": (1.0, "rad")}


def _figure(width: float, height: float) -> "Figure":
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def _label(name: str) -> tuple[float, str]:
    factor, unit = _SHOWN[SIGNALS[name]]
    return factor, f"{name.replace('_', ' ')} [{unit}]"


def fit(experiment: Experiment, fitted: np.ndarray, noise: dict[str, float]) -> "Figure":
    """One experiment: above, recording and fit of every signal; below, their residuals with the
    band of two standard deviations."""
    recording = experiment.recording
    time = 1e3 * np.asarray(recording.time)
    count = len(recording.names)
    figure = _figure(1.4 + 4.3 * count, 5.2)
    panels = figure.subplots(2, count, sharex=True, squeeze=False, height_ratios=(2, 1))
    for column, name in enumerate(recording.names):
        upper, lower = panels[:, column]
        factor, label = _label(name)
        measured = factor * np.asarray(recording.signals[name])
        modelled = factor * fitted[column]
        style.prepared(upper)
        style.prepared(lower)
        first = column == 0
        upper.plot(
            time, measured, "o", color=style.GRAY, markersize=2.6,
            label="recording" if first else None,
        )  # fmt: skip
        upper.plot(
            time, modelled, color=style.RED, linewidth=1.5, label="fit" if first else None
        )
        upper.set_ylabel(label)
        band = 2 * factor * noise[name]
        lower.axhspan(
            -band, band, color=style.BLUE, alpha=0.15, linewidth=0, zorder=0,
            label="two standard deviations" if first else None,
        )  # fmt: skip
        lower.plot(time, measured - modelled, "o", color=style.BLUE, markersize=2.6,
                   label="recording less fit" if first else None)  # fmt: skip
        lower.axhline(0, color="black", linewidth=0.7)
        lower.set_ylabel(f"residual {label[label.rindex('['):]}")
        lower.set_xlabel("time since the first contact [ms]")
    figure.legend(loc="outside upper left", ncols=4, frameon=False, fontsize="small")
    return figure


def correlation(found: Fit) -> "Figure":
    """Correlation of the estimates, as a table in colours."""
    names = [name.replace("_", " ") for name in found.names]
    size = 1.9 + 0.75 * len(names)
    figure = _figure(size + 1.2, size)
    axes = figure.subplots()
    image = axes.imshow(found.correlation, cmap=style.SIGNED_MAP, vmin=-1, vmax=1)
    for i, row in enumerate(found.correlation):
        for j, value in enumerate(row):
            color = "white" if abs(value) > 0.6 else "black"
            axes.text(
                j, i, f"{value:+.2f}", ha="center", va="center", color=color, fontsize="small"
            )
    axes.set_xticks(range(len(names)), names, rotation=40, ha="right")
    axes.set_yticks(range(len(names)), names)
    bar = figure.colorbar(image, ax=axes, shrink=0.8)
    bar.set_label("correlation of the estimates [1]")
    axes.set_title(f"condition {found.condition:.3g}", loc="left", fontsize="medium")
    return figure
