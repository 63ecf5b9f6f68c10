"""The two quantities of a front as one compiled problem: the bound of the second is data."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

import fencejax as fj
from fencejax.design import Program, objectives

from ..common.encounters import Course, Encounter
from .configuration import ParetoConfig

FORCE, OTHER = 0.0, 1.0
"""What is minimised: the worst peak force, or the other quantity."""


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
        kinds, counts = np.unique(self.lanes["status"], return_counts=True)
        return {fj.Status(int(k)).name: int(n) for k, n in zip(kinds, counts, strict=True)}


class Tradeoff:
    """Peak force against another quantity, over all encounters, under the limits."""

    def __init__(self, config: ParetoConfig):
        self.config, self.space = config, config.space
        self.quantity, self.limits = config.quantity, config.limits
        if config.kind == "impacts":
            lanes = dict(distance=config.distances, mass=config.masses)
            self.encounters = Encounter.grid(**lanes, drive_angle=(config.drive_angle,))
        else:
            lanes = dict(offset=config.offsets, mass=config.masses)
            self.encounters = Encounter.grid(**lanes, front=(config.front,))
        quantities = (objectives.PEAK_FORCE, self.quantity, *(x.quantity for x in self.limits))
        named = {q.name: q for q in (*quantities, objectives.TIP_DEFLECTION)}
        self._quantities = tuple({**named, "indentation": objectives.INDENTATION}.values())
        self._needed = tuple({q.name: q for q in quantities}.values())
        base = self.space.values_of(self.space.fence, self.space.drive)
        self.start = np.asarray(self.space.to_unconstrained(base))
        self.program = Program(self.margins_at(config.fidelity))
        self.loose = 1e6
        self._measure = {}

    def course(self, fidelity: str) -> Course:
        """How the encounters are run at a fidelity."""
        return Course(self.config.kind, self.config.length, getattr(fj.Fidelity, fidelity)())

    def _read(self, course: Course, z: Array, quantities) -> dict[str, Array]:
        fence, drive = self.space.apply(self.space.from_unconstrained(z))
        return course.measure(fence, drive, self.encounters, quantities)

    def margins_at(self, fidelity: str):
        """The problem at a fidelity: z, what is minimised, the bound and the unit of the other
        quantity -> objectives, margins, statuses."""
        course = self.course(fidelity)

        def problem(z, minimised, bound, unit):
            read = self._read(course, z, self._needed)
            return self._combined(read, minimised, bound, unit, self.config.reserve)

        return problem

    def _combined(self, read, minimised, bound, unit, reserve):
        other = read[self.quantity.name]
        # A number of the design is the same in every encounter: one limit is enough.
        rows = other if self.quantity.fields else other[:1]
        margins = [limit.margin_of(read[limit.name]) - reserve for limit in self.limits]
        margins.append((bound - rows) / unit)
        wanted = jnp.where(minimised == FORCE, read["peak_force"], other)
        return wanted, jnp.concatenate(margins), read["status"]

    def measure(self, fidelity: str, z) -> Measured:
        """Everything there is to say about a design, at a fidelity."""
        if fidelity not in self._measure:
            course = self.course(fidelity)
            self._measure[fidelity] = jax.jit(lambda z: self._read(course, z, self._quantities))
        read = jax.device_get(self._measure[fidelity](jnp.asarray(z)))
        lanes = {name: np.asarray(values) for name, values in read.items()}
        return Measured(
            float(np.max(lanes["peak_force"])), float(np.max(lanes[self.quantity.name])), lanes
        )

    def judged(self, measured: Measured, minimised: float, bound: float, unit: float):
        """Objectives, margins with nothing kept in hand, and statuses from what was measured: for
        `fencejax.verify`."""
        return self._combined(measured.lanes, minimised, bound, unit, 0.0)
