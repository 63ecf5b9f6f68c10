"""Every kind of scene, and its run in fixed steps, which the history holds, once for a session."""

import functools

import jax
import numpy as np

import fencejax as fj

SCENES = {
    "oblique_impact": lambda: fj.scenes.oblique_impact(duration=0.12),
    "along_fence": lambda: fj.scenes.along_fence(duration=0.12),
    "border_and_fence": lambda: fj.scenes.border_and_fence(duration=0.12),
    "free_motion": lambda: fj.scenes.free_motion(duration=0.12),
    "free_motion_with_fence": lambda: fj.scenes.free_motion(fence=fj.Fence(), duration=0.12),
    "whole_sort": lambda: fj.scenes.whole_sort(),
    "normal_impact": lambda: fj.scenes.normal_impact(),
    "rigid_wall": lambda: fj.scenes.rigid_wall(),
}


FIXED = fj.Fidelity(step=2.5e-4, step_tolerance=None)


@functools.cache
def fixed(name):
    """The result of a scene with its history, as NumPy arrays."""
    return jax.tree.map(np.asarray, fj.simulate(SCENES[name](), fidelity=FIXED))


def one_by_one(function):
    """The same of lanes, one after another: a program that takes half as long to trace as that of
    `jax.vmap`, and two thirds to compile."""
    return functools.partial(jax.lax.map, function)


# As many lanes as are sooner computed one after another than their vectorised program is compiled,
# with the compiler's least effort (`conftest.py`).
_SOON = 64


def side_by_side(function):
    """The same of many lanes, vectorised; of few, one after another."""

    def run(lanes):
        total = jax.tree.leaves(lanes)[0].shape[0]
        return (one_by_one if total <= _SOON else jax.vmap)(function)(lanes)

    return run
