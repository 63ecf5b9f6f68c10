"""Encounters of parcels with the fence: whole sorts or single impacts, many of them in a batch."""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

import fencejax as fj
from fencejax.design import Quantity, sorting
from fencejax.parts import AbstractFriction
from fencejax.printing import shown
from fencejax.scenes import names
from fencejax.sorter import Machine
from fencejax.study import measured

KINDS = ("sorts", "impacts")
# The kind of scene of each, and the numbers of an encounter that it lacks.
_SCENES = {
    "sorts": ("whole_sort", ("distance", "drive_angle")),
    "impacts": ("oblique_impact", ("front", "offset", "angle")),
}
# Static over kinetic friction, as in the paper's numbers.
_BELT_RATIO, _FENCE_RATIO = 0.85 / 0.65, 0.5 / 0.35


class Encounter(NamedTuple):
    """The numbers of an encounter, or of many: then every field has the lanes as its first axis.

    `mass` [kg], `length` and `breadth` [m], `stiffness` k_p [N/m^4], `damping` b_p
    [N s kg^-0.4 m^-3] of the parcel; `belt_friction` and `fence_friction`, kinetic coefficients
    [1], the static ones being larger by the paper's ratios. Of a sort: `offset` Delta s [m],
    `angle` phi [rad] and `front` [m], where the parcel is when the drive starts. Of an impact:
    `distance` R [m] and `drive_angle` alpha_w [rad] of the first contact.
    """

    mass: ArrayLike = 15.0
    length: ArrayLike = 0.4
    breadth: ArrayLike = 0.3
    stiffness: ArrayLike = 1.72e9
    damping: ArrayLike = 3.3e5
    belt_friction: ArrayLike = 0.65
    fence_friction: ArrayLike = 0.35
    offset: ArrayLike = 0.0
    angle: ArrayLike = 0.0
    front: ArrayLike = 0.1
    distance: ArrayLike = 1.0
    drive_angle: ArrayLike = 0.30

    @property
    def parcel(self) -> fj.Parcel:
        """The parcel alone."""
        return fj.Parcel(
            mass=self.mass,
            length=self.length,
            breadth=self.breadth,
            stiffness=self.stiffness,
            damping=self.damping,
        )

    @classmethod
    def grid(cls, **columns: Sequence[float]) -> "Encounter":
        """Every combination of the values given, the last name's running fastest."""
        mesh = np.meshgrid(*columns.values(), indexing="ij")
        lanes = {name: values.ravel() for name, values in zip(columns, mesh, strict=True)}
        return cls(**lanes).wide()

    @classmethod
    def of(cls, machine: Machine, **columns: Sequence[float]) -> "Encounter":
        """Every parcel of a machine at its place, with every combination of other values."""
        parcels = machine.parcels
        numbers = {path.rpartition(".")[2]: values for path, values in parcels.columns.items()}
        unknown = set(numbers) - set(cls._fields)
        if unknown:
            raise ValueError(
                f"Argument `parcels` must give {', '.join(cls._fields[:5])} and places alone for "
                f"this job, but gives {', '.join(sorted(unknown))}."
            )
        for name, law in (
            ("belt_friction", machine.belt.friction), ("fence_friction", machine.fence_friction),
        ):  # fmt: skip
            numbers[name] = np.full(parcels.count, _kinetic(law))
        mesh = np.meshgrid(np.arange(parcels.count), *columns.values(), indexing="ij")
        lane, *others = (part.ravel() for part in mesh)
        lanes = {name: values[lane] for name, values in numbers.items()}
        return cls(**lanes, **dict(zip(columns, others, strict=True))).wide()

    def wide(self) -> "Encounter":
        """Every field as an array with the lanes as its first axis."""
        return Encounter(*(part.copy() for part in np.broadcast_arrays(*map(np.asarray, self))))

    @property
    def lanes(self) -> int:
        """The number of encounters."""
        return int(np.asarray(self.mass).shape[0])

    def text(self, lane: int) -> str:
        """An encounter by its mass and the numbers that differ between encounters:
        `"30 kg, offset 200 mm"`."""
        parts = []
        for name, part in self._asdict().items():
            values = np.asarray(part)
            if name == "mass" or np.ptp(values) > 0:
                known = names.known(name)
                number = shown(values[lane], "1" if known is None else known.unit)
                parts.append(number if name == "mass" else f"{name.replace('_', ' ')} {number}")
        return ", ".join(parts)

    def named(self, lane: int) -> dict[str, float]:
        """An encounter as plain numbers by name."""
        return {name: float(np.asarray(part)[lane]) for name, part in self._asdict().items()}


