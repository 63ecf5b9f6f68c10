"""The description of a sorter by its tables."""

import copy
import tomllib
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .. import _text
from ..fidelity import Fidelity
from ..parts import AbstractDrive, AbstractFriction, Belt, Border, DataSheet, Fence, Motor
from ..printing import Readable, Table, as_table
from ..scenes import Scene
from ..study import SceneFamily
from . import machine, overrides
from .machine import Machine
from .parcels import Parcels
from .problem import SorterProblem

Overrides = Mapping[str, Any]


class ImplausibleNumberWarning(UserWarning):
    """A number far outside the range of real machines, probably given in another unit."""


class Sorter(Readable):
    """A sorter with its parcels, its free numbers, its limits and its objective.

    It is described by tables, those of a sorter file:

        sorter = fj.Sorter.load("machine.toml")
        sorter = fj.Sorter(
            belt={"speed": "2.5 m/s", "width": "0.8 m"},
            fence={"reach": "1.0 m", "thickness": {"lower": "4 mm", "upper": "90 mm"},
                   "material": ["PA6 dry", "POM"]},
            parcels={"mass": ["2 kg", "30 kg"], "offset": ["50 mm", "200 mm"]},
            limits={"tip_deflection": "60 mm"},
        )

    Numbers are in SI units, or text with a unit. A part may replace its table, such as
    `belt=fj.Belt(speed=2.5)`. Numbers left out have the values of `optimize/sorters/paper.toml`,
    except for those named at its head. Every part may have free numbers,
    `{"lower": ..., "upper": ..., "start": ...}`, fixed where both bounds are equal. Every part but
    the parcels may have lists of numbers to choose from; `fence.material` may list materials. Each
    combination of choices is a candidate with a design of its own.

    Then `sorter.problem()` is ready for `fj.minimize`, `sorter.scenes()` for
    `fj.simulate_many`, and `sorter.family(["mass"])` for sweeps and studies.

    >>> sorter = fj.Sorter(belt=fj.Belt(speed=2.5))
    >>> scene = sorter.scene(lane=0)
    >>> scene.start
    OnBelt(front=100 mm, offset=0 m, angle=0 rad)
    """

    def __init__(
        self,
        *,
        title: str = "",
        belt: Belt | Mapping[str, Any] | None = None,
        parcels: Mapping[str, Any] | None = None,
        fence: Fence | Mapping[str, Any] | None = None,
        drive: AbstractDrive | Mapping[str, Any] | str | None = None,
        motor: Motor | Mapping[str, Any] | None = None,
        fence_friction: AbstractFriction | Mapping[str, Any] | bool | None = None,
        border: Border | Mapping[str, Any] | bool | None = None,
        period: float | str | None = None,
        limits: Mapping[str, Any] | None = None,
        objective: Mapping[str, Any] | str | None = None,
        folder: str | Path = ".",
    ):
        """**Arguments:**

        - `title`: its name.
        - `belt`, `fence`, `drive` (its law by name, with its numbers), `motor`, `fence_friction`,
          `border`: the parts. `False` for `border` or a friction leaves it out.
        - `parcels`: numbers of `fencejax.Parcel` and places (`front`, `offset`, `angle`). Each is
          one number for all parcels, a list, or a table with a `distribution`, from which `count`
          values are drawn; every combination of the lists is sorted. Or a `list` of tables, or a
          CSV `file`. `weight`: the frequency of a parcel. A free number is the same for all.
        - `period` [s]: from one parcel to the next; the duration of a simulated sort.
        - `limits`: bounds by name, see `fencejax.sorter.LIMIT_ROWS`.
        - `objective`: the name of a quantity, or `{"minimize": ..., "over": "worst"}`.
        - `folder`: the folder of the files that are named.

        Raises `ValueError` and `TypeError` for what cannot be read, naming the field. Issues an
        `ImplausibleNumberWarning` for numbers far outside the range of real machines.
        """
        given = dict(
            title=title, belt=belt, parcels=parcels, fence=fence, drive=drive, motor=motor,
            fence_friction=fence_friction, border=border, period=period, limits=limits,
            objective=objective,
        )  # fmt: skip
        self.folder = Path(folder)
        self.tables: dict[str, Any] = {
            name: copy.deepcopy(value) if isinstance(value, (dict, list)) else value
            for name, value in given.items()
            if value is not None and value != ""
        }
        self.machine: Machine = machine.read(self.tables, self.folder)
        for doubt in self.doubts:
            warnings.warn(doubt, ImplausibleNumberWarning, stacklevel=2)

    def _printed(self) -> Table:
        return as_table(self.machine)

    @classmethod
    def parse(
        cls, text: str, *, folder: str | Path = ".", set: Overrides | None = None,  # noqa: A002
        free: Overrides | None = None,
    ) -> "Sorter":
        """A sorter from the text of a sorter file, with overrides as of `replace`."""
        try:
            tables = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise ValueError(
                f"Argument `text` must be TOML, but is not: {error}. A number with a unit is text "
                'in quotes: thickness = "45 mm".'
            ) from error
        return cls._of(tables, Path(folder), set, free)

    @classmethod
    def load(
        cls, path: str | Path, *, set: Overrides | None = None,  # noqa: A002
        free: Overrides | None = None,
    ) -> "Sorter":
        """A sorter from a sorter file, with overrides as of `replace`.

        Raises `OSError` where it cannot be read, and `ValueError` naming the file otherwise.
        """
        path = Path(path)
        _text.refuse_folder(path)
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError as error:
            raise ValueError(
                f"{path}: must be text in UTF-8, but byte {error.start} is not. "
                "Save it as UTF-8, or name a sorter file."
            ) from error
        if not text.strip():
            raise ValueError(
                f"{path}: must describe a sorter, but is empty. Write, for example, "
                'fence = { thickness = "45 mm" }.'
            )
        try:
            return cls.parse(text, folder=path.parent, set=set, free=free)
        except (ValueError, TypeError) as error:
            kind = TypeError if isinstance(error, TypeError) else ValueError
            raise kind(f"{path}: {error}") from error

    @classmethod
    def _of(
        cls, tables: Mapping[str, Any], folder: Path, given: Overrides | None,
        free: Overrides | None,
    ) -> "Sorter":
        changed = dict(tables)
        for name, value in (given or {}).items():
            changed = overrides.replaced(changed, name, value)
        for name, value in (free or {}).items():
            changed = overrides.freed(changed, name, _span(value))
        machine.refuse_unknown("a sorter", changed, machine.SECTIONS)
        return cls(**changed, folder=folder)

    def replace(
        self, set: Overrides | None = None, free: Overrides | None = None  # noqa: A002
    ) -> "Sorter":
        """The same with some numbers changed.

        **Arguments:**

        - `set`: values by path or short name: `{"belt.speed": "2.5 m/s", "fence.material": "POM"}`.
        - `free`: lower and upper bounds: `{"fence.thickness": ("4 mm", "90 mm")}`.
        """
        return self._of(self.tables, self.folder, set, free)

    @property
    def doubts(self) -> tuple[str, ...]:
        """Implausible numbers, a line each."""
        return self.machine.doubts()

    @property
    def fence(self) -> Fence:
        """The fence, free numbers where they start, of the first material."""
        return self.machine.fence

    @property
    def drive(self) -> AbstractDrive:
        """The drive, free numbers where they start."""
        return self.machine.drive

    @property
    def belt(self) -> Belt:
        """The belt."""
        return self.machine.belt

    @property
    def materials(self) -> tuple[DataSheet, ...]:
        """The materials that the fence may have."""
        return self.machine.materials

    @property
    def parcels(self) -> Parcels:
        """The parcels that are sorted."""
        return self.machine.parcels

    def scene(self, lane: int = 0, material: DataSheet | None = None) -> Scene:
        """The sort of one parcel; see `fencejax.sorter.Machine.scene`."""
        return self.machine.scene(lane, material)

    def scenes(self, material: DataSheet | None = None) -> Scene:
        """The sorts of all parcels as one batch, each leaf with the lanes first."""
        return self.machine.scenes(material)

    def family(self, names: Sequence[str] = (), **settings: Any) -> SceneFamily:
        """Scenes in which named numbers vary; see `fencejax.sorter.Machine.family`."""
        return self.machine.family(names, **settings)

    def problem(
        self, fidelity: Fidelity | None = None, *, reserve: float = 0.005, rungs: int = 2,
        chunk: int = 64,
    ) -> SorterProblem:
        """The design problem of this sorter; see `fencejax.sorter.SorterProblem`."""
        return SorterProblem(self.machine, fidelity, reserve=reserve, rungs=rungs, chunk=chunk)


def _span(value: Any) -> Any:
    if isinstance(value, str):
        return overrides.span(value)
    if isinstance(value, (tuple, list)) and len(value) == 2:
        return {"lower": value[0], "upper": value[1]}
    return value
