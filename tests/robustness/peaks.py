"""The peak force of random scenes with its time and its slopes, and how wrong slopes are."""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from robustness.searched_scenes import KINDS, changed
from runs import one_by_one

import fencejax as fj


@functools.cache
def peaks(fidelity, of="gradient", kind="impact"):
    """Numbers of lanes -> status, peak force, its time, each (lanes,), and the slopes x df/dx
    (lanes, varied) of the peak force, 0 where only its `"value"` is asked for."""
    searched = KINDS[kind]

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

    return jax.jit(functools.partial(fj.each_lane, run))


def gradient_error(slopes, true, size):
    """How far slopes are from the true ones, relative to their norm or, where it is larger, to the
    `size` of what has them."""
    off = np.linalg.norm(slopes - true, axis=-1)
    return off / np.maximum(np.linalg.norm(true, axis=-1), size)


class Course(NamedTuple):
    """The peak force of a sort at some speeds, its slopes in the factor on the speed, each
    (speeds,), the secant from the first to the last, the estimated error of each gradient, and
    statuses."""

    forces: np.ndarray
    slopes: np.ndarray
    secant: float
    estimated: np.ndarray
    status: np.ndarray


# Speeds of a course at most: all courses are filled up to so many, and share one program.
_SPEEDS = 33


@functools.cache
def _course(fidelity, kind):
    """Numbers, whether they are courses over the belt's speed (1.0) or over the drive's (0.0), and
    factors on that speed (_SPEEDS,) -> what a course is made of."""

    @jax.jit
    def run(numbers, of_belt, factors):
        def peak(factor):
            more = factor - 1
            speeds = {
                "belt": numbers["belt"] * (1 + of_belt * more),
                "top_speed": numbers["top_speed"] * (1 + (1 - of_belt) * more),
            }
            scene = KINDS[kind].scene(changed(numbers, speeds))
            result = fj.simulate(scene, fidelity=fidelity, only="peak_force")
            return result.peak_force, (result.peak_force, result.gradient_error, result.status)

        return one_by_one(jax.jacfwd(peak, has_aux=True))(factors)

    return run


def over_speeds(numbers, low, high, count, fidelity=None, kind="sort", of_belt=True):
    """The course of a whole sort whose belt, or drive instead, is faster by the shares from `low`
    to `high`, at `count` speeds, at most `_SPEEDS`."""
    assert count <= _SPEEDS
    factors = 1 + np.linspace(low, high, count)
    numbers = {name: jnp.asarray(value) for name, value in numbers.items()}
    found = _course(fidelity, kind)(numbers, float(of_belt), np.resize(factors, _SPEEDS))
    slopes, (forces, estimated, status) = jax.tree.map(lambda leaf: np.asarray(leaf[:count]), found)
    secant = float((forces[-1] - forces[0]) / (factors[-1] - factors[0]))
    return Course(forces, slopes, secant, estimated, status)
