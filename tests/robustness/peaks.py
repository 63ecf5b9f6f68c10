"""The peak force of random impacts with its time and its slopes, and how wrong slopes are."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from robustness.extreme_scenes import impact, riding

import fencejax as fj

DURATION = 0.1
VARIED = ("thickness", "modulus", "density", "damping_ratio", "mass", "stiffness", "belt", "reach")


@functools.cache
def peaks(fidelity, of="gradient"):
    """Numbers of lanes -> status, peak force, its time, each (lanes,), and the slopes x df/dx
    (lanes, varied) of the peak force, 0 where only its `"value"` is asked for."""

    @jax.jit
    @jax.vmap
    def run(x):
        def peak(varied):
            scene = impact(riding(x, varied), DURATION)
            result = fj.simulate(scene, fidelity=fidelity, only=("peak_force", "peak_time"))
            return result.peak_force, (result.status, result.peak_force, result.peak_time)

        varied = {name: x[name] for name in VARIED}
        if of == "value":
            return *peak(varied)[1], jnp.zeros(len(VARIED))
        slopes, found = jax.jacfwd(peak, has_aux=True)(varied)
        return *found, jnp.stack([slopes[name] * x[name] for name in VARIED], axis=-1)

    return run


def gradient_error(slopes, true, size):
    """How far slopes are from the true ones, relative to their norm or, where it is larger, to the
    `size` of what has them."""
    off = np.linalg.norm(slopes - true, axis=-1)
    return off / np.maximum(np.linalg.norm(true, axis=-1), size)
