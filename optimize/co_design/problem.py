"""Fence and motion as one design problem over whole sorts."""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

import fencejax as fj
from fencejax.design import LaneProgram, extremes, objectives, ring_amplitude
from fencejax.results import refined

from ..common import nearby, starts
from ..common.encounters import Course, Encounter, inflexible
from .configuration import CoDesignConfig

_DRIVE = {"speed": "rad/s", "acceleration": "rad/s^2", "jerk": "rad/s^3"}


def _of_motion(name: str) -> bool:
    """Whether a variable belongs to the drive's motion."""
    return name.startswith("control_angles") or name == "cycle_time"


class Joint:
    """The problem of fence, material and motion."""

    def __init__(self, config: CoDesignConfig):
        self.config, self.space, self.limits = config, config.space, config.limits
        if config.machine is None:
            self.encounters = Encounter.grid(
                offset=config.offsets, mass=config.masses, front=(config.front,)
            )
        else:
            self.encounters = Encounter.of(config.machine)
        quantities = (objectives.PEAK_FORCE, *(x.quantity for x in self.limits))
        self._quantities = (*quantities, objectives.RING_ENERGY)
        base = self.space.values_of(self.space.fence, self.space.drive)
        start = np.asarray(self.space.to_shares(base))
        fence = [k for k, name in enumerate(self.space.names) if not _of_motion(name)]
        self.starts = starts.spread(start, config.starts, fence)
        self.program = LaneProgram(
            self.sorts,
            lambda z, found, statuses, encounters: self.combined(
                self.completed(z, found), config.reserve
            ),
            getattr(fj.Fidelity, config.fidelity)().ladder(),
            ahead=True,
        )
        self._measure = [
            jax.jit(lambda z, encounters, rung=rung: self.sorts(z, encounters, rung))
            for rung in getattr(fj.Fidelity, config.verify)().ladder()
        ]
        stiff = inflexible(getattr(fj.Fidelity, config.verify)())
        self._stiff = jax.jit(lambda z, encounters: self.sorts(z, encounters, stiff)[0])

    def check(self) -> None:
        """Raise `ValueError` for impossible sorts, before anything is compiled."""
        config = self.config
        course = Course("sorts", config.seconds, fj.Fidelity.fast(), machine=config.machine)
        course.check(self.space.fence, self.space.drive, self.encounters)

    def sorts(self, z: Array, encounters: Encounter, fidelity: fj.Fidelity):
        """Every quantity by name and the statuses, one number a sort."""
        fence, drive = self.space.apply(self.space.from_shares(z))
        course = Course("sorts", self.config.seconds, fidelity, machine=self.config.machine)
        found = course.measure(fence, drive, encounters, self._quantities)
        return found, found.pop("status")

    def completed(self, z: Array, found: dict[str, Array]) -> dict[str, Array]:
        """The same with `ring_amplitude` [m], one a sort; and of the drive the `speed`,
        `acceleration` and `jerk` (see `fencejax.design.spline_motion.Extremes`)."""
        fence, drive = self.space.apply(self.space.from_shares(z))
        assert isinstance(drive, fj.SplineDrive)
        rings = ring_amplitude(found["ring_energy"], fence)
        return {**found, "ring_amplitude": rings, **extremes(drive)._asdict()}

    def read(self, z: Array, fidelity: fj.Fidelity) -> dict[str, Array]:
        """All quantities, and `status`, at one fidelity."""
        found, statuses = self.sorts(z, self.encounters, fidelity)
        return {**self.completed(z, found), "status": statuses}

    def margins(self, read) -> dict[str, Array]:
        """Margins [1] by the limits' names: one a sort, or one a span or knot of the motion."""
        config = self.config
        rows = {limit.name: limit.margin_of(read[limit.name]) for limit in self.limits}
        rows["ring_amplitude"] = 1 - read["ring_amplitude"] / config.ring_bound
        for name in ("speed", "acceleration", "jerk"):
            rows[name] = 1 - jnp.abs(read[name]) / getattr(config, f"{name}_limit")
        return rows

    def combined(self, read, reserve: float):
        """Objectives and margins; the reserve applies to margins that depend on the fidelity."""
        exact = ("speed", "acceleration", "jerk")
        rows = [
            jnp.asarray(row) - (0.0 if name in exact else reserve)
            for name, row in self.margins(read).items()
        ]
        return read["peak_force"], jnp.concatenate(rows)

    def stiff(self, z) -> float:
        """The largest peak force [N] by a rigid fence of the same shape."""
        return float(np.max(self._stiff(jnp.asarray(z), self.encounters)["peak_force"]))

    def push(self, z) -> float:
        """The constant force [N] that the hardest parcel would need to get as far past the belt's
        edge as required."""
        config = self.config
        course = Course("sorts", config.seconds, fj.Fidelity.fast(), machine=config.machine)
        past = max((x.bound for x in self.limits if x.name == "crossing"), default=0.0)
        fence, drive = self.space.apply(self.space.from_shares(z))
        return float(np.max(course.constant_push(fence, drive, self.encounters, past)))

    def rows(self, found: Mapping[str, np.ndarray]) -> list[nearby.Rows]:
        """The description of the search's margins, in their order."""
        config = self.config
        counts = {name: np.size(row) for name, row in self.margins(found).items()}
        rows = [nearby.Rows.of(limit, counts[limit.name]) for limit in self.limits]
        ring = config.ring_bound
        rows.append(nearby.Rows("ring_amplitude", ring, "m", ring, True, counts["ring_amplitude"]))
        for name, unit in _DRIVE.items():
            bound = getattr(config, f"{name}_limit")
            rows.append(nearby.Rows(name, bound, unit, bound, True, counts[name]))
        return rows

    def measure(self, z) -> dict[str, np.ndarray]:
        """The quantities at the fidelity of the verification, or at a finer one where they are in
        doubt there, on the host."""
        found = refined(
            lambda rung, lanes: self._measure[rung](jnp.asarray(z), lanes), self.encounters,
            len(self._measure),
        )  # fmt: skip
        read = {**self.completed(jnp.asarray(z), found.numbers), "status": found.statuses}
        return {name: np.asarray(values) for name, values in jax.device_get(read).items()}
