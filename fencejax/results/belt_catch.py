"""Whether it is certain that the belt stops a parcel that slides on it.

Where static friction is above the kinetic one, a parcel whose slip comes to rest sticks for certain
if kinetic friction would stop it, too. Static friction, smoothed, pulls a parcel to rest that still
slips by about w_s. Kinetic friction alone would have left it that slip, and would have stopped it
as soon as

    int (mu_k m_p g - F) dt / m_p = w_s,

with F the friction that keeps it at rest. If F exceeds kinetic friction before then, unsmoothed
friction holds the parcel only if sliding and spinning on the belt come to rest at the same instant.
Smoothed friction holds it in any case, so the outcome depends on the smoothing. The force on the
parcel differs by up to (mu_s - mu_k) m_p g as long as it sticks.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Smoothing
from ..scenes import NormalScene, Scene
from .sample import Sample


class Catch(NamedTuple):
    """`owed` [m/s] is the slip that kinetic friction alone would still have to stop: w_s while the
    parcel slides on the belt, and less the longer it rests. `unsure` [N] is the largest difference
    of static and kinetic friction so far at a stop that is not certain."""

    owed: Array
    unsure: Array


def caught(
    known: Catch,
    before: Array,
    now: Array,
    sample: Sample,
    length: Array,
    scene: NormalScene | Scene,
    smoothing: Smoothing,
) -> Catch:
    """The evidence after a step of the `length` [s] to the `sample`, with the slip on the belt
    [m/s] `before` and `now`."""
    if isinstance(scene, NormalScene) or scene.belt is None or sample.belt is None:
        return known
    belt, parcel, fence_force, force, length = jax.lax.stop_gradient(
        (scene.belt, scene.parcel, sample.fence_force, sample.belt, length)
    )
    weight = parcel.mass * belt.gravity
    kinetic, jump, _ = belt.friction.scales(now)
    rests, was_at_rest = (slip < smoothing.static_speed for slip in (now, before))
    needed = jnp.sqrt(force.x**2 + force.y**2)
    spare = kinetic * weight - needed
    stays = rests & was_at_rest & (known.owed > 0)
    doubtful = stays & (spare < 0) & (fence_force > 0)
    unsure = jnp.where(doubtful, jnp.maximum(known.unsure, jump * weight), known.unsure)
    paid = jnp.where(stays, length * jnp.maximum(spare, 0.0) / parcel.mass, 0.0)
    owed = jnp.maximum(known.owed - paid, 0.0)
    owed = jnp.where(now > smoothing.slides_above, smoothing.static_speed, owed)
    return Catch(owed, unsure)
