"""Groups of lanes that run through a loop together. All lanes of a group wait for the one with the
most steps, so that a group has lanes of about the same number of steps."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..scenes import NormalScene, Scene

CPU_GROUP = 64
"""Lanes of a group: larger groups use a core's vector units better, smaller ones wait less for the
slowest lane. Measured on one core: 64 is the best, 32 and 128 are 10 % slower, 16 is 25 %."""


def contact_length(scene: NormalScene | Scene) -> Array | None:
    """An estimate [s] of the contact time of parcel and fence, up to a factor common to all lanes:
    half a period of its mass m on the fence as a spring, pi sqrt(m c).

    At the distance x from the clamped end of a beam the compliance c is x^3 / (3 E I), with I at
    the root; on the rigid link only the contact is compliant, and its time is short. `None` where
    the place of the first contact is not among the scene's numbers.
    """
    place = scene.distance if isinstance(scene, NormalScene) else scene.start.distance()
    fence = scene.fence
    if place is None or fence is None:
        return None
    arm = jnp.maximum(place - fence.rigid_length, 0.0)
    stiffness = 3 * fence.material.youngs_modulus * fence.width * fence.thickness**3 / 12
    return jnp.pi * jnp.sqrt(scene.parcel.mass * arm**3 / stiffness)


def in_groups(
    function: Callable[[Any], Any],
    lanes: Any,
    group: int,
    count: Array,
    scene: Callable[[Any], NormalScene | Scene],
) -> Any:
    """A vectorised `function` of lanes, computed in groups in the order of their contact times.

    **Arguments:**

    - `lanes`: a pytree whose leaves have the lanes first, a multiple of `group` of them.
    - `count`: the number of lanes wanted, the first ones; a traced integer. Groups without any of
      them are not computed, and the results of other lanes have no meaning.
    - `scene`: the scene of one lane, from which its contact time is estimated.

    A lane's numbers do not depend on the lanes of its group.
    """
    total = len(jax.tree.leaves(lanes)[0])

    lengths = jax.vmap(lambda lane: contact_length(scene(lane)))(lanes)
    order = None
    if lengths is not None:
        wanted = jnp.arange(total, dtype=count.dtype) < count
        order = jnp.argsort(jnp.where(wanted, lengths, jnp.inf))
        lanes = jax.tree.map(lambda leaf: leaf[order], lanes)
    groups = jax.tree.map(lambda leaf: leaf.reshape(-1, group, *leaf.shape[1:]), lanes)

    def one(index):
        return jax.tree.map(
            lambda leaf: jax.lax.dynamic_index_in_dim(leaf, index, keepdims=False), groups
        )

    def put(index, found):
        return jax.tree.map(lambda kept, new: kept.at[index].set(new), found, function(one(index)))

    shapes = jax.eval_shape(function, jax.tree.map(lambda leaf: leaf[0], groups))
    empty = jax.tree.map(lambda s: jnp.zeros((total // group, *s.shape), s.dtype), shapes)
    found = jax.lax.fori_loop(0, (count + group - 1) // group, put, empty)
    found = jax.tree.map(lambda leaf: leaf.reshape(total, *leaf.shape[2:]), found)
    if order is None:
        return found
    return jax.tree.map(lambda leaf: jnp.zeros_like(leaf).at[order].set(leaf), found)


def filled_up(lanes: Any, group: int) -> Any:
    """The lanes with the last one repeated until they are a multiple of `group`."""
    total = len(jax.tree.leaves(lanes)[0])
    picks = np.minimum(np.arange(-(-total // group) * group), total - 1)
    return jax.tree.map(lambda leaf: np.asarray(leaf)[picks], lanes)
