"""The peak force of random scenes with its time and its slopes, and how wrong slopes are."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from robustness.searched_scenes import KINDS, changed

import fencejax as fj


@functools.cache
def peaks(fidelity, of="gradient", kind="impact"):
    """Numbers of lanes -> status, peak force, its time, each (lanes,), and the slopes x df/dx
    (lanes, varied) of the peak force, 0 where only its `"value"` is asked for."""
    searched = KINDS[kind]

    @jax.jit
    @jax.vmap
    def run(x):
        def peak(varied):
            scene = searched.scene(changed(x, varied))
            result = fj.simulate(scene, fidelity=fidelity, only=("peak_force", "peak_time"))
            return result.peak_force, (result.status, result.peak_force, result.peak_time)

        varied = {name: x[name] for name in searched.varied}
        if of == "value":
            return *peak(varied)[1], jnp.zeros(len(varied))
        slopes, found = jax.jacfwd(peak, has_aux=True)(varied)
        return *found, jnp.stack([slopes[n] * x[n] for n in searched.varied], axis=-1)

    return run


def gradient_error(slopes, true, size):
    """How far slopes are from the true ones, relative to their norm or, where it is larger, to the
    `size` of what has them."""
    off = np.linalg.norm(slopes - true, axis=-1)
    return off / np.maximum(np.linalg.norm(true, axis=-1), size)
