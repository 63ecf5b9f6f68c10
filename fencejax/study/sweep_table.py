"""The results of a sweep: a labelled dataset of lanes, and columns by name."""

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..plot import sweep as draw
from ..printing import Readable, Table, numbers
from ..results import Status
from . import sweep_store

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

IMPOSSIBLE = -1
"""Status of a lane whose numbers give no scene (`SceneFamily.possible`); its outputs are NaN."""

_IMPOSSIBLE_TEXT = "IMPOSSIBLE"


def status_name(status: int) -> str:
    """Name of a `Status`, or of `IMPOSSIBLE`."""
    return _IMPOSSIBLE_TEXT if status == IMPOSSIBLE else Status(status).name


def derivative(output: str, variable: str) -> str:
    """Name of the column that holds an output's derivative in a variable."""
    return f"d_{output}_d_{variable}"


def lanes(
    variables: Mapping[str, np.ndarray],
    columns: Mapping[str, Any],
    status: Any,
    rung: Any = None,
    *,
    units: Mapping[str, str],
    scalings: Mapping[str, str],
    outputs: tuple[str, ...],
    gradient_of: str | None,
    shape: tuple[int, ...],
    configuration: Mapping[str, Any],
) -> "xarray.Dataset":
    """A dataset along the dimension `lane`: variables as coordinates; outputs, derivatives, the
    status and, where lanes were refined, the rung, arrays of NumPy or Dask of shape (N,), as data.

    Attributes: `units` everywhere; a variable's `scaling`; the meanings of the status; of the
    whole, the names of `variables` and `outputs` in order, `gradient_of`, the grid's `shape`, the
    `configuration` as JSON, and `job`, its digest.
    """
    xarray = sweep_store.sweep_library("xarray")
    codes = [IMPOSSIBLE, *(int(s) for s in Status)]
    meanings = " ".join(status_name(code) for code in codes)
    data: dict[str, Any] = {n: ("lane", c, {"units": units[n]}) for n, c in columns.items()}
    data["status"] = ("lane", status, {"flag_values": codes, "flag_meanings": meanings})
    if rung is not None:
        meaning = "place of the lane's fidelity in the sweep's Fidelity.ladder()"
        data["rung"] = ("lane", rung, {"long_name": meaning})
    coordinates = {
        n: ("lane", c, {"units": units[n], "scaling": scalings[n]}) for n, c in variables.items()
    }
    return xarray.Dataset(data, coords=coordinates, attrs={
        "variables": list(variables),
        "outputs": list(outputs),
        "gradient_of": gradient_of or "",
        "shape": list(shape),
        "configuration": json.dumps(configuration),
        "job": sweep_store.digest(configuration),
    })  # fmt: skip


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class SweepTable(Readable):
    """The points of a sweep and their results, N lanes in the order of the samples.

    **Fields:**

    - `dataset`: along the dimension `lane`, as it is in the store (see `lanes`).

    >>> samples = fj.sampling.given({"mass": [5.0, 15.0]})
    >>> family, rigid = fj.SceneFamily("oblique_impact", ["mass"]), fj.Fidelity.coarse(modes=0)
    >>> fj.run_sweep(fj.Sweep(family, samples, ["peak_force"], fidelity=rigid), "two")
    SweepTable of 2 lanes
      mass [kg]       [5 kg, 15 kg]
      peak_force [N]  [1175 N, 2866 N]
      status          SUCCESSFUL 2
    >>> fj.SweepTable.load("two").outputs["peak_force"].round()
    array([1175., 2866.])
    """

    dataset: "xarray.Dataset"

    def _columns(self, names) -> dict[str, np.ndarray]:
        return {name: self.dataset[name].to_numpy() for name in names}

    @property
    def variables(self) -> dict[str, np.ndarray]:
        """Values [SI] of shape (N,) by name."""
        return self._columns(self.dataset.attrs["variables"])

    @property
    def outputs(self) -> dict[str, np.ndarray]:
        """Results of shape (N,) by name; NaN where a lane lacks the result (`leave_x` without a
        contact)."""
        return self._columns(self.dataset.attrs["outputs"])

    @property
    def status(self) -> np.ndarray:
        """Shape (N,), a `Status` or `IMPOSSIBLE`. Up to `Status.LEFT_OVER_TIP` the numbers are
        good."""
        return self.dataset["status"].to_numpy()

    @property
    def rung(self) -> np.ndarray:
        """Shape (N,): the rung of `Fidelity.ladder` at which each lane was computed; 0 is the
        sweep's own fidelity."""
        if "rung" not in self.dataset:
            return np.zeros(self.dataset.sizes["lane"], np.int32)
        return self.dataset["rung"].to_numpy()

    @property
    def gradient_of(self) -> str | None:
        """The output that was differentiated, if any."""
        return self.dataset.attrs["gradient_of"] or None

    @property
    def gradient(self) -> dict[str, np.ndarray]:
        """Derivatives of the output `gradient_of` by variable, each of shape (N,), in the output's
        unit over the variable's; empty without `gradient_of`."""
        main = self.gradient_of
        if main is None:
            return {}
        names = self.dataset.attrs["variables"]
        return {name: self.dataset[derivative(main, name)].to_numpy() for name in names}

    @property
    def units(self) -> dict[str, str]:
        """Units of variables and outputs."""
        names = [*self.dataset.attrs["variables"], *self.dataset.attrs["outputs"]]
        return {name: self.dataset[name].attrs["units"] for name in names}

    @property
    def scalings(self) -> dict[str, str]:
        """The variables' scalings, "linear" or "logarithmic"."""
        names = self.dataset.attrs["variables"]
        return {name: self.dataset[name].attrs["scaling"] for name in names}

    @property
    def shape(self) -> tuple[int, ...]:
        """(N,), or the grid's."""
        return tuple(int(length) for length in self.dataset.attrs["shape"])

    @property
    def configuration(self) -> dict[str, Any]:
        """Everything that the numbers depend on."""
        return json.loads(self.dataset.attrs["configuration"])

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
        return self.dataset[name].to_numpy().reshape(self.shape)

    @property
    def good(self) -> np.ndarray:
        """Whether the numbers of a lane are good, (N,)."""
        return (self.status >= 0) & (self.status <= Status.LEFT_OVER_TIP)

    def counts(self) -> dict[str, int]:
        """Number of lanes by the name of their status."""
        found = np.unique(self.status, return_counts=True)
        return {status_name(int(s)): int(n) for s, n in zip(*found, strict=True)}

    def missing(self) -> dict[str, int]:
        """Lanes with good numbers in which an output or a derivative is not finite, by the name of
        the column; those without any are left out."""
        good = self.good
        columns = {str(n): self.dataset[n].to_numpy() for n in self.dataset.data_vars}
        found = {n: int(np.sum(~np.isfinite(c[good]))) for n, c in columns.items()}
        return {name: number for name, number in found.items() if number}

    @classmethod
    def load(cls, path: Path | str) -> "SweepTable":
        """The table of a sweep's folder, every chunk checked against its record.

        Raises `ImportError` without the extra `sweep` and `ValueError` where the folder holds no
        sweep, or chunks of it are missing or damaged.
        """
        return cls(sweep_store.load(path))

    def to_xarray(self) -> "xarray.Dataset":
        """The dataset in the form for plotting: a grid with its variables as dimensions, other
        points along the dimension `lane`. Attributes give the units and the meanings of
        `status`."""
        if not self.is_grid:
            return self.dataset
        xarray = sweep_store.sweep_library("xarray")
        data = {
            name: (tuple(self.axes), self.grid(str(name)), column.attrs)
            for name, column in self.dataset.data_vars.items()
        }
        axes = {n: (n, axis, self.dataset[n].attrs) for n, axis in self.axes.items()}
        return xarray.Dataset(data, coords=axes, attrs=self.dataset.attrs)

    def to_pandas(self) -> "pandas.DataFrame":
        """A row a lane: variables, outputs, derivatives, the status, a number of `Status`, and
        the `rung`.

        Raises `ImportError` where pandas is not installed.
        """
        sweep_store.sweep_library("pandas")
        return self.dataset.reset_coords().to_dataframe()

    def plot(self) -> "dict[str, Figure]":
        """A figure of every output by name, and of the `elasticities` where there is a gradient:
        see `fencejax.plot.sweep`."""
        return draw(self)

    def _printed(self) -> Table:
        rows = [
            (f"{name} [{self.units[name]}]", numbers(column, self.units[name]))
            for name, column in self.variables.items()
        ]
        rows += [
            (f"{name} [{self.units[name]}]", numbers(np.where(self.good, column, np.nan),
             self.units[name]))
            for name, column in self.outputs.items()
        ]  # fmt: skip
        if self.gradient_of is not None:
            rows.append(("derivatives", f"of {self.gradient_of}"))
        rows.append(("status", ", ".join(f"{name} {n}" for name, n in self.counts().items())))
        if np.any(self.rung):
            rows.append(("computed finer", f"{np.sum(self.rung > 0)} lanes"))
        shape = " x ".join(map(str, self.shape))
        return Table(f"SweepTable of {shape} lanes", tuple(rows))
