"""Lanes in an order in which neighbours take about as many steps: those that go through a loop
together wait for the one with the most."""

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..scenes import NormalScene, Scene


def contact_length(scene: NormalScene | Scene) -> Array | None:
    """About how long [s] the parcel is in contact with the fence, but for a factor that lanes have
    in common: half a period of its mass m on the fence as a spring, pi sqrt(m c).

    At the distance x from the clamped end of a beam c is x^3 / (3 E I), I that of the root; on the
    rigid link there is the contact alone, which is short. `None` where the place of the touch is not
    among the scene's numbers.
    """
    place = scene.distance if isinstance(scene, NormalScene) else scene.start.distance()
    fence = scene.fence
    if place is None or fence is None:
        return None
    arm = jnp.maximum(place - fence.rigid_length, 0.0)
    stiffness = 3 * fence.material.youngs_modulus * fence.width * fence.thickness**3 / 12
    return jnp.pi * jnp.sqrt(scene.parcel.mass * arm**3 / stiffness)


def by_length(lengths: Array, count: Array) -> Array:
    """The numbers of lanes in the order of their contacts' `lengths`; those from `count` on, which
    fill up the last group, at the end."""
    real = jnp.arange(lengths.size, dtype=count.dtype) < count
    return jnp.argsort(jnp.where(real, lengths, jnp.inf))


def lengths(make_scene, points: Array) -> Array | None:
    """The `contact_length` of the scene of each point, (lanes, n); `None` where it is not known."""
    like = jax.eval_shape(lambda point: contact_length(make_scene(point)), points[0])
    if like is None:
        return None
    return jax.vmap(lambda point: contact_length(make_scene(point)))(points)
