"""A sorter's design problem: one compiled program for all of its materials and choices."""

import copy
import dataclasses
import itertools
import types
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from .. import _check
from ..design import DesignSpace, LaneProgram, Limit, Quantity, fatigue, risk, variable
from ..fidelity import Fidelity
from ..parts import DataSheet, HeldDrive, Material
from ..results import Status, refined
from ..scenes import consistent, numbers as scene_numbers
from ..study import measured
from . import limits as limit_table
from .machine import Machine, scene_path
from .objective import Objective

# The key of a fixed number in the lanes; the addresses of a journal contain it.
_FIXED = "held "
_MATERIAL = tuple(Material.bounds)


class Candidate(NamedTuple):
    """One of the choices: a material, and numbers [SI] by path: those chosen from lists, and free
    numbers that are fixed. `bounds` [SI], by the limits' names, replace those of the sorter."""

    material: DataSheet
    numbers: Mapping[str, float]
    bounds: Mapping[str, float] = types.MappingProxyType({})

    @property
    def name(self) -> str:
        """`"POM, thickness 0.02"`."""
        chosen = [f"{path.rpartition('.')[2]} {value:g}" for path, value in self.numbers.items()]
        return ", ".join([self.material.name, *chosen])


class Measured(NamedTuple):
    """A design's quantities by name, one number a lane, with the `Status` and the rung of the
    fidelity of each lane."""

    values: dict[str, np.ndarray]
    statuses: np.ndarray
    rungs: np.ndarray


def _whole(sheet: DataSheet) -> DataSheet:
    """A sheet whose material has all numbers, so that any other can replace it."""
    material = sheet.material
    numbers = {name: getattr(material, name) for name in _MATERIAL}
    whole = Material(**{**numbers, "fatigue_exponent": fatigue.exponent_of(material)})
    return eqx.tree_at(lambda of: of.material, sheet, whole)


