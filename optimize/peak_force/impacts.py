"""The impacts that a fence is designed for, in one batch, and their objective and limits."""

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

import fencejax as fj
from fencejax.design import DesignSpace, Limit, Quantity, objectives
from fencejax.plot import Trace
from fencejax.printing import shown
from fencejax.sorter import Machine


@dataclasses.dataclass(frozen=True)
class Impacts:
    """Oblique impacts at several distances [m], each by parcels of several masses [kg].

    Their `duration` [s] is long enough to see whether the parcel is diverted. `machine`: with belt,
    frictions and sizes of the parcels; `None` for the paper's.
    """

    distances: tuple[float, ...]
    masses: tuple[float, ...]
    drive_angle: float
    duration: float
    machine: Machine | None = None

    @property
    def lanes(self) -> tuple[tuple[float, float], ...]:
        """(distance, mass) of every lane."""
        return tuple((d, m) for d in self.distances for m in self.masses)

    def text(self, lane: int) -> str:
        """A lane in words: `"15 kg at R = 1 m"`."""
        distance, mass = self.lanes[lane]
        return f"{shown(mass, 'kg')} at R = {shown(distance, 'm')}"

    def parcel(self, mass) -> fj.Parcel:
        """The parcel of a mass [kg], otherwise the machine's, if there is one."""
        if self.machine is None:
            return fj.Parcel(mass=mass)
        family = self.machine.family(("mass",), kind="oblique_impact", duration=self.duration)
        return family.scene(jnp.asarray(mass)[None]).parcel

    def scene(self, fence: fj.Fence, drive: fj.AbstractDrive, distance, mass) -> fj.Scene:
        """One of the impacts."""
        if self.machine is not None:
            machine = dataclasses.replace(self.machine, fence=fence, drive=drive)
            fixed = {"drive_angle": self.drive_angle}
            family = machine.family(
                ("distance", "mass"), kind="oblique_impact", fixed=fixed, duration=self.duration
            )
            return family.scene(jnp.stack([jnp.asarray(distance), jnp.asarray(mass)]))
        return fj.scenes.oblique_impact(
            fence=fence,
            drive=drive,
            distance=distance,
            drive_angle=self.drive_angle,
            parcel=self.parcel(mass),
            duration=self.duration,
        )

    def check(self, fence: fj.Fence, drive: fj.AbstractDrive) -> None:
        """Make the scene of every lane on the host, without compiling anything.

        Raises `ValueError` that names the lane and its number where there is no such scene.
        """
        for lane, (distance, mass) in enumerate(self.lanes):
            try:
                self.scene(fence, drive, distance, mass)
            except ValueError as error:
                raise ValueError(f"{self.text(lane)}: {error}") from error


Measurement = dict[str, Array]
"""Values of the objective, the peak force and every limited quantity by name, one a lane; also
`status`."""


def measure(
    fence: fj.Fence,
    drive: fj.AbstractDrive,
    impacts: Impacts,
    limits: tuple[Limit, ...],
    fidelity: fj.Fidelity,
    *,
    objective: Quantity = objectives.PEAK_FORCE,
    signals: bool = True,
) -> tuple[Measurement, Trace | None]:
    """The quantities of a fence's impacts and, with `signals`, their signals and the fence's mass.
    Differentiable."""
    quantities = (objective, objectives.PEAK_FORCE, *(limit.quantity for limit in limits))
    if signals:
        quantities = (*quantities, objectives.FENCE_MASS)

    def one(distance, mass):
        scene = impacts.scene(fence, drive, distance, mass)
        only = None if signals else objectives.fields(quantities)
        own = objectives.measures(quantities)
        result = fj.simulate(
            scene, fidelity=fidelity, history=signals, only=only, measures=own
        )
        read = {q.name: q(result, scene) for q in quantities}
        read["status"] = result.status
        history = result.history
        if history is None:
            return read, None
        return read, Trace(history.time, history.fence_force, history.tip_deflection)

    distances, masses = (jnp.asarray(column) for column in zip(*impacts.lanes, strict=True))
    return fj.each_lane(lambda lane: one(*lane), (distances, masses))


def margins(limits: tuple[Limit, ...], measured: Measurement) -> dict[str, Array]:
    """Margins [1] by the limits' names, one a lane."""
    return {limit.name: limit.margin_of(measured[limit.name]) for limit in limits}


def problem(
    space: DesignSpace,
    impacts: Impacts,
    limits: tuple[Limit, ...],
    reserve: float,
    objective: Quantity = objectives.PEAK_FORCE,
):
    """z, fidelity -> the objective of every impact, margins less `reserve` [1], statuses: for
    `fencejax.Program`."""

    def evaluate(z, fidelity):
        fence, drive = space.apply(space.from_shares(z))
        measured, _ = measure(
            fence, drive, impacts, limits, fidelity, objective=objective, signals=False
        )
        rows = list(margins(limits, measured).values())
        left = jnp.concatenate(rows) - reserve if rows else jnp.zeros(0)
        return measured[objective.name], left, measured["status"]

    return evaluate


def whole_sort(
    fence: fj.Fence, drive: fj.AbstractDrive, front: float, mass, duration: float,
    machine: Machine | None = None,
) -> fj.Scene:  # fmt: skip
    """The whole sort of a parcel of a mass [kg]; `machine` as of `Impacts`."""
    if machine is None:
        return fj.scenes.whole_sort(
            front=front, fence=fence, drive=drive, parcel=fj.Parcel(mass=mass), duration=duration
        )
    own = dataclasses.replace(machine, fence=fence, drive=drive)
    family = own.family(("mass",), fixed={"front": front}, duration=duration)
    return family.scene(jnp.asarray(mass)[None])


def whole_sorts(
    fence: fj.Fence,
    drive: fj.AbstractDrive,
    front: float,
    masses: tuple[float, ...],
    duration: float,
    machine: Machine | None = None,
) -> Measurement:
    """The distances beyond the belt's edge that parcels reach in whole sorts [m], their peak forces
    [N] and statuses, one a mass; a check without derivatives."""

    needed = objectives.fields([objectives.PEAK_FORCE, objectives.CROSSING])

    def one(mass):
        scene = whole_sort(fence, drive, front, mass, duration, machine)
        result = fj.simulate(scene, only=needed)
        return {
            "crossing": objectives.CROSSING(result, scene),
            "peak_force": result.peak_force,
            "status": result.status,
        }

    return fj.each_lane(one, jnp.asarray(masses))


def stiff_forces(impacts: Impacts, drive: fj.AbstractDrive, belt_speed: float) -> np.ndarray:
    """N_stiff [N] of every lane: the same parcel, its stiffness and damping included, at the same
    normal approach speed against a rigid obstacle."""
    rate = float(drive.motion(drive.time_at(impacts.drive_angle)).speed)
    distances, masses = (jnp.asarray(column) for column in zip(*impacts.lanes, strict=True))
    speeds = belt_speed * np.sin(impacts.drive_angle) + distances * rate

    def one(speed, mass):
        scene = fj.scenes.rigid_wall(speed=speed, parcel=impacts.parcel(mass))
        return fj.simulate(scene, history=False, only=("peak_force",)).peak_force

    return np.asarray(fj.each_lane(lambda lane: one(*lane), (speeds, masses)))
