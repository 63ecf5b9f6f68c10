"""Recordings of an impact in files: text of several dialects, read into columns and checked.

>>> recorded = fj.recording.Recording(np.linspace(0, 0.1, 5), {"force": np.zeros(5)})
>>> recorded.signals["force"].shape
(5,)
"""

import csv
import difflib
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .._text import Rows, key, name_and_unit
from .recorded_signals import SIGNALS as SIGNALS, Recording as Recording

# Units that a header may name, with their factor to the SI.
_FACTORS = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "\u00b5s": 1e-6, "\u03bcs": 1e-6},
    "N": {"N": 1.0, "kN": 1e3},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "rad": {"rad": 1.0, "deg": np.pi / 180, "\u00b0": np.pi / 180, "mrad": 1e-3},
}
# Texts for a missing sample.
_MISSING = {"", "-", "--", "nan", "na", "n/a", "null", "none"}
# A number with a decimal comma, points between its thousands or none.
_WITH_COMMA = re.compile(r"[+-]?(?:\d{1,3}(?:\.\d{3})+|\d*),\d*(?:[eE][+-]?\d+)?")


def write_recording(path: str | os.PathLike, recording: Recording) -> None:
    """Write a recording as a CSV file that `read_recording` reads; a missing sample is empty.

    >>> recorded = fj.study.Recording(np.linspace(0, 0.1, 5), {"force": np.zeros(5)})
    >>> fj.recording.write_recording("still.csv", recorded)
    """
    titles = ["time [s]", *(f"{name} [{SIGNALS[name]}]" for name in recording.names)]
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(titles)
        for row in np.stack([recording.time, *recording.values], axis=1):
            writer.writerow(["" if np.isnan(n) else repr(float(n)) for n in row])


class _Column(NamedTuple):
    """Place and title of a column, its unit in the SI, and the factor to it."""

    place: int
    title: str
    unit: str
    factor: float


class _File(Rows):
    """The rows of a file, and the columns of time and signals in it."""

    def columns(self, named: Mapping[str, str]) -> dict[str, _Column]:
        """The columns of time and signals, by the titles in `named` or by their own names."""
        where = f"{self.path}, line {self.first}"
        found: dict[str, _Column] = {}
        for name, title in named.items():
            if name != "time" and name not in SIGNALS:
                raise ValueError(
                    f"Argument `columns` must name columns of time and {', '.join(SIGNALS)}, but "
                    f"names one of {name!r}."
                )
            places = [k for k, each in enumerate(self.titles) if _same(each, title)]
            if len(places) != 1:
                near = difflib.get_close_matches(title, self.titles, 1, 0.5)
                meant = f" Did you mean {near[0]!r}?" if near and not places else ""
                raise ValueError(
                    f"{where}: must have one column {title!r} for `{name}`, but has "
                    f"{self.titles}.{meant}"
                )
            found[name] = self._column(places[0], name)
        for place, title in enumerate(self.titles):
            name = key(title)
            if name in named or (name != "time" and name not in SIGNALS):
                continue
            if name in found:
                raise ValueError(f"{where}: names the column `{name}` twice.")
            found[name] = self._column(place, name)
        return found

    def _column(self, place: int, name: str) -> _Column:
        title, unit = self.titles[place], "s" if name == "time" else SIGNALS[name]
        given = name_and_unit(title)[1]
        where = f"{self.path}, line {self.first}, column `{title}`"
        return _Column(place, title, unit, _factor(where, unit if given is None else given, unit))

    def in_units(self, columns: Mapping[str, _Column]) -> dict[str, _Column]:
        """The columns with the units from a line of units under the header, if there is one; that
        line is then removed from the rows."""
        if not self.rows:
            return dict(columns)
        line, cells = self.rows[0]
        units = {name: cells[c.place].strip().strip("[]()").strip() for name, c in columns.items()}
        if not all(unit in _FACTORS[columns[name].unit] for name, unit in units.items()):
            return dict(columns)
        self.rows = self.rows[1:]
        return {
            name: c._replace(factor=_factor(f"{self.path}, line {line}", units[name], c.unit))
            for name, c in columns.items()
        }

    def numbers(self, column: _Column, commas: bool) -> np.ndarray:
        """A column's numbers in the SI, NaN where one is missing."""
        return column.factor * np.array([
            self._number(line, column.title, cells[column.place].strip(), commas)
            for line, cells in self.rows
        ])  # fmt: skip

    def _number(self, line: int, title: str, cell: str, commas: bool) -> float:
        if cell.lower() in _MISSING:
            return np.nan
        where = f"{self.path}, line {line}, column `{title}`"
        text = cell
        if commas and "," in cell:
            text = cell.replace(".", "").replace(",", ".") if _WITH_COMMA.fullmatch(cell) else cell
        elif commas and "." in cell:
            raise ValueError(
                f"{where}: must be written as the other numbers, with a decimal comma, but is "
                f"{cell!r}."
            )
        try:
            number = float(text)
        except ValueError as error:
            raise ValueError(f"{where}: must be a number, but is {cell!r}.") from error
        if not np.isfinite(number):
            raise ValueError(f"{where}: must be finite, but is {cell!r}.")
        return number

    def has_commas(self, columns: Mapping[str, _Column]) -> bool:
        """Whether a number has a decimal comma."""
        cells = (row[c.place].strip() for _, row in self.rows for c in columns.values())
        return any(_WITH_COMMA.fullmatch(cell) for cell in cells)