class SorterProblem:
    """The least objective over a sorter's parcels, within its limits.

        problem = sorter.problem()
        for candidate in problem.candidates:
            optimum = fj.minimize(problem.program, problem.start, data=problem.data(candidate))

    z are the shares of the free numbers' ranges, `problem.space`. The material, the numbers chosen
    from lists and the bounds are data: one compiled program serves all candidates. Where a sorter
    has no free number, `space` is `None` and z is empty.

    **Fields:**

    - `candidates`: every combination of a material with numbers from the lists.
    - `limit_names`: of the limits, in the order of their margins.
    - `program`: for `fencejax.minimize`.
    - `start`: z where the free numbers start.
    - `quantities`: those computed in every sort: the objective, the limited ones, and `also`.
    """

    def __init__(
        self, machine: Machine, fidelity: Fidelity | None = None, *, reserve: float = 0.005,
        rungs: int = 2, chunk: int = 64, fixed: Sequence[str] = (),
        also: Sequence[Quantity] = (),
    ):
        """**Arguments:**

        - `machine`: the sorter's parts.
        - `fidelity`: default `Fidelity.fast()`.
        - `reserve` [1]: subtracted from each margin that depends on the simulated sort.
        - `rungs`: the number of rungs of the fidelity's ladder at which the program computes lanes
          in doubt. The third, at the steps of `reference`, costs as much as all others together;
          the result of a search is measured again in any case (`measure`).
        - `chunk`: the most sorts in one vectorised call.
        - `fixed`: free numbers that a `Candidate` may fix at a value of its own, so that one
          program serves designs with and without a part.
        - `also`: further quantities to compute.

        Raises `ValueError` where a parcel's sort is impossible, or a name in `fixed` is not free.
        """
        self.machine, self.reserve = machine, _check.number("reserve", reserve)
        self.fidelity = Fidelity.fast() if fidelity is None else fidelity
        self.chunk = _check.count("chunk", chunk, least=1)
        self.space = self._space()
        self.candidates = tuple(
            Candidate(sheet, dict(zip(machine.choices, numbers, strict=True)))
            for sheet in machine.materials
            for numbers in itertools.product(*machine.choices.values())
        )
        self._fixed = tuple(self._free_names.index(self._free(path)) for path in fixed)
        first = self.limits(self.candidates[0])
        self.limit_names = tuple(name for name, _ in first)
        self._quantities = {name: limit.quantity for name, limit in first}
        self._means = limit_table.means(machine.bounds)
        wanted = (machine.objective.quantity, *self._quantities.values(), *also)
        self.quantities = tuple({quantity.name: quantity for quantity in wanted}.values())
        self._signs = {name: 1.0 if x.sense == "at most" else -1.0 for name, x in first}
        self._columns = self._material_columns()
        taken = {*self._free_names, *self._columns}
        own = (path for path in machine.parcels.columns if path not in taken)
        self._names = (*self._free_names, *own, *self._columns)
        self._family = machine.family(self._names, material=_whole(machine.materials[0]))
        self._check_scenes()
        self.start = np.zeros(0)
        if self.space is not None:
            self.start = np.asarray(self.space.to_shares(self.space.base))
        ladder = self.fidelity.ladder()[: _check.count("rungs", rungs, least=1)]
        self.program = LaneProgram(self._read, self._combined, ladder)
        self._measures: dict[Fidelity, Any] = {}

    # ---- variables and data

    def _space(self) -> DesignSpace | None:
        machine = self.machine
        if not machine.free:
            return None
        chosen = [
            variable(scene_path(path), span.lower, span.upper, machine.unit(path), span.scaling)
            for path, span in machine.free.items()
        ]
        return DesignSpace(chosen, machine.fence, machine.drive, parts=machine.parts)

    @property
    def _free_names(self) -> tuple[str, ...]:
        return () if self.space is None else self.space.names

    @property
    def variable_names(self) -> tuple[str, ...]:
        """The free numbers, by their names in a sorter file."""
        paths = {scene_path(path): path for path in self.machine.free}
        return tuple(paths.get(name, name) for name in self._free_names)

    def _free(self, path: str) -> str:
        """The name of a free number in the space."""
        if scene_path(path) not in self._free_names:
            raise ValueError(
                f"Argument `fixed` must name free numbers, of {', '.join(self.variable_names)}, "
                f"but holds {path!r}."
            )
        return scene_path(path)

    def _material_columns(self) -> tuple[str, ...]:
        """Paths of the numbers that differ between candidates."""
        several = len(self.machine.materials) > 1
        material = [f"fence.material.{name}" for name in _MATERIAL] if several else []
        return (*material, *(scene_path(path) for path in self.machine.choices))

    def _limits_of(self, candidate: Candidate) -> tuple[tuple[str, Limit], ...]:
        chosen = {p: v for p, v in candidate.numbers.items() if p.startswith("motor.")}
        machine = self.machine
        if chosen:
            parts = scene_numbers.replace(machine.parts, tuple(chosen), list(chosen.values()))
            machine = dataclasses.replace(machine, motor=parts.motor)
        found = limit_table.settled(machine.bounds, machine, candidate.material)
        unknown = set(candidate.bounds) - {name for name, _ in found}
        if unknown:
            raise ValueError(
                "Argument `bounds` must name limits of the sorter, "
                f"{', '.join(name for name, _ in found)}, but holds {', '.join(sorted(unknown))}."
            )
        return tuple(
            (name, dataclasses.replace(x, bound=float(candidate.bounds.get(name, x.bound))))
            for name, x in found
        )

    def limits(self, candidate: Candidate) -> tuple[tuple[str, Limit], ...]:
        """The limits by name, with their bounds for a candidate."""
        found, first = (self._limits_of(c) for c in (candidate, self.candidates[0]))
        limit_table.refuse_unlike(
            (candidate.material.name, [name for name, _ in found]),
            (self.candidates[0].material.name, [name for name, _ in first]),
        )
        return found

    def lanes(self, candidate: Candidate) -> dict[str, np.ndarray]:
        """The numbers of every parcel's sort by path, with the candidate's, each of shape (P,)."""
        parcels = self.machine.parcels
        columns = {path: v for path, v in parcels.columns.items() if path in self._names}
        material = _whole(candidate.material).material
        numbers = {
            **{f"fence.material.{name}": getattr(material, name) for name in _MATERIAL},
            **{scene_path(path): value for path, value in candidate.numbers.items()},
        }  # fmt: skip
        return {
            **{path: np.asarray(v, dtype=float) for path, v in columns.items()},
            **{path: np.full(parcels.count, float(numbers[path])) for path in self._columns},
            # NaN where the candidate does not fix the number.
            **{_FIXED + path: np.full(parcels.count, float(numbers.get(path, np.nan)))
               for path in (self._free_names[at] for at in self._fixed)},
        }  # fmt: skip

    def data(self, candidate: Candidate) -> tuple[Any, ...]:
        """The data of a run: lanes with their weights, bounds, units of the margins."""
        limits = [limit for _, limit in self.limits(candidate)]
        return (
            self._weighted(candidate),
            np.array([limit.bound for limit in limits]),
            np.array([limit.unit_of_margin for limit in limits]),
        )

    def _weighted(self, candidate: Candidate) -> dict[str, np.ndarray]:
        """The lanes of a candidate with their weights."""
        return {**self.lanes(candidate), "weight": self.machine.parcels.weights}

    # ---- the program

    def _values(self, z: Array) -> Array:
        return jnp.zeros(0) if self.space is None else self.space.from_shares(z)

    def values(self, z: ArrayLike) -> dict[str, float]:
        """The free numbers at z by name [SI]."""
        values = np.asarray(self._values(jnp.asarray(z, dtype=float)))
        return dict(zip(self.variable_names, values.tolist(), strict=True))

    def _scene(self, values: Array, lane: Mapping[str, Array]):
        for at in self._fixed:
            own = jnp.asarray(lane[_FIXED + self._free_names[at]])
            values = values.at[at].set(jnp.where(jnp.isnan(own), values[at], own))
        rest = [jnp.asarray(lane[name], dtype=float) for name in self._names[len(values) :]]
        return self._family.scene(jnp.concatenate([values, jnp.stack(rest)]))

    def scene(self, z: ArrayLike, candidate: Candidate, lane: int):
        """The sort of one parcel at a design, checked on the host."""
        lanes = {path: column[lane] for path, column in self.lanes(candidate).items()}
        return self._scene(self._values(jnp.asarray(z, dtype=float)), lanes)

    def scenes(self, z: ArrayLike, candidate: Candidate):
        """The sorts of all parcels at a design, each leaf with the lanes first; not checked."""
        values = self._values(jnp.asarray(z, dtype=float))
        return jax.vmap(lambda lane: self._scene(values, lane))(self.lanes(candidate))

    def _check_scenes(self) -> None:
        """Refuse a drive that is not home when the next parcel comes, and a parcel whose sort is
        impossible at the start of the first candidate: of many parcels the first ones are tried,
        and those with inconsistent numbers."""
        machine = self.machine
        cycle, period = float(machine.drive.cycle), machine.period
        leaves = not isinstance(machine.drive, HeldDrive) and not machine.drive_varies
        if period is not None and leaves and cycle > period * (1 + 1e-9):
            raise ValueError(
                f"Argument `period` must be at least the drive's cycle, {cycle:g} [s], but is "
                f"{period:g}: the fence would not be home when the next parcel comes."
            )
        parcels, start = machine.parcels, self._base_values()
        lanes = self.lanes(self.candidates[0])
        fine = jax.vmap(lambda lane: consistent(self._scene(start, lane)))(lanes)
        suspects = np.flatnonzero(~np.asarray(fine))
        for lane in dict.fromkeys([*suspects, *range(min(parcels.count, 32))]):
            try:
                self._scene(start, {path: column[lane] for path, column in lanes.items()})
            except ValueError as error:
                raise ValueError(f"parcel {parcels.text(int(lane))}: {error}") from error

    def _base_values(self) -> Array:
        return jnp.zeros(0) if self.space is None else self.space.base

    def _read(self, z: Array, lanes: Mapping[str, Array], fidelity: Fidelity):
        values = self._values(z)
        found = measured(
            lambda lane: self._scene(values, lane), lanes, self.quantities, fidelity, self.chunk
        )
        return found, found.pop("status")

    def _rows(self, name: str, numbers: Mapping[str, Array], weights: Array) -> Array:
        """The numbers that a limit bounds: one a lane, or a single one where it depends on the
        design alone or is a mean over the lanes."""
        quantity = self._quantities[name]
        rows = numbers[quantity.name]
        if name in self._means:
            return jnp.atleast_1d(risk.risk(rows, "mean", weights=weights))
        return rows[:1] if quantity.fields == () else rows

    def _combined(self, z, numbers, statuses, lanes, bounds, units):
        objective = self.machine.objective
        wanted = numbers[objective.quantity.name]
        if objective.quantity.fields == ():
            wanted = wanted[:1]
        elif objective.over != "worst":
            wanted = objective.over_parcels(wanted, lanes["weight"])
        margins = []
        for index, name in enumerate(self.limit_names):
            kept = 0.0 if self._quantities[name].fields == () else self.reserve
            rows = self._rows(name, numbers, lanes["weight"])
            left = self._signs[name] * (bounds[index] - rows)
            margins.append(left / units[index] - kept)
        return wanted, jnp.concatenate(margins) if margins else jnp.zeros(0)

    def with_objective(self, objective: Objective) -> "SorterProblem":
        """The same problem with another objective, one of `quantities`: both use the same compiled
        sorts.

        Raises `ValueError` for any other quantity.
        """
        if objective.quantity not in self.quantities:
            raise ValueError(
                "Argument `objective` must be of a quantity that is read, of "
                f"{', '.join(q.name for q in self.quantities)}, but is of "
                f"{objective.quantity.name}. Write also=(...) where the problem is made."
            )
        other = copy.copy(self)
        other.machine = dataclasses.replace(self.machine, objective=objective)
        other.program = self.program.combining(other._combined)
        return other

    # ---- measuring a design

    def measure(
        self, z: ArrayLike, candidate: Candidate, fidelity: Fidelity | None = None, *,
        refine: bool = True,
    ) -> Measured:
        """The quantities of every parcel's sort at a design, without derivatives; where `refine`,
        lanes in doubt are computed again, finer."""
        fidelity = self.fidelity if fidelity is None else fidelity
        ladder = fidelity.ladder() if refine else (fidelity,)
        for each in ladder:
            if each not in self._measures:
                self._measures[each] = jax.jit(
                    lambda z, lanes, rung=each: self._read(z, lanes, rung)
                )
        programs, point = [self._measures[each] for each in ladder], jnp.asarray(z, dtype=float)
        found = refined(
            lambda rung, lanes: programs[rung](point, lanes), self._weighted(candidate), len(ladder)
        )
        return Measured(dict(found.numbers), found.statuses, found.rungs)

    def bounded(self, name: str, found: Measured) -> np.ndarray:
        """The measured numbers that a limit bounds, one for each of its margins."""
        numbers = {name: jnp.asarray(values) for name, values in found.values.items()}
        return np.asarray(self._rows(name, numbers, jnp.asarray(self.machine.parcels.weights)))

    def limited(self, name: str) -> Quantity:
        """The quantity that a limit bounds."""
        return self._quantities[name]

    def unit(self, name: str) -> str:
        """The unit [SI] of a free number."""
        assert self.space is not None
        return self.space.variables[self.variable_names.index(name)].unit

    def judged(self, found: Measured, candidate: Candidate):
        """Objectives, margins without the reserve, and statuses of measured sorts: for
        `fencejax.verify`."""
        lanes, bounds, units = self.data(candidate)
        numbers = {name: jnp.asarray(values) for name, values in found.values.items()}
        objectives, margins = self._combined(None, numbers, found.statuses, lanes, bounds, units)
        kept = np.concatenate([
            np.full(rows, 0.0 if self._quantities[name].fields == () else self.reserve)
            for name, rows in zip(self.limit_names, self.margin_rows, strict=True)
        ]) if self.limit_names else np.zeros(0)  # fmt: skip
        return jnp.atleast_1d(objectives), margins + kept, found.statuses

    @property
    def margin_rows(self) -> tuple[int, ...]:
        """How many margins each limit has."""
        count = self.machine.parcels.count
        return tuple(
            1 if self._quantities[name].fields == () or name in self._means else count
            for name in self.limit_names
        )

    def margin(self, index: int) -> tuple[str, int | None]:
        """The limit, and the parcel, of a margin."""
        for name, rows in zip(self.limit_names, self.margin_rows, strict=True):
            if index < rows:
                return name, index if rows == self.machine.parcels.count and rows > 1 else None
            index -= rows
        raise IndexError(index)

    def troubles(self, statuses: np.ndarray) -> tuple[str, ...]:
        """The parcels whose sort has no reliable numbers, with the meaning of their status."""
        return tuple(
            f"{self.machine.parcels.text(lane)}: {Status(int(s)).name}, {Status(int(s)).text}"
            for lane, s in enumerate(statuses)
            if s > Status.LEFT_OVER_TIP
        )
