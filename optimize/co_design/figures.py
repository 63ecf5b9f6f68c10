"""The motion with its limits, the sorts before and after."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import fencejax as fj
from fencejax.plot import COLORS, figure, prepared

from ..common.encounters import Course
from ..common.report import most, save
from .problem import Joint

_NAMES = ("fence before, its drive as a spline", "designed together")


def motion(joint: Joint, before, after, out: Path) -> None:
    """Angle, speed, acceleration and jerk of the drive over the period."""
    config = joint.config
    drawn = figure(6.6)
    every = drawn.subplots(4, 1, sharex=True)
    time = np.linspace(0, config.seconds, 1501)
    for color, name, values in zip(COLORS, _NAMES, (before, after), strict=False):
        drive = joint.space.apply(values)[1]
        moved = jax.vmap(drive.motion)(jnp.asarray(time))
        jerk = np.gradient(np.asarray(moved.acceleration), time)
        for axes, signal in zip(every, (*moved[:3], jerk), strict=True):
            axes.plot(time, np.asarray(signal), color=color, label=name)
    limits = (None, config.speed_limit, config.acceleration_limit, config.jerk_limit)
    labels = (
        "angle [rad]", "speed [rad/s]", "acceleration\n[rad/s$^2$]", "jerk [rad/s$^3$]",
    )  # fmt: skip
    _finish(every, labels, limits)
    save(every[0], out / "motion.png")


def _finish(every, labels, limits) -> None:
    """Label signals over time, drawn one below the other, each with its limit where it has one."""
    for axes, limit, label in zip(every, limits, labels, strict=True):
        prepared(axes)
        axes.set_ylabel(label)
        if limit is not None:
            for side in (-limit, limit):
                axes.axhline(side, color="black", linestyle="--", linewidth=1)
    every[0].legend(frameon=False, fontsize="small")
    every[-1].set_xlabel("time since the drive's start [s]")
    every[0].get_figure().align_ylabels(every)


def sorts(joint: Joint, before, after, lane: int, out: Path) -> None:
    """Force, tip deflection and torque over the sort that is hardest after."""
    course = Course(
        "sorts", joint.config.seconds, fj.Fidelity.fast(), machine=joint.config.machine
    )
    number = joint.encounters.named(lane)

    @jax.jit
    def run(values):
        fence, drive = joint.space.apply(values)
        scene = course.scene(fence, drive, joint.encounters._replace(**number))
        history = fj.simulate(scene, fidelity=course.fidelity, only=("history",)).history
        assert history is not None
        return history.time, history.fence_force, 1e3 * history.tip_deflection, history.torque

    drawn = figure(5.4)
    every = drawn.subplots(3, 1, sharex=True)
    for color, name, values in zip(COLORS, _NAMES, (before, after), strict=False):
        time, *signals = jax.device_get(run(jnp.asarray(values)))
        for axes, signal in zip(every, signals, strict=True):
            axes.plot(time, signal, color=color, label=name)
    tip, torque = (most(joint.limits, name) for name in ("tip_deflection", "peak_torque"))
    limits = (None, None if tip is None else 1e3 * tip, torque)
    _finish(every, ("force [N]", "tip deflection\n[mm]", "torque [N m]"), limits)
    every[0].set_title(
        f"{number['mass']:g} kg, {1e3 * number['offset']:g} mm from the border", fontsize="small"
    )
    save(every[0], out / "sorts.png")


def search(joint: Joint, optimum, out: Path) -> None:
    """The worst case, violation and residual at every evaluation."""
    axes = fj.plot.convergence(optimum.history, tolerance=joint.config.tolerance)[0]
    save(axes, out / "search.png")