@dataclasses.dataclass(frozen=True)
class Course:
    """The simulation of encounters: `kind` (`"sorts"` or `"impacts"`), their `duration` [s], the
    `fidelity`, the most encounters in one vectorised call (`chunk`), and the `machine` with belt,
    border and frictions; `None` for the paper's."""

    kind: str
    duration: float
    fidelity: fj.Fidelity
    chunk: int = 64
    machine: Machine | None = None

    def scene(
        self, fence: fj.Fence, drive: fj.AbstractDrive, encounter: Encounter
    ) -> fj.Scene:
        """The scene of one encounter."""
        numbers = encounter._asdict()
        for part, usual in (("belt", _BELT_RATIO), ("fence", _FENCE_RATIO)):
            kinetic, ratio = jnp.asarray(numbers.pop(f"{part}_friction")), self._ratio(part, usual)
            if ratio is not None:
                numbers[f"{part}_kinetic_friction"] = kinetic
                numbers[f"{part}_static_friction"] = kinetic * ratio
        kind, others = _SCENES[self.kind]
        given = {name: value for name, value in numbers.items() if name not in others}
        if self.machine is None:
            family = fj.SceneFamily(
                kind, tuple(given), fence=fence, drive=drive, duration=self.duration
            )
        else:
            machine = dataclasses.replace(self.machine, fence=fence, drive=drive)
            family = machine.family(tuple(given), kind=kind, duration=self.duration)
        return family.scene(jnp.stack([jnp.asarray(value, float) for value in given.values()]))

    def check(self, fence: fj.Fence, drive: fj.AbstractDrive, encounters: Encounter) -> None:
        """Make the scene of every encounter on the host, without compiling anything.

        Raises `ValueError` that names the encounter and its number where there is no such scene.
        """
        for lane in range(encounters.lanes):
            try:
                self.scene(fence, drive, Encounter(**encounters.named(lane)))
            except ValueError as error:
                raise ValueError(f"{encounters.text(lane)}: {error}") from error

    def _ratio(self, part: str, usual: float) -> float | None:
        """Static over kinetic friction of `"belt"` or `"fence"`; `None` without friction there."""
        if self.machine is None:
            return usual
        law = self.machine.belt.friction if part == "belt" else self.machine.fence_friction
        kinetic = _kinetic(law)
        if law is None:
            return None
        assert isinstance(law, (fj.Friction, fj.friction_laws.Stribeck))
        return float(law.static) / kinetic if kinetic else 1.0

    def measure(
        self,
        fence: fj.Fence,
        drive: fj.AbstractDrive,
        encounters: Encounter,
        quantities: Sequence[Quantity],
    ) -> dict[str, Array]:
        """The quantities by name and `status`, one number a lane. Differentiable."""
        return measured(
            lambda encounter: self.scene(fence, drive, encounter), encounters, quantities,
            self.fidelity, self.chunk,
        )  # fmt: skip

    def constant_push(
        self, fence: fj.Fence, drive: fj.AbstractDrive, encounters: Encounter, past: float = 0.0
    ) -> np.ndarray:
        """The force [N] of a constant push of each lane's parcel, of whole sorts (see
        `fencejax.design.sorting.constant_push`)."""
        def one(encounter):
            return sorting.constant_push(self.scene(fence, drive, encounter), past)

        return np.asarray(jax.jit(lambda lanes: fj.each_lane(one, lanes))(encounters))


def inflexible(fidelity: fj.Fidelity) -> fj.Fidelity:
    """The same fidelity with a rigid fence."""
    return fidelity.replace(modes=0, static_correction=False)


def _kinetic(law: AbstractFriction | None) -> float:
    """The kinetic coefficient of a law of friction."""
    if law is None:
        return 0.0
    assert isinstance(law, (fj.Friction, fj.friction_laws.Stribeck))
    return float(law.kinetic)
