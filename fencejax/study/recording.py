"""Recordings of an impact: columns of numbers over time, read from a file and checked."""

import csv
import dataclasses
import io
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

SIGNALS: Mapping[str, str] = {
    "force": "N",
    "tip_deflection": "m",
    "x": "m",
    "y": "m",
    "angle": "rad",
}
"""What can be recorded, with its unit: the normal force of the fence on the parcel, the deflection
of the tip from the rigid link's line, positive where the parcel bends it, and C_s and the angle of
the parcel."""

# Units that a header may name, with their factor to the SI.
_FACTORS = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
    "N": {"N": 1.0, "kN": 1e3},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "rad": {"rad": 1.0, "deg": np.pi / 180, "mrad": 1e-3},
}
_HEADER = re.compile(r"\s*([^\[\]()]+?)\s*(?:[\[(]\s*([^\[\]()]*?)\s*[\])])?\s*")
_LEAST_ROWS = 5


@dataclasses.dataclass(frozen=True, eq=False)
class Recording:
    """Signals over time, in SI units.

    **Fields:**

    - `time`: [s] since the scene's start, rising, shape (K,).
    - `signals`: by name (see `SIGNALS`), each of shape (K,).
    - `source`: where it is from, for messages.

    Raises `ValueError` where a name is unknown, shapes differ, a number is not finite, times do
    not rise, or there are fewer than five.
    """

    time: np.ndarray
    signals: Mapping[str, np.ndarray]
    source: str = "the recording"

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
            if not np.all(np.isfinite(column)):
                row = int(np.flatnonzero(~np.isfinite(column))[0])
                raise ValueError(
                    f"{self.source}: `{name}` must be finite, but is {column[row]} in row {row}."
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


def write_recording(path: str | os.PathLike, recording: Recording) -> None:
    """Write a recording as a CSV file that `read_recording` reads."""
    titles = ["time [s]", *(f"{name} [{SIGNALS[name]}]" for name in recording.names)]
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(titles)
        for row in np.stack([recording.time, *recording.values], axis=1):
            writer.writerow([repr(float(number)) for number in row])


def read_recording(path: str | os.PathLike, names: Sequence[str] = ()) -> Recording:
    """Read a CSV file: a header, then one row of numbers a moment.

    The header names its columns as in `time [ms],force [N],tip_deflection [mm]`; without a unit a
    column is in the SI's. Known are `time` and the names of `SIGNALS`; other columns are passed
    over. Columns are separated by commas, semicolons or tabs, and numbers have a decimal point.
    Empty lines, and lines that start with #, are passed over.

    **Arguments:**

    - `path`: of the file.
    - `names`: the signals that are wanted; by default all that there are.

    Raises `ValueError` that names the file, and the line and the column, where it cannot be read, a
    column is missing, twice there, or in an unknown unit, a row has another number of fields, a
    number is none or not finite, times do not rise, or rows are too few. Raises `OSError` where
    there is no such file.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(
            f"{path}: must be text in UTF-8, but byte {error.start} is not. Save it as CSV."
        ) from error
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise ValueError(f"{path}: must hold a header and rows of numbers, but is empty.")
    first, header = lines[0]
    separator = max(",;\t", key=header.count)
    titles = _fields(path, first, header, separator)
    columns = _columns(path, first, titles)
    if "time" not in columns:
        raise ValueError(
            f"{path}, line {first}: must name a column `time [s]`, but the header is {header!r}. "
            f"Write, for example, time [s],force [N]."
        )
    present = tuple(name for name in columns if name != "time")
    wanted = tuple(names) or present
    for name in wanted:
        if name not in present:
            raise ValueError(
                f"{path}, line {first}: must name a column `{name}`, but has "
                f"{[title.strip() for title in titles]}."
            )
    if not wanted:
        raise ValueError(
            f"{path}, line {first}: must name a column of {list(SIGNALS)}, but has "
            f"{[title.strip() for title in titles]}."
        )
    numbers = {name: [] for name in ("time", *wanted)}
    last = None
    for line, row in lines[1:]:
        cells = _fields(path, line, row, separator)
        if len(cells) != len(titles):
            raise ValueError(
                f"{path}, line {line}: must have {len(titles)} columns as the header, but has "
                f"{len(cells)}."
            )
        for name, found in numbers.items():
            place, factor = columns[name]
            found.append(factor * _number(path, line, titles[place].strip(), cells[place]))
        now = numbers["time"][-1]
        if last is not None and now <= last:
            raise ValueError(
                f"{path}, line {line}, column `{titles[columns['time'][0]].strip()}`: times must "
                f"rise, but go from {last:g} to {now:g} s."
            )
        last = now
    if len(numbers["time"]) < _LEAST_ROWS:
        raise ValueError(
            f"{path}: must hold at least {_LEAST_ROWS} rows of numbers, but has "
            f"{len(numbers['time'])}."
        )
    time = np.array(numbers.pop("time"))
    return Recording(time, {name: np.array(v) for name, v in numbers.items()}, str(path))


def _fields(path: Path, line: int, text: str, separator: str) -> list[str]:
    try:
        return next(csv.reader(io.StringIO(text), delimiter=separator, strict=True))
    except csv.Error as error:
        raise ValueError(f"{path}, line {line}: cannot be read as CSV: {error}.") from error


def _columns(path: Path, line: int, titles: list[str]) -> dict[str, tuple[int, float]]:
    """Place of every known column, and the factor to its SI unit."""
    found = {}
    for place, title in enumerate(titles):
        match = _HEADER.fullmatch(title)
        name = "" if match is None else re.sub(r"[\s-]+", "_", match[1].strip().lower())
        if match is None or (name != "time" and name not in SIGNALS):
            continue
        unit = "s" if name == "time" else SIGNALS[name]
        factors = _FACTORS[unit]
        given = match[2] if match[2] is not None else unit
        if given not in factors:
            raise ValueError(
                f"{path}, line {line}, column `{title.strip()}`: the unit must be one of "
                f"{list(factors)}, but is {given!r}."
            )
        if name in found:
            raise ValueError(f"{path}, line {line}: names the column `{name}` twice.")
        found[name] = place, factors[given]
    return found


def _number(path: Path, line: int, title: str, cell: str) -> float:
    where = f"{path}, line {line}, column `{title}`"
    try:
        number = float(cell)
    except ValueError as error:
        remedy = " Write decimal points." if re.fullmatch(r"\s*-?\d+,\d+\s*", cell) else ""
        raise ValueError(f"{where}: must be a number, but is {cell.strip()!r}.{remedy}") from error
    if not np.isfinite(number):
        raise ValueError(f"{where}: must be finite, but is {cell.strip()!r}.")
    return number
