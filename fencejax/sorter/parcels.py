"""The parcels of a sorter and their places on the belt: lists, files and distributions."""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .. import _check, printing
from .._check import Bounds
from .._text import Rows, key, name_and_unit
from ..parts import Parcel
from ..printing import Readable, shown
from ..scenes import OnBelt
from .amounts import amount, refuse_unknown
from .reading import Reading, Table

PLACES: Mapping[str, Bounds] = OnBelt.bounds
"""Where a parcel is when the drive starts: see `fencejax.scenes.whole_sort`."""
FIELDS: Mapping[str, Bounds] = {**Parcel.bounds, **PLACES}
"""Every number of a parcel and its place."""
_START = {"front": 0.1, "offset": 0.0, "angle": 0.0}
_WEIGHT = Bounds(least=0, size=1.0)
_SETTINGS = ("list", "file", "count", "seed", "corners")
PATHS: Mapping[str, str] = {
    **{name: f"parcel.{name}" for name in Parcel.bounds},
    "inertia": "parcel.given_inertia",
    **{name: f"start.{name}" for name in PLACES},
}
"""The path of each of them in a scene."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Parcels(Readable):
    """The parcels that are sorted, one a lane.

    **Fields:**

    - `columns`: the values [SI] of each given number, of shape (P,), by its path in a scene.
    - `weights`: the frequency of each parcel, of shape (P,), with the sum 1.
    - `corners`: the parcel's corners that can touch the fence.
    - `origins`: where a list or a file has each value, `"parcels.csv:3.mass"`, by the paths of the
      numbers that come from it.
    """

    columns: dict[str, np.ndarray]
    weights: np.ndarray
    corners: tuple[int, ...]
    origins: Mapping[str, tuple[str, ...]] = dataclasses.field(default_factory=dict)

    @property
    def count(self) -> int:
        """The number of parcels."""
        return self.weights.size

    @property
    def given(self) -> frozenset[str]:
        """The names of all given numbers."""
        return frozenset(name for name, path in PATHS.items() if path in self.columns)

    def origin(self, path: str, lane: int) -> str:
        """A parcel's number as its user knows it: `"parcels.mass"`, `"parcels.csv:3.mass"`."""
        if path in self.origins:
            return self.origins[path][lane]
        return f"parcels.{path.rpartition('.')[2].removeprefix('given_')}"

    def _printed(self) -> printing.Table:
        rows = []
        for path, column in self.columns.items():
            name = path.rpartition(".")[2].removeprefix("given_")
            ends = [shown(end, FIELDS[name].unit) for end in (column.min(), column.max())]
            rows.append((name, " ... ".join(dict.fromkeys(ends))))
        return printing.Table(f"{self.count} parcels and places", tuple(rows))

    def text(self, lane: int) -> str:
        """A parcel by the numbers that differ between parcels: `"30 kg, offset 0.2 m"`."""
        parts = []
        for path, values in self.columns.items():
            name = path.rpartition(".")[2]
            if name == "mass" or np.ptp(values) > 0:
                unit = FIELDS["inertia" if name == "given_inertia" else name].unit
                title = "" if name == "mass" else f"{name} "
                parts.append(f"{title}{values[lane]:.4g} {unit}")
        return ", ".join(parts)


# ---- distributions, each with its numbers: True for numbers with the unit of the distributed one

_KINDS: Mapping[str, Mapping[str, bool]] = {
    "uniform": {"lower": True, "upper": True},
    "logarithmic": {"lower": True, "upper": True},
    "normal": {"mean": True, "deviation": True, "lower": True, "upper": True},
    "lognormal": {"median": True, "spread": False, "lower": True, "upper": True},
}
_OPTIONAL = {"normal": ("lower", "upper"), "lognormal": ("lower", "upper")}


