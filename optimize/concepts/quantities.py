"""What concepts are held to alike, whatever gives way in them."""

import jax.numpy as jnp
from jaxtyping import Array

from fencejax.design import Quantity, objectives, ring_amplitude, shock
from fencejax.results import Accumulator, Measure, Sample, Step


def _give(sample: Sample, reach: Array) -> Array:
    """How far the tip is behind where the motor holds it [m]."""
    behind = sample.tip_deflection
    return behind if sample.twist is None else behind - reach * sample.twist


def _largest_give(state: Array, step: Step) -> Array:
    fence = getattr(step.scene, "fence", None)
    if fence is None:
        return state
    return jnp.maximum(state, jnp.abs(_give(step.now, fence.reach)))


TIP_GIVE = objectives.of_measure(
    Measure(
        "tip_give", "m", "how far the tip gets behind where the motor holds it, at most: bending, "
        "and the turn of the shaft with what its clutch has slipped", "at least 0",
        Accumulator("tip give", lambda nothing, body: nothing.time, _largest_give),
        lambda state: state,
    ),
    needs=("fence",),
)  # fmt: skip
"""|w_tip - R theta| [m] at samples; the tip's deflection alone where nothing gives way behind the
hinge. A limit on the deflection alone would let a soft shaft have what it denies a soft fence."""


def _held(sample: Sample) -> Array:
    return sample.energy.fence + sample.energy.strain


def _when_home(state: Array, step: Step) -> Array:
    """The energy at the end of the drive's cycle, between two samples by the line through them;
    before that, and where a scene ends before it, the latest."""
    drive = getattr(step.scene, "drive", None)
    if drive is None:
        return state
    before, now = step.before.time, step.now.time
    span = jnp.where(now > before, now - before, 1.0)
    share = jnp.clip((drive.cycle - before) / span, 0.0, 1.0)
    ends = _held(step.before), _held(step.now)
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
"""What the fence rings with at the soonest that the next sort can begin, whatever the rate; of
a torque drive how far its tip swings on the drive's spring: a fence not home then breaks it."""

COSTS = (objectives.PEAK_TORQUE, objectives.FENCE_MASS)
FORCE, LOAD = objectives.PEAK_FORCE, shock.PEAK_LOAD
UNITS = {FORCE.name: "N", LOAD.name: "g"}
"""In which each is shown."""
