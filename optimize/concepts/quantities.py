"""Quantities that are limited alike for all concepts, whichever part is compliant."""

import jax.numpy as jnp
from jaxtyping import Array

from fencejax.design import Quantity, objectives, ring_amplitude, shock
from fencejax.results import Accumulator, Measure, Sample, Step


def _lag(sample: Sample, reach: Array) -> Array:
    """The tip's lag behind the motor's position [m]."""
    behind = sample.tip_deflection
    return behind if sample.twist is None else behind - reach * sample.twist


def _largest_lag(state: Array, step: Step) -> Array:
    fence = getattr(step.scene, "fence", None)
    if fence is None:
        return state
    return jnp.maximum(state, jnp.abs(_lag(step.now, fence.reach)))


TIP_GIVE = objectives.of_measure(
    Measure(
        "tip_give", "m", "how far the tip gets behind where the motor holds it, at most: bending, "
        "and the turn of the shaft with what its clutch has slipped", "at least 0",
        Accumulator("tip give", lambda nothing, body: nothing.time, _largest_lag),
        lambda state: state,
    ),
    needs=("fence",),
)  # fmt: skip
"""|w_tip - R theta| [m] at samples; the tip's deflection alone where no shaft is compliant. A limit
on the deflection alone would treat a soft shaft more favourably than a soft fence."""


def _energy(sample: Sample) -> Array:
    return sample.energy.fence + sample.energy.strain


def _when_home(state: Array, step: Step) -> Array:
    """The energy at the end of the drive's cycle, interpolated linearly between samples; before
    that, and where a scene ends earlier, the latest one."""
    drive = getattr(step.scene, "drive", None)
    if drive is None:
        return state
    before, now = step.before.time, step.now.time
    span = jnp.where(now > before, now - before, 1.0)
    share = jnp.clip((drive.cycle - before) / span, 0.0, 1.0)
    ends = _energy(step.before), _energy(step.now)
    return jnp.where(before < drive.cycle, ends[0] + share * (ends[1] - ends[0]), state)


_HOME_ENERGY = Measure(
    "home_energy", "J", "what the fence's motion and bending, and a torque drive, hold at the end "
    "of the cycle",
    "at least 0", Accumulator("home energy", lambda nothing, body: nothing.time, _when_home),
    lambda state: state,
)  # fmt: skip
HOME_RING = Quantity(
    "home_ring", "m", "amplitude of the tip when the drive is home, all that the fence then holds "
    "taken for its first mode",
    lambda result, scene: ring_amplitude(result.home_energy, scene.fence, scene.drive),
    needs=("fence",),
    fields=("home_energy",),
    measures=(_HOME_ENERGY,),
)  # fmt: skip
"""The fence's residual oscillation at the earliest time for the next sort, independent of the rate.
For a torque drive it is the tip's swing on the drive's spring, so that a fence that is not home
breaks a limit on it."""

COSTS = (objectives.PEAK_TORQUE, objectives.FENCE_MASS)
FORCE, LOAD = objectives.PEAK_FORCE, shock.PEAK_LOAD
UNITS = {FORCE.name: "N", LOAD.name: "g"}
"""Their units in reports."""