def _quantiles(path: str, table: Table, bounds: Bounds, shares: np.ndarray) -> np.ndarray:
    """Values of a distribution at shares of its population.

    `uniform` and `logarithmic` are uniform in the number, or in its logarithm; `normal` has a mean
    and a standard deviation, `lognormal` a median and the standard deviation `spread` of the
    natural logarithm. The last two may be truncated at `lower` and `upper`.
    """
    kind = str(table.get("distribution"))
    if kind not in _KINDS:
        refuse_unknown(f"{path}.distribution", {kind: 0}, _KINDS)
    fields = _KINDS[kind]
    refuse_unknown(path, table, ("distribution", *fields))
    numbers = {}
    for name, dimensional in fields.items():
        if name in table:
            unit = bounds.unit if dimensional else "1"
            numbers[name] = amount(f"{path}.{name}", table[name], unit)
        elif name not in _OPTIONAL.get(kind, ()):
            raise ValueError(f"Argument `{path}` must give `{name}` of its {kind} distribution.")
    low, high = numbers.get("lower", -math.inf), numbers.get("upper", math.inf)
    if low > high:
        raise ValueError(
            f"Argument `{path}.lower` must be at most `upper` = {high:g} [{bounds.unit}], but is "
            f"{low:g}."
        )
    for name in ("deviation", "spread", *(("lower",) if kind == "logarithmic" else ())):
        if name in numbers:
            unit = bounds.unit if fields[name] else "1"
            _check.scalar(f"{path}.{name}", numbers[name], above=0, unit=unit)
    if kind == "uniform":
        return low + (high - low) * shares
    if kind == "logarithmic":
        return low * (high / low) ** shares
    from scipy import stats

    if kind == "normal":
        law = stats.norm(numbers["mean"], numbers["deviation"])
    else:
        law = stats.lognorm(numbers["spread"], scale=numbers["median"])
    first, last = law.cdf(low), law.cdf(high)
    return np.clip(law.ppf(first + (last - first) * shares), low, high)


# ---- reading


def read(table: Table, folder: Path, found: Reading) -> Parcels:
    """The parcels described by a table; the file that it names is in `folder`. A number with a
    lower and an upper bound is free and the same for all parcels; its start value is used here.

    Raises `ValueError` and `TypeError` for unknown keys and impossible values.
    """
    refuse_unknown("parcels", table, (*FIELDS, *_SETTINGS))
    if "list" in table and "file" in table:
        raise ValueError("Argument `parcels` must give a `list` or a `file`, but gives both.")
    rows: dict[str, np.ndarray] | None = None
    origins: list[str] = []
    if "file" in table:
        rows, origins = _file(folder / str(table["file"]))
    elif "list" in table:
        rows, origins = _rows(table["list"])
    table = {
        k: found.number(f"parcels.{k}", v, FIELDS[k]) if k in FIELDS and _is_span(v) else v
        for k, v in table.items()
    }
    drawn = {k: v for k, v in table.items() if k in FIELDS and isinstance(v, Mapping)}
    lists = {k: v for k, v in table.items() if k in FIELDS and k not in drawn}
    for name in rows or {}:
        if name in drawn or name in lists:
            raise ValueError(
                f"Argument `parcels.{name}` must be given once, but the list of parcels has it too."
            )
    # Every combination of a row of the list, of the values of each number, and of a draw.
    grids: list[dict[str, np.ndarray]] = [] if rows is None else [rows]
    for name, raw in lists.items():
        values = raw if isinstance(raw, (list, tuple)) else [raw]
        if not values:
            raise ValueError(f"Argument `parcels.{name}` must hold one at least, but is empty.")
        grids.append({name: np.array([_number(name, value) for value in values])})
    if drawn:
        grids.append(_draw(drawn, table))
    sizes = [next(iter(grid.values())).size for grid in grids]
    places = np.indices(sizes).reshape(len(sizes), -1) if sizes else np.zeros((0, 1), int)
    columns = {
        name: values[at] for grid, at in zip(grids, places, strict=True)
        for name, values in grid.items()
    }  # fmt: skip
    total = places.shape[1]
    weights = columns.pop("weight", np.ones(total))
    if not np.sum(weights) > 0:
        raise ValueError("Argument `parcels.weight` must be above 0 for one parcel at least.")
    for name, value in _START.items():
        columns.setdefault(name, np.full(total, value))
    columns.setdefault("mass", np.full(total, float(Parcel().mass)))
    order = [name for name in FIELDS if name in columns]
    corners = table.get("corners", (1, 2))
    if not isinstance(corners, (list, tuple)):
        raise TypeError(f"Argument `parcels.corners` must be a list, but is {corners!r}.")
    if not corners or any(isinstance(one, bool) or one not in (1, 2, 3, 4) for one in corners):
        raise ValueError(
            "Argument `parcels.corners` must hold corners 1 ... 4 (1 leading lower, 2 trailing "
            f"lower, 3 trailing upper, 4 leading upper), but is {corners!r}."
        )
    return Parcels(
        {PATHS[name]: columns[name] for name in order},
        weights / np.sum(weights),
        tuple(corners),
        {
            PATHS[name]: tuple(f"{origins[row]}.{name}" for row in places[0])
            for name in rows or {}
            if name in FIELDS
        },
    )


def _is_span(raw: Any) -> bool:
    return isinstance(raw, Mapping) and "distribution" not in raw and {"lower", "upper"} <= set(raw)


