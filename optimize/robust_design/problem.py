"""What parcels as they come make of a design, as numbers of the whole sample."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

import fencejax as fj
from fencejax.design import Program, objectives, risk, shock

from ..common.encounters import Course, Encounter
from .configuration import RobustConfig


class Population:
    """The design problem over a sample of parcels, which is data: any sample of a size serves."""

    def __init__(self, config: RobustConfig):
        self.config, self.space, self.limits = config, config.space, config.limits
        self._quantities = (objectives.PEAK_FORCE, *(limit.quantity for limit in self.limits))
        base = self.space.values_of(self.space.fence, self.space.drive)
        self.start = np.asarray(self.space.to_unconstrained(base))
        self.program = Program(self.statistics)
        self._judge = jax.jit(lambda z, encounters: self._lanes(z, encounters, True))

    def _lanes(self, z: Array, encounters: Encounter, check: bool) -> dict[str, Array]:
        config = self.config
        name = config.check_fidelity if check else config.fidelity
        course = Course(
            config.scenes, config.seconds, getattr(fj.Fidelity, name)(), config.chunk
        )
        fence, drive = self.space.apply(self.space.from_unconstrained(z))
        read = course.measure(fence, drive, encounters, self._quantities)
        finite = jnp.ones_like(read["peak_force"], dtype=bool)
        for values in read.values():
            finite = finite & jnp.isfinite(values)
        read["valid"] = finite & (read["status"] < fj.Status.STEP_TOO_COARSE)
        return read

    def harm(self, force: Array, encounters: Encounter) -> Array:
        """The severity of the blows."""
        if self.config.severity == "g_load":
            return shock.g_load(force, jnp.asarray(encounters.mass))
        if self.config.severity == "drop_height":
            return shock.drop_height(force, encounters.parcel)
        return force

    def statistics(self, z: Array, encounters: Encounter):
        """The measure of the severity; of each limit the margin that the stated fraction of
        parcels has at least; the statuses.

        Parcels whose numbers are bad are left out of the measure and count as breaking every
        limit.
        """
        config = self.config
        read = self._lanes(z, encounters, False)
        valid = read["valid"]
        harm = self.harm(read["peak_force"], encounters)
        measure = risk.risk(harm, config.measure, config.level, valid)
        rows = [jnp.where(valid, x.margin_of(read[x.name]), -1.0) for x in self.limits]
        margins = [risk.quantile(row, 1 - config.fraction) for row in rows]
        return measure, jnp.stack(margins), read["status"]

    def judge(self, z, encounters: Encounter) -> dict[str, np.ndarray]:
        """Every parcel's numbers at the check's fidelity, and its `severity`, without
        derivatives."""
        numbers = jax.tree.map(jnp.asarray, encounters)
        read = {k: np.asarray(v) for k, v in self._judge(jnp.asarray(z), numbers).items()}
        read["severity"] = np.asarray(self.harm(jnp.asarray(read["peak_force"]), numbers))
        return read
