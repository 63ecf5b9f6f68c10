"""The physical bound of the front: the stop at a constant force.

The force that stops a mass m with the speed v_n over the travel s has at least the largest value
m v_n^2 / (2 s), its mean over the travel; a constant force attains it.
"""

import dataclasses
import math

import jax
import numpy as np

import fencejax as fj

from ..common.encounters import Encounter
from .problem import Tradeoff


@dataclasses.dataclass(frozen=True)
class Blow:
    """The blow with the largest force of an encounter.

    `speed` v_n [m/s], the normal approach speed of the corner and the fence at the touch; `mass`
    [kg], the parcel's inertia at that corner along the normal, 1 / (1 / m_p + a^2 / I_p) with a
    the arm of the normal about C_s.
    """

    speed: float
    mass: float

    def least_force(self, travel: float) -> float:
        """m v_n^2 / (2 s) [N] over a travel s [m], without friction, belt and the work of
        the drive during the blow."""
        return 0.5 * self.mass * self.speed**2 / travel


def blows(tradeoff: Tradeoff, z) -> list[Blow]:
    """The hardest blow of every encounter of a design."""
    course, encounters = tradeoff.course(fj.Fidelity.fast()), tradeoff.encounters
    space = tradeoff.space

    @jax.jit
    def run(z, encounters):
        fence, drive = space.apply(space.from_shares(z))

        def one(encounter):
            scene = course.scene(fence, drive, encounter)
            history = fj.simulate(scene, fidelity=course.fidelity, only=("history",)).history
            assert history is not None
            assert history.drive is not None
            contacts = [(c.normal, c.gap, c.gap_rate) for c in history.fence]
            return contacts, history.fence_force, history.drive.angle, history.body.angle

        return fj.each_lane(one, encounters)

    found = jax.device_get(run(z, jax.tree.map(np.asarray, encounters)))
    numbers = (1,) if course.kind == "impacts" else (1, 2)
    rows = []
    for lane in range(encounters.lanes):
        contacts, force, swing, turn = jax.tree.map(lambda part, lane=lane: part[lane], found)
        parcel = Encounter(**encounters.named(lane)).parcel
        rows.append(_hardest(parcel, numbers, contacts, force, swing, turn))
    return rows


def _hardest(parcel: fj.Parcel, numbers, contacts, force, swing, turn) -> Blow:
    peak = int(np.argmax(force))
    which = int(np.argmax([normal[peak] for normal, _, _ in contacts]))
    _, gap, rate = contacts[which]
    outside = np.flatnonzero(gap[: peak + 1] <= 0)
    touch = int(outside[-1]) if outside.size else 0
    speed = max(float(rate[touch]), float(rate[min(touch + 1, peak)]), 0.0)
    x, y = (float(part) for part in parcel.corner(numbers[which]))
    # The normal (-sin alpha_w, cos alpha_w) in the parcel's frame; its arm about C_s.
    tilt = float(swing[touch] - turn[touch])
    arm = x * math.cos(tilt) + y * math.sin(tilt)
    inertia = 1 / (1 / float(parcel.mass) + arm**2 / float(parcel.inertia))
    return Blow(speed, inertia)
