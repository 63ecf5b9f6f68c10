"""The pseudo-velocity shock spectrum of a pulse."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import ArrayLike

from . import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_GRAVITY = 9.81


def shock_spectrum(
    frequencies: ArrayLike,
    pseudo_velocity: ArrayLike | Mapping[str, ArrayLike],
    *,
    critical_load: float | None = None,
    critical_velocity_change: float | None = None,
    axes: "Axes | None" = None,
) -> "Axes":
    """Pseudo-velocity over natural frequency, both logarithmic, with lines of equal acceleration
    (falling, in g) and of equal deflection (rising, in mm).

    **Arguments:**

    - `frequencies` (k,) [Hz], above 0; `pseudo_velocity` (k,) [m/s], as of
      `fencejax.shock.pseudo_velocity_spectrum`, or several of these by name.
    - `critical_load` [1], in g, and `critical_velocity_change` [m/s]: of a product, drawn as bounds
      of the spectra of long and of short pulses.
    - `axes`: where to draw; by default a figure of page width.

    Raises `ValueError` where the shapes do not fit or a number is not above 0.

    >>> frequencies = np.geomspace(1.0, 100.0, 5)
    >>> axes = fj.plot.shock_spectrum(frequencies, 2.0 / frequencies, critical_load=60.0)
    """
    across = np.asarray(frequencies, dtype=float)
    given = pseudo_velocity if isinstance(pseudo_velocity, Mapping) else {"": pseudo_velocity}
    lines = {name: np.asarray(values, dtype=float) for name, values in given.items()}
    for name, values in lines.items():
        if across.ndim != 1 or values.shape != across.shape:
            raise ValueError(
                "Arguments `frequencies` and `pseudo_velocity` must have one shape (k,), but have "
                f"{across.shape} and {values.shape}{f' ({name})' if name else ''}."
            )
        if not (np.all(across > 0) and np.all(values > 0)):
            raise ValueError(
                "Arguments `frequencies` and `pseudo_velocity` must be above 0 for logarithmic "
                "axes, but are not."
            )
    axes = style.prepared(axes, height=3.8)
    axes.set_xscale("log")
    axes.set_yscale("log")
    for (name, values), color in zip(lines.items(), style.LINES * len(lines), strict=False):
        axes.plot(across, values, color=color, label=name or "_", linewidth=1.6)
    if critical_load is not None:
        bound = critical_load * _GRAVITY / (2 * np.pi * across)
        axes.plot(across, bound, "--", color=style.GRAY, label=f"{critical_load:g} g")
    if critical_velocity_change is not None:
        label = f"{critical_velocity_change:g} m/s"
        axes.axhline(critical_velocity_change, ls=":", color=style.GRAY, label=label)
    shown = np.concatenate(list(lines.values()))
    axes.set_xlim(across.min(), across.max())
    axes.set_ylim(shown.min() / 2, shown.max() * 2)
    _diagonals(axes, across)
    axes.set_xlabel("natural frequency [Hz]")
    axes.set_ylabel("pseudo-velocity [m/s]")
    if any(lines) or critical_load is not None or critical_velocity_change is not None:
        style.legend(axes)
    return axes


def _diagonals(axes: "Axes", across: np.ndarray) -> None:
    """Lines of equal acceleration, v = a / omega, and of equal deflection, v = omega z, a decade
    apart, with their values where they enter the axes."""
    low, high = axes.get_ylim()
    ends = 2 * np.pi * np.array([across.min(), across.max()])
    kinds = (
        (lambda unit: unit * _GRAVITY / ends, _GRAVITY, lambda v, w: v * w, "g"),
        (lambda unit: unit * 1e-3 * ends, 1e-3, lambda v, w: v / w, "mm"),
    )
    for line, size, value, unit in kinds:
        corners = [value(v, w) / size for v in (low, high) for w in ends]
        first, last = np.floor(np.log10(min(corners))), np.ceil(np.log10(max(corners)))
        for power in np.arange(first, last + 1):
            speeds = line(10.0**power)
            axes.plot(ends / (2 * np.pi), speeds, color=style.GRID, linewidth=0.7, zorder=0)
            # Within the axes at a third, for deflections at two thirds, of their height.
            target = low * (high / low) ** (0.3 if unit == "g" else 0.75)
            at = 10.0**power * size / target if unit == "g" else target / (10.0**power * size)
            if ends[0] * 1.2 < at < ends[1] / 1.5:
                axes.text(
                    at / (2 * np.pi), target, f"{10.0**power:g} {unit}", fontsize="x-small",
                    color=style.GRAY, ha="center", va="center", zorder=1, clip_on=True,
                    bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
                )  # fmt: skip
