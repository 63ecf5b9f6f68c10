"""Recordings of an impact: columns of numbers over time, checked."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

SIGNALS: Mapping[str, str] = {
    "force": "N",
    "tip_deflection": "m",
    "x": "m",
    "y": "m",
    "angle": "rad",
}
"""The signals that can be recorded, with their units: the normal force of the fence on the parcel,
the deflection of the tip from the rigid link's line, positive in the direction in which the parcel
bends it, and the coordinates of C_s and the angle of the parcel."""

_LEAST_ROWS = 5


@dataclasses.dataclass(frozen=True, eq=False)
class Recording:
    """Signals over time, in SI units.

    **Fields:**

    - `time`: [s], rising, shape (K,): since the scene's start, or by a clock of its own (see
      `fencejax.study.align`).
    - `signals`: by name (see `SIGNALS`), each of shape (K,); NaN where a sample is missing.
    - `source`: its origin, for messages.
    - `untimed`: the number of rows without a time, which were left out.

    Raises `ValueError` where a name is unknown, shapes differ, a number is infinite, times are
    missing or do not rise, or a signal has fewer than five samples.
    """

    time: np.ndarray
    signals: Mapping[str, np.ndarray]
    source: str = "the recording"
    untimed: int = 0

    def __post_init__(self):
        time = np.asarray(self.time, dtype=float)
        signals = {name: np.asarray(v, dtype=float) for name, v in self.signals.items()}
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "signals", signals)
        if not signals:
            raise ValueError(f"{self.source}: must hold a signal of {list(SIGNALS)}, but has none.")
        if time.ndim != 1 or time.size < _LEAST_ROWS:
            raise ValueError(
                f"{self.source}: must hold at least {_LEAST_ROWS} rows, but has the shape "
                f"{time.shape}."
            )
        for name, column in {"time": time, **signals}.items():
            if name != "time" and name not in SIGNALS:
                raise ValueError(
                    f"{self.source}: signals must be of {list(SIGNALS)}, but one is {name!r}."
                )
            if column.shape != time.shape:
                raise ValueError(
                    f"{self.source}: `{name}` must have the shape {time.shape} of the times, but "
                    f"has {column.shape}."
                )
            bad = ~np.isfinite(column) if name == "time" else np.isinf(column)
            if np.any(bad):
                row = int(np.flatnonzero(bad)[0])
                raise ValueError(
                    f"{self.source}: `{name}` must be finite, but is {column[row]} in row {row}."
                )
            if np.sum(np.isfinite(column)) < _LEAST_ROWS:
                raise ValueError(
                    f"{self.source}: `{name}` must hold at least {_LEAST_ROWS} samples, but has "
                    f"{np.sum(np.isfinite(column))}."
                )
        steps = np.diff(time)
        if np.any(steps <= 0):
            row = int(np.flatnonzero(steps <= 0)[0]) + 1
            raise ValueError(
                f"{self.source}: times must rise, but go from {time[row - 1]:g} to {time[row]:g} s "
                f"in row {row}."
            )

    @property
    def names(self) -> tuple[str, ...]:
        """The signals' names, in order."""
        return tuple(self.signals)

    @property
    def values(self) -> np.ndarray:
        """The signals, of shape (signals, K)."""
        return np.stack(list(self.signals.values()))

    @property
    def present(self) -> np.ndarray:
        """Where there is a sample, of shape (signals, K)."""
        return np.isfinite(self.values)

    @property
    def missing(self) -> dict[str, int]:
        """How many samples are missing, by signal; those with none are left out."""
        found = {name: int(np.sum(np.isnan(column))) for name, column in self.signals.items()}
        return {name: count for name, count in found.items() if count}

    def within(self, start: float, end: float) -> "Recording":
        """The rows from a time to another [s].

        Raises `ValueError` where too few are left.
        """
        kept = (self.time >= start) & (self.time <= end)
        signals = {name: column[kept] for name, column in self.signals.items()}
        return dataclasses.replace(self, time=self.time[kept], signals=signals)

    def chosen(self, names: Sequence[str]) -> "Recording":
        """The same with some of its signals.

        Raises `ValueError` for one that it does not have.
        """
        for name in names:
            if name not in self.signals:
                raise ValueError(
                    f"{self.source}: must hold the signal {name!r}, but has {list(self.signals)}."
                )
        return dataclasses.replace(self, signals={n: self.signals[n] for n in names})