def read_recording(
    path: str | os.PathLike, names: Sequence[str] = (), columns: Mapping[str, str] | None = None
) -> Recording:
    """Read a text file of columns: a header, then one row a moment.

    The header names its columns as in `time [ms],force [N],tip_deflection [mm]`. Units may be in a
    line of their own below the header; a column without a unit is in the SI unit. The columns read
    are `time`, the names of `SIGNALS`, and those named by `columns`; others are ignored. Columns
    are separated by commas, semicolons or tabs; numbers have a decimal point or, unless commas
    separate the columns, a decimal comma. Empty lines and lines that start with # are ignored. An
    empty or `NaN` sample is missing (`Recording.missing`), and a row without a time is left out.

    **Arguments:**

    - `path`: of the file, in UTF-8, UTF-16 or the Windows encoding of western Europe.
    - `names`: the signals to read; by default all in the file.
    - `columns`: titles of columns with other names, `{"time": "Zeit", "force": "Kraft"}`, with or
      without the unit.

    Raises `ValueError` that names the file, and the line and the column, where it cannot be read, a
    column is missing, twice there, or in an unknown unit, a row has another number of fields, a
    number is none or infinite, times do not rise, or samples are too few. Raises `OSError` where
    there is no such file.

    >>> rows = ["time [ms],force [N]", *(f"{k},{9 * k}" for k in range(5))]
    >>> with open("blow.csv", "w") as file:
    ...     print(*rows, sep=chr(10), file=file)
    >>> recorded = fj.recording.read_recording("blow.csv")
    >>> recorded.time, recorded.signals["force"]
    (array([0.   , 0.001, 0.002, 0.003, 0.004]), array([ 0.,  9., 18., 27., 36.]))
    """
    path = Path(path)
    file = _File(path)
    found = file.columns(columns or {})
    where = f"{path}, line {file.first}"
    if "time" not in found:
        raise ValueError(
            f"{where}: must name a column `time [s]`, but the header is {file.header!r}. Write "
            "columns={\"time\": its title}, or change the header."
        )
    present = tuple(name for name in found if name != "time")
    wanted = tuple(names) or present
    for name in wanted:
        if name not in present:
            raise ValueError(f"{where}: must name a column `{name}`, but has {file.titles}.")
    if not wanted:
        raise ValueError(
            f"{where}: must name a column of {list(SIGNALS)}, but has {file.titles}. Write "
            "columns={\"force\": its title}, or change the header."
        )
    chosen = file.in_units({name: found[name] for name in ("time", *wanted)})
    commas = file.separator != "," and file.has_commas(chosen)
    read = {name: file.numbers(column, commas) for name, column in chosen.items()}
    time = read.pop("time")
    timed = np.isfinite(time)
    kept = np.flatnonzero(timed)
    falls = np.flatnonzero(np.diff(time[kept]) <= 0)
    if falls.size:
        before, after = (float(time[kept[falls[0] + k]]) for k in (0, 1))
        raise ValueError(
            f"{path}, line {file.rows[kept[falls[0] + 1]][0]}, column `{chosen['time'].title}`: "
            f"times must rise, but go from {before:g} to {after:g} s."
        )
    signals = {name: column[timed] for name, column in read.items()}
    return Recording(time[timed], signals, str(path), int(np.sum(~timed)))


def _same(title: str, given: str) -> bool:
    """Whether a title is the one given, with or without its unit."""
    return given.strip().lower() in (title.lower(), name_and_unit(title)[0].lower())


def _factor(where: str, given: str, unit: str) -> float:
    factors = _FACTORS[unit]
    if given not in factors:
        raise ValueError(
            f"{where}: the unit must be one of {list(factors)}, but is {given!r}."
        )
    return factors[given]
