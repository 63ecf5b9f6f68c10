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
