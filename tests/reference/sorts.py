"""The paper's sort by its own stages, and the library's, computed once for the session."""

import functools
from dataclasses import replace

import jax
import numpy as np
from reference.impact import (
    Impact,
)
from reference.stages import (
    border_and_fence,
    common,
    sequence,
    two_corners,
)
from runs import FIXED

import fencejax as fj

FENCES = {
    "two-link": ({}, fj.Fence),
    "one-link": ({"l_s": 0.0, "l_p": 1.2, "thickness": 0.073}, fj.Fence.one_link),
}
# With 16 modes and a tolerance of 1e-7 the staged peak is 3e-6 higher.
NUMERICS = {"rtol": 1e-5, "every": 1e-3}
END = 1.0  # [s] the parcel has been at rest on the belt since 0.92 s
TIED_AT = 0.19  # [s] both corners press on the fence from 0.15 s on


def sorting(fence, **changes):
    """The whole sort's parameters, friction smoothed as `Fidelity.standard` has it."""
    slip, static = fj.Fidelity.standard().smoothing
    numbers = {"drive_angle": 0.0, "epsilon": slip, "stribeck": static, "modes": 6}
    return Impact(**{**numbers, **FENCES[fence][0], **changes})


@functools.cache
def library(fence):
    scene = fj.scenes.whole_sort(fence=FENCES[fence][1](), tip_contact=False)
    result = fj.simulate(scene, fidelity=FIXED)
    return jax.tree.map(np.asarray, result)


@functools.cache
def staged(fence, switch=border_and_fence.FLUSH):
    return sequence.sort(sorting(fence), end=END, switch=switch, **NUMERICS)


@functools.cache
def free(fence):
    """Both corners free, in two parts that meet at `TIED_AT`: (samples, second part)."""
    impact = sorting(fence)
    start = sequence.on_border(impact, 0.1)
    first = sequence.integrate(two_corners, impact, 0.0, TIED_AT, start, **NUMERICS)
    second = sequence.integrate(two_corners, impact, TIED_AT, END, first.last, **NUMERICS)
    assert first.why is None
    assert second.why == "corner 1 runs over the tip"
    return sequence.Sort((first, second), 0.0, 0.0, 0.0).samples, second


def in_parallel(impact):
    """The contact law doubled: what two corners that are pressed in alike amount to."""
    return replace(impact, stiffness=2 * impact.stiffness, damping=2 * impact.damping)


def at(samples, time, name):
    return np.interp(time, samples.time, getattr(samples, name))


def seen(history, time):
    """The library's samples at other times, as `common.Sample` has them."""
    ours = lambda values: np.interp(time, history.time, values)  # noqa: E731
    first, second = history.fence
    nan = np.full(time.size, np.nan)
    return common.Sample(
        time, *(ours(values) for values in history.body),
        normal=ours(history.fence_force), friction=nan, gap=nan,
        arc=0.5 * ours(first.place + second.place), border_normal=ours(history.border[1].normal),
        tip=ours(-history.tip_deflection), wall_moment=nan,
        corner_normals=np.stack([ours(first.normal), ours(second.normal)], -1),
    )


def apart(one, other):
    """Distance of two paths of C_s at equal times [m]."""
    return np.hypot(one.x - other.x, one.y - other.y)


def crossing(time, values, level):
    """The first of the times at which the values exceed a level."""
    return float(time[np.argmax(values > level)])
