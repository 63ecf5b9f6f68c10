"""The oblique impact as a function of its 25 numbers, and batches of it, for measurements."""

import jax
import jax.numpy as jnp
import numpy as np

import fencejax as fj

STANDARD = fj.Fidelity.standard()
DURATION = 0.13


def impact():
    """The 25 numbers of an oblique impact, and the function from them to its peak force and its
    status."""
    leaves, structure = jax.tree.flatten(fj.scenes.oblique_impact(duration=DURATION))

    def of(numbers, fidelity=STANDARD):
        scene = jax.tree.unflatten(structure, list(numbers))
        result = fj.simulate(scene, fidelity=fidelity, only=("peak_force", "status"))
        return result.peak_force, result.status

    return jnp.stack(leaves), of


def spread(numbers, count: int):
    """So many impacts whose numbers are within a few per cent, as lanes of a search are."""
    shares = np.random.default_rng(0).uniform(0.98, 1.02, (count, 1))
    return numbers[None] * jnp.asarray(shares)
