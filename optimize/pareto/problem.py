"""The two quantities of a front as one compiled problem: the bound of the second is data."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

import fencejax as fj
from fencejax.design import LaneProgram, objectives
from fencejax.results import counted, refined

from ..common.encounters import Course, Encounter, inflexible
from .configuration import ParetoConfig

FORCE, OTHER = 0.0, 1.0
"""Codes of the objective: the worst peak force, or the other quantity."""


@dataclasses.dataclass(frozen=True)
class Measured:
    """A design's worst peak force [N], the other quantity [its unit] at its largest, and every
    quantity by name, one number an encounter."""

    force: float
    other: float
    lanes: dict[str, np.ndarray]

    @property
    def statuses(self) -> dict[str, int]:
        """How often each status occurred, by name."""
        return counted(self.lanes["status"])


class Tradeoff:
    """Peak force against another quantity, over all encounters, under the limits."""

    def __init__(self, config: ParetoConfig):
        self.config, self.space = config, config.space
        self.quantity, self.limits = config.quantity, config.limits
        impacts = dict(distance=config.distances, drive_angle=(config.drive_angle,))
        if config.machine is not None:
            others = impacts if config.kind == "impacts" else {}
            self.encounters = Encounter.of(config.machine, **others)
        elif config.kind == "impacts":
            self.encounters = Encounter.grid(mass=config.masses, **impacts)
        else:
            lanes = dict(offset=config.offsets, mass=config.masses)
            self.encounters = Encounter.grid(**lanes, front=(config.front,))
        quantities = (objectives.PEAK_FORCE, self.quantity, *(x.quantity for x in self.limits))
        named = {q.name: q for q in (*quantities, objectives.TIP_DEFLECTION)}
        self._quantities = tuple({**named, "indentation": objectives.INDENTATION}.values())
        self._needed = tuple({q.name: q for q in quantities}.values())
        base = self.space.values_of(self.space.fence, self.space.drive)
        self.start = np.asarray(self.space.to_shares(base))
        self.program = LaneProgram(
            lambda z, encounters, fidelity: self._read(z, encounters, fidelity, self._needed),
            lambda z, read, statuses, encounters, *data: self._combined(
                read, *data, reserve=config.reserve
            ),
            getattr(fj.Fidelity, config.fidelity)().ladder(),
        )
        self.loose = 1e6
        self._measure = {}

    @property
    def belt(self) -> fj.Belt:
        """The belt of all encounters."""
        return fj.Belt() if self.config.machine is None else self.config.machine.belt

    def check(self) -> None:
        """Raise `ValueError` for impossible encounters, before anything is compiled."""
        course = self.course(fj.Fidelity.fast())
        course.check(self.space.fence, self.space.drive, self.encounters)

    def course(self, fidelity: fj.Fidelity) -> Course:
        """The simulation of the encounters at a fidelity."""
        return Course(self.config.kind, self.config.length, fidelity, machine=self.config.machine)

    def _read(self, z: Array, encounters: Encounter, fidelity: fj.Fidelity, quantities):
        """The quantities by name and the statuses, one number an encounter."""
        fence, drive = self.space.apply(self.space.from_shares(z))
        read = self.course(fidelity).measure(fence, drive, encounters, quantities)
        return read, read.pop("status")

    def _combined(self, read, minimised, bound, unit, reserve):
        other = read[self.quantity.name]
        # A number of the design is the same in every encounter: one limit is enough.
        rows = other if self.quantity.fields else other[:1]
        margins = [limit.margin_of(read[limit.name]) - reserve for limit in self.limits]
        margins.append((bound - rows) / unit)
        wanted = jnp.where(minimised == FORCE, read["peak_force"], other)
        return wanted, jnp.concatenate(margins)

    def measure(self, fidelity: str, z, least: np.ndarray | None = None) -> Measured:
        """All quantities of a design at a fidelity, or at a finer one for encounters in doubt; each
        encounter from its rung `least` on."""
        if fidelity not in self._measure:
            self._measure[fidelity] = [
                jax.jit(
                    lambda z, lanes, rung=rung: self._read(z, lanes, rung, self._quantities)
                )
                for rung in getattr(fj.Fidelity, fidelity)().ladder()
            ]
        ladder = self._measure[fidelity]
        found = refined(
            lambda rung, lanes: ladder[rung](jnp.asarray(z), lanes),
            self.encounters, len(ladder), least,
        )
        lanes = {**found.numbers, "status": found.statuses}
        return Measured(
            float(np.max(lanes["peak_force"])), float(np.max(lanes[self.quantity.name])), lanes
        )

    def stiff(self, z) -> float:
        """The largest peak force [N] by a rigid fence of the same shape."""
        fidelity = inflexible(fj.Fidelity.fast())
        found = jax.jit(
            lambda z, lanes: self._read(z, lanes, fidelity, (objectives.PEAK_FORCE,))[0]
        )(jnp.asarray(z), self.encounters)
        return float(np.max(found["peak_force"]))

    def judged(self, measured: Measured, minimised: float, bound: float, unit: float):
        """Objectives, margins without the reserve, and statuses of measured encounters: for
        `fencejax.verify`."""
        pair = self._combined(measured.lanes, minimised, bound, unit, 0.0)
        return *pair, measured.lanes["status"]
