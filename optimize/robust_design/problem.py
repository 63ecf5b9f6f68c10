"""The robust design problem: statistics over a sample of parcels."""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

import fencejax as fj
from fencejax.design import LaneProgram, objectives, risk, shock
from fencejax.results import refined

from ..common.encounters import Course, Encounter, inflexible
from .configuration import RobustConfig
from .parcels import ends


class Population:
    """The design problem over a sample of parcels. The sample is data: any of the same size
    fits."""

    def __init__(self, config: RobustConfig):
        self.config, self.space, self.limits = config, config.space, config.limits
        self._quantities = (objectives.PEAK_FORCE, *(limit.quantity for limit in self.limits))
        base = self.space.values_of(self.space.fence, self.space.drive)
        self.start = np.asarray(self.space.to_shares(base))
        self.program = LaneProgram(
            self._lanes, self.statistics, getattr(fj.Fidelity, config.fidelity)().ladder()
        )
        ladder = getattr(fj.Fidelity, config.check_fidelity)().ladder()
        self._judge = [
            jax.jit(lambda z, encounters, fidelity=fidelity: self._lanes(z, encounters, fidelity))
            for fidelity in ladder
        ]
        stiff = inflexible(ladder[0])
        self._stiff = jax.jit(lambda z, encounters: self._lanes(z, encounters, stiff))

    def check(self) -> None:
        """Raise `ValueError` where an encounter at an end of the spans, or of the sorter's first
        parcel, is impossible, before anything is compiled."""
        config = self.config
        course = Course(config.scenes, config.seconds, fj.Fidelity.fast(), machine=config.machine)
        course.check(self.space.fence, self.space.drive, ends(config))

    def _lanes(self, z: Array, encounters: Encounter, fidelity: fj.Fidelity):
        """The quantities by name and the statuses, one number a parcel."""
        config = self.config
        course = Course(config.scenes, config.seconds, fidelity, config.chunk, config.machine)
        fence, drive = self.space.apply(self.space.from_shares(z))
        read = course.measure(fence, drive, encounters, self._quantities)
        return read, read.pop("status")

    @staticmethod
    def valid(read: Mapping[str, ArrayLike], statuses: ArrayLike) -> Array:
        """Which parcels have finite numbers of a consistent scene."""
        valid = jnp.asarray(statuses) < fj.Status.INCONSISTENT
        for values in read.values():
            valid = valid & jnp.isfinite(values)
        return valid

    def harm(self, force: Array, encounters: Encounter) -> Array:
        """The severity of the blows."""
        if self.config.severity == "g_load":
            return shock.g_load(force, jnp.asarray(encounters.mass))
        if self.config.severity == "drop_height":
            return shock.drop_height(force, encounters.parcel)
        return force

    def statistics(
        self, z: Array, read: dict[str, Array], statuses: Array, encounters: Encounter
    ):
        """The measure of the severity, and for each limit the margin that the stated fraction of
        parcels reaches.

        Parcels without numbers are left out of the measure and count as breaking every limit.
        """
        config = self.config
        valid = self.valid(read, statuses)
        harm = self.harm(read["peak_force"], encounters)
        measure = risk.risk(harm, config.measure, config.level, valid)
        rows = [jnp.where(valid, x.margin_of(read[x.name]), -1.0) for x in self.limits]
        margins = [risk.quantile(row, 1 - config.fraction) for row in rows]
        return measure, jnp.stack(margins)

    def stiff(self, z, encounters: Encounter) -> float:
        """The measure of the severity by a rigid fence of the same shape."""
        read, statuses = self._stiff(jnp.asarray(z), encounters)
        harm, config = self.harm(read["peak_force"], encounters), self.config
        return float(risk.risk(harm, config.measure, config.level, self.valid(read, statuses)))

    def judge(self, z, encounters: Encounter) -> dict[str, np.ndarray]:
        """Every parcel's numbers at the check's fidelity, or at a finer one where they are in
        doubt there (`rung`), and its `status` and `severity`, without derivatives."""
        found = refined(
            lambda rung, lanes: self._judge[rung](jnp.asarray(z), lanes), encounters,
            len(self._judge),
        )  # fmt: skip
        read = dict(found.numbers)
        severity = self.harm(jnp.asarray(read["peak_force"]), encounters)
        valid = self.valid(read, found.statuses)
        return {
            **read, "status": found.statuses, "rung": found.rungs, "valid": np.asarray(valid),
            "severity": np.asarray(severity),
        }  # fmt: skip
