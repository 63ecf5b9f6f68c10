"""The trigger delay of a recording: the time of the scene's start on the recording's clock."""

import dataclasses
from typing import NamedTuple

import numpy as np

from .. import _check
from ..design import DesignVariable
from ..fidelity import Fidelity
from ..scenes import AnyScene
from ..simulate import simulate
from .fit_problem import OFFSET, Experiment
from .recorded_signals import Recording

# Impacts are no longer than this [s]; a longer recording is probably not in seconds.
LONGEST = 5.0


class Aligned(NamedTuple):
    """A recording on the scene's clock.

    `experiment` has its rows from the first contact on, with times since the estimated start of the
    scene; `delay` [s] is the recording's time at that start; `offset` is the remaining error of the
    delay as a parameter of `fencejax.identify.fit`, or `None` where the delay was given.
    """

    experiment: Experiment
    delay: float
    offset: DesignVariable | None


def align(
    scene: AnyScene,
    recording: Recording,
    *,
    delay: float | None = None,
    length: float | None = None,
    fidelity: Fidelity | None = None,
) -> Aligned:
    """Put a recording on the clock of a scene that begins with the first contact.

        aligned = fj.study.align(scene, recording)
        fit = fj.identify.fit(aligned.experiment, ["youngs_modulus", aligned.offset])

    The delay d is first estimated by a matched filter: with the scene's signal m and the recorded
    signal y, sum_j (y_j - a m(t_j - d))^2 is least over d and the amplitude a > 0. The signal is
    the force or, without it, the tip's deflection. The fit then corrects the error due to wrong
    numbers of the scene by `offset`, whose bounds are the rise time of the signal to its peak; its
    standard error is that of the delay.

    **Arguments:**

    - `scene`: its `duration` is set to that of the rows used.
    - `delay` [s]: on the recording's clock; estimated where it is not given.
    - `length` [s]: of the rows used, from the first contact on; by default to the recording's end.
    - `fidelity`: default `Fidelity.standard()`.

    Raises `ValueError` where the delay cannot be found, and where the rows used last too long for
    an impact.
    """
    width = 0.0
    if delay is None:
        delay, width = _found(scene, recording, length, fidelity or Fidelity.standard())
    delay = _check.number("delay", delay, unit="s")
    last = float(recording.time[-1]) - delay
    last = last if length is None else min(last, _check.number("length", length, above=0, unit="s"))
    if last <= 0:
        raise ValueError(
            f"{recording.source}: must hold rows after the delay, {delay:g} s, but ends at "
            f"{float(recording.time[-1]):g} s."
        )
    if last > LONGEST:
        raise ValueError(
            f"{recording.source}: goes on for {last:g} s after the first contact, where impacts "
            f"last {LONGEST:g} s at most. Give the `length` that is used or, if these are "
            "milliseconds, write `time [ms]` in the header."
        )
    used = recording.within(delay - width, delay + last)
    used = dataclasses.replace(used, time=used.time - delay)
    # Records of one length share their program.
    scene = dataclasses.replace(scene, duration=last + width)
    offset = DesignVariable(OFFSET, -width, width, "s", "linear") if width else None
    return Aligned(Experiment(scene, used), delay, offset)


def _found(
    scene: AnyScene, recording: Recording, length: float | None, fidelity: Fidelity
) -> tuple[float, float]:
    """The delay by the matched filter, and the rise time of the model's signal to its peak."""
    name = next((n for n in ("force", "tip_deflection") if n in recording.names), None)
    if name is None:
        raise ValueError(
            f"{recording.source}: must hold the force or the tip's deflection where the delay is "
            f"to be found, but has {list(recording.names)}. Give the `delay`."
        )
    column = recording.signals[name]
    there = np.isfinite(column)
    time, recorded = recording.time[there], column[there]
    history = simulate(scene, fidelity=fidelity, only="history").history
    assert history is not None
    knots = np.asarray(history.time)
    model = np.asarray(history.fence_force if name == "force" else history.tip_deflection)
    rise = float(knots[np.argmax(np.abs(model))])
    if not rise > 0 or not np.all(np.isfinite(model)):
        raise ValueError(
            f"{recording.source}: the scene's {name} must rise to a peak where the delay is to be "
            "found, but does not. Give the `delay`, or start from better numbers."
        )
    step = float(np.median(np.diff(time)))
    if step > rise:
        raise ValueError(
            f"{recording.source}: rows must be nearer to each other than the time that the {name} "
            f"takes to its peak, {rise:.3g} s, but are {step:.3g} s apart. If these are "
            "milliseconds, write `time [ms]` in the header."
        )
    # Both on one grid, the finer of the recording's and one that shows the rise.
    step = min(step, rise / 10)
    span = float(time[-1] - time[0])
    if span / step > 2e7:
        raise ValueError(
            f"{recording.source}: is too long for the delay to be found: {span:g} s at steps of "
            f"{step:.3g} s. Give the `delay`, or cut the recording."
        )
    grid = time[0] + step * np.arange(int(span / step) + 1)
    y = np.interp(grid, time, recorded)
    reach = min(knots[-1], np.inf if length is None else length)
    m = np.interp(step * np.arange(int(reach / step) + 1), knots, model)
    # For every position of the signal's start: its product with the recording, and its square over
    # the overlap of both.
    from scipy import signal

    product = signal.correlate(y, m, "full", "fft")
    energy = signal.correlate(np.ones_like(y), m**2, "full", "fft")
    places = np.arange(-m.size + 1, y.size)
    # The peak is in the recording.
    peak = int(rise / step)
    inside = (places + peak >= 0) & (places + peak < y.size)
    likeness = np.where(inside, product / np.sqrt(np.maximum(energy, 1e-12 * energy.max())), 0.0)
    best = int(np.argmax(likeness))
    if -likeness.min() > likeness[best]:
        raise ValueError(
            f"{recording.source}, signal `{name}`: must be positive where the scene's is, but is "
            "more like its opposite. Change its sign."
        )
    return float(grid[0] + step * places[best]), rise
