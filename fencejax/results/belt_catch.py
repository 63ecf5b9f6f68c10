"""Whether it is certain that the belt stops a parcel that slides on it.

Where static friction is above the kinetic one, a parcel whose slip comes to rest sticks for certain
if kinetic friction would stop it, too. Where more force than that is needed to keep it at rest, dry
friction holds it only if all of its slip passes zero at once, and then the outcome depends on the
smoothing of friction. The force on the parcel differs by up to (mu_s - mu_k) m_p g as long as it
sticks.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Smoothing
from ..scenes import NormalScene, Scene
from .sample import Sample

# Slips [w_s] below which a parcel is at rest on the belt, and above which it slides: there
# exp(-3^2) of the jump of friction is left.
_RESTS, _FREE = 1.0, 3.0


class Catch(NamedTuple):
    """`slid` is 1.0 from when the parcel slides on the belt until it has been at rest on it for a
    step. `unsure` [N] is the largest jump of friction so far of which it is uncertain whether the
    parcel stuck by it."""

    slid: Array
    unsure: Array


def caught(
    known: Catch,
    before: Array,
    now: Array,
    sample: Sample,
    scene: NormalScene | Scene,
    smoothing: Smoothing,
) -> Catch:
    """The evidence after a step to the `sample`, with the slip on the belt [m/s] `before` and
    `now`."""
    if isinstance(scene, NormalScene) or scene.belt is None or sample.belt is None:
        return known
    belt, parcel, fence_force, force = jax.lax.stop_gradient(
        (scene.belt, scene.parcel, sample.fence_force, sample.belt)
    )
    weight = parcel.mass * belt.gravity
    kinetic, jump, _ = belt.friction.scales(now)
    rests = now < _RESTS * smoothing.static_speed
    was_at_rest = before < _RESTS * smoothing.static_speed
    needed = jnp.sqrt(force.x**2 + force.y**2)
    stays = rests & was_at_rest & (known.slid > 0)
    doubtful = stays & (needed > kinetic * weight) & (fence_force > 0)
    unsure = jnp.where(doubtful, jnp.maximum(known.unsure, jump * weight), known.unsure)
    slides = now > _FREE * smoothing.static_speed
    slid = jnp.where(slides, 1.0, jnp.where(stays, 0.0, known.slid))
    return Catch(slid, unsure)