def _number(name: str, raw: Any, where: str = "parcels") -> float:
    bounds = _WEIGHT if name == "weight" else FIELDS[name]
    found = amount(f"{where}.{name}", raw, bounds.unit)
    _check.scalar(f"{where}.{name}", found, **bounds._asdict())
    return found


def _rows(raw: Any) -> tuple[dict[str, np.ndarray], list[str]]:
    """The columns of a list of parcels, each a table of the same numbers, and where each is."""
    if not isinstance(raw, (list, tuple)) or not raw:
        raise TypeError(
            f"Argument `parcels.list` must be a list of tables, such as "
            f'[{{mass = "2 kg"}}, {{mass = "30 kg"}}], but is {raw!r}.'
        )
    names: tuple[str, ...] = ()
    read_rows = []
    for index, row in enumerate(raw):
        where = f"parcels.list[{index}]"
        if not isinstance(row, Mapping):
            raise TypeError(f"Argument `{where}` must be a table, but is {row!r}.")
        refuse_unknown(where, row, (*FIELDS, "weight"))
        names = names or tuple(row)
        if set(row) != set(names):
            raise ValueError(
                f"Argument `{where}` must give the same numbers as the first, "
                f"{', '.join(names)}, but gives {', '.join(row)}."
            )
        read_rows.append([_number(name, row[name], where) for name in names])
    columns = zip(names, zip(*read_rows, strict=True), strict=True)
    places = [f"parcels.list[{index}]" for index in range(len(raw))]
    return {name: np.array(column) for name, column in columns}, places


def _file(path: Path) -> tuple[dict[str, np.ndarray], list[str]]:
    """The columns of a CSV file, and where each parcel is: titles such as `mass [kg]` or
    `Length (mm)`, then a row a parcel; `weight` is its frequency. Columns are separated by commas,
    semicolons or tabs; numbers have a decimal point or, unless commas separate the columns, a
    decimal comma. Empty lines and lines that start with # are ignored. The encoding is UTF-8,
    UTF-16 or the Windows encoding of western Europe."""
    try:
        file = Rows(path)
    except OSError as error:
        raise ValueError(
            f"Argument `parcels.file` must name a CSV file, but is {str(path)!r}: "
            f"{error.strerror or error}. A relative name begins at the sorter file's folder."
        ) from error
    names = [key(title) or title for title in file.titles]
    units = [name_and_unit(title)[1] or "" for title in file.titles]
    refuse_unknown(f"{path}, line {file.first},", dict.fromkeys(names), (*FIELDS, "weight"))
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ValueError(
            f"{path}, line {file.first}: must name each column once, but names `{twice}` twice."
        )
    rows = [(line, cells) for line, cells in file.rows if any(cell.strip() for cell in cells)]
    if not rows:
        raise ValueError(f"{path}: must hold a line of titles and one parcel at least.")
    commas = file.separator != "," and any("," in cell for _, cells in rows for cell in cells)
    columns: dict[str, list[float]] = {name: [] for name in names}
    for line, cells in rows:
        where = f"{path}:{line}"
        for name, unit, cell in zip(names, units, cells, strict=True):
            plain = _with_point(f"{where}.{name}", cell.strip()) if commas else cell.strip()
            columns[name].append(_number(name, f"{plain} {unit}", where))
    places = [f"{path}:{line}" for line, _ in rows]
    return {name: np.array(values) for name, values in columns.items()}, places


def _with_point(name: str, cell: str) -> str:
    """A cell of a file with decimal commas, with a decimal point."""
    if "." in cell or cell.count(",") > 1:
        raise ValueError(
            f"Argument `{name}` must be written with a decimal comma, as other numbers of the "
            f"file, and without marks between thousands, but is {cell!r}."
        )
    return cell.replace(",", ".")


def _draw(drawn: Mapping[str, Table], table: Table) -> dict[str, np.ndarray]:
    """A sample of some distributed numbers, independent of each other: scrambled Sobol' points."""
    count = _check.count("parcels.count", table.get("count", 64), least=1)
    seed = _check.count("parcels.seed", table.get("seed", 0))
    from scipy.stats import qmc

    engine = qmc.Sobol(len(drawn), rng=np.random.default_rng(seed))
    power = int(np.ceil(np.log2(max(count, 2))))
    shares = engine.random_base2(power)[:count]
    columns = {}
    for (name, raw), share in zip(drawn.items(), shares.T, strict=True):
        values = _quantiles(f"parcels.{name}", raw, FIELDS[name], share)
        columns[name] = np.array([_number(name, float(value)) for value in values])
    return columns
