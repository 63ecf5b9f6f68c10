"""What a sweep found: columns by name, one file of them, and a labelled dataset."""

import dataclasses
import importlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from ..results import Status
from . import sweep_store as store

IMPOSSIBLE = -1
"""Status of a lane whose numbers give no scene (`SceneFamily.possible`); its outputs are NaN."""

_IMPOSSIBLE_TEXT = "IMPOSSIBLE"


def status_name(status: int) -> str:
    """Name of a `Status`, or of `IMPOSSIBLE`."""
    return _IMPOSSIBLE_TEXT if status == IMPOSSIBLE else Status(status).name


@dataclasses.dataclass(frozen=True, eq=False)
class SweepTable:
    """The points of a sweep and what came out, N lanes in the order of the samples.

    **Fields:**

    - `variables`: values [SI] of shape (N,) by name; `outputs`: results of shape (N,) by name.
    - `status`: shape (N,), a `Status` or `IMPOSSIBLE`. Up to `Status.LEFT_OVER_TIP` the numbers
      are good; an output that a lane does not have (`leave_x` where nothing was touched) is NaN.
    - `gradient`: derivatives of the output `gradient_of` by variable, each of shape (N,), in the
      output's unit over the variable's; empty where none was asked for.
    - `units`: of variables and outputs.
    - `shape`: (N,), or the grid's.
    - `scalings`: of the variables, "linear" or "logarithmic".
    - `configuration`: of the sweep, as in its manifest.
    """

    variables: dict[str, np.ndarray]
    outputs: dict[str, np.ndarray]
    status: np.ndarray
    gradient_of: str | None
    gradient: dict[str, np.ndarray]
    units: dict[str, str]
    shape: tuple[int, ...]
    scalings: dict[str, str]
    configuration: dict[str, Any]

    @property
    def is_grid(self) -> bool:
        """Whether the points are a grid's."""
        return self.configuration["samples"]["kind"] == "grid"

    @property
    def axes(self) -> dict[str, np.ndarray]:
        """The values [SI] along each axis of a grid.

        Raises `ValueError` where the points are no grid.
        """
        if not self.is_grid:
            raise ValueError(
                "Only a grid has axes, but the points are of the kind "
                f"{self.configuration['samples']['kind']!r}. Use `variables`."
            )
        found = {}
        for index, name in enumerate(self.variables):
            # Along its own axis, at the start of all others.
            line = tuple(slice(None) if k == index else 0 for k in range(len(self.shape)))
            found[name] = self.grid(name)[line]
        return found

    def grid(self, name: str) -> np.ndarray:
        """A column with the grid's shape: a variable, an output or `"status"`."""
        column = {**self.variables, **self.outputs, "status": self.status}[name]
        return column.reshape(self.shape)

    @property
    def good(self) -> np.ndarray:
        """Whether the numbers of a lane are good, (N,)."""
        return (self.status >= 0) & (self.status <= Status.LEFT_OVER_TIP)

    def counts(self) -> dict[str, int]:
        """Number of lanes by the name of their status."""
        found = np.unique(self.status, return_counts=True)
        return {status_name(int(s)): int(n) for s, n in zip(*found, strict=True)}

    def missing(self) -> dict[str, int]:
        """Lanes with good numbers in which an output or a derivative is not finite, by name; those
        without any are left out."""
        columns = dict(self.outputs)
        for name, column in self.gradient.items():
            columns[f"d {self.gradient_of} / d {name}"] = column
        found = {n: int(np.sum(~np.isfinite(c[self.good]))) for n, c in columns.items()}
        return {name: number for name, number in found.items() if number}

    def save(self, path: Path | str) -> None:
        """Write all of it into one .npz file, whole or not at all.

        `numpy.load(path)` then gives the columns by their names; `status`; `gradient`, of shape
        (N, variables), and `gradient_of`; `variables`, `outputs` and `units`, the names and the
        unit of each, variables first; `shape`; `status_codes` and `status_names`; `scalings`; and
        `configuration` as JSON.
        """
        names = [*self.variables, *self.outputs]
        codes = [IMPOSSIBLE, *(int(s) for s in Status)]
        store.write_arrays(Path(path), {
            **self.variables,
            **self.outputs,
            "status": self.status,
            "gradient": np.stack(list(self.gradient.values()), axis=1)
            if self.gradient else np.zeros((len(self.status), 0)),
            "gradient_of": np.array(self.gradient_of or ""),
            "variables": np.array(list(self.variables)),
            "outputs": np.array(list(self.outputs), dtype=str),
            "units": np.array([self.units[name] for name in names]),
            "scalings": np.array([self.scalings[name] for name in self.variables]),
            "shape": np.array(self.shape),
            "status_codes": np.array(codes),
            "status_names": np.array([status_name(code) for code in codes]),
            "configuration": np.array(json.dumps(self.configuration)),
        })  # fmt: skip

    @classmethod
    def load(cls, path: Path | str) -> "SweepTable":
        """What `save` has written.

        Raises `ValueError` where the file is none of these.
        """
        try:
            with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as arrays:
                data = {name: arrays[name] for name in arrays.files}
            variables = [str(name) for name in data["variables"]]
            outputs = [str(name) for name in data["outputs"]]
            units = dict(zip([*variables, *outputs], map(str, data["units"]), strict=True))
            gradient = dict(zip(variables, data["gradient"].T, strict=False))
            return cls(
                {name: data[name] for name in variables},
                {name: data[name] for name in outputs},
                data["status"],
                str(data["gradient_of"]) or None,
                gradient,
                units,
                tuple(int(k) for k in data["shape"]),
                dict(zip(variables, map(str, data["scalings"]), strict=True)),
                json.loads(str(data["configuration"])),
            )
        except (KeyError, ValueError) as error:
            raise ValueError(
                f"Argument `path` must name a file written by SweepTable.save, but {path} lacks "
                f"what it writes ({error})."
            ) from error

    def to_xarray(self) -> Any:
        """An `xarray.Dataset`: a grid has its variables as dimensions with coordinates, other
        points one dimension `lane` with the variables as coordinates along it. Derivatives are
        named `d_OUTPUT_d_VARIABLE`; units are attributes, and so are the meanings of `status`.

        Raises `ImportError` where xarray is not installed.
        """
        try:
            xarray = importlib.import_module("xarray")
        except ImportError as error:
            raise ImportError(
                "A labelled dataset needs xarray. Write pip install 'fencejax[xarray]'."
            ) from error
        if self.is_grid:
            dims = tuple(self.variables)
            coords = {n: (n, a, {"units": self.units[n]}) for n, a in self.axes.items()}
        else:
            dims = ("lane",)
            coords = {
                n: ("lane", c, {"units": self.units[n]}) for n, c in self.variables.items()
            }
        fields = {
            name: (dims, column.reshape(self.shape), {"units": self.units[name]})
            for name, column in self.outputs.items()
        }
        for name, column in self.gradient.items():
            unit = f"({self.units[str(self.gradient_of)]}) / ({self.units[name]})"
            key = f"d_{self.gradient_of}_d_{name}"
            fields[key] = (dims, column.reshape(self.shape), {"units": unit})
        codes = [IMPOSSIBLE, *(int(s) for s in Status)]
        meanings = " ".join(status_name(code) for code in codes)
        attributes = {"flag_values": codes, "flag_meanings": meanings}
        fields["status"] = (dims, self.status.reshape(self.shape), attributes)
        described = {"configuration": json.dumps(self.configuration)}
        return xarray.Dataset(fields, coords=coords, attrs=described)
