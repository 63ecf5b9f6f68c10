"""The two methods of robust design: a fixed sample, or fresh parcels at every step."""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np
import optax

from fencejax.design import (
    Evaluation,
    FirstOrder,
    Journal,
    Multipliers,
    Optimum,
    Record,
    minimize,
)
from fencejax.results import Status

from .parcels import draw
from .problem import Population


class Step(NamedTuple):
    """An evaluation: the measure [the severity's unit], the violation of the limits [1], how often
    each status occurred, and how many parcels are of each rung of the fidelities."""

    objective: float
    violation: float
    statuses: tuple[int, ...]
    rungs: tuple[int, ...]


class Found(NamedTuple):
    """The result of a search: the design's shares, why the search ended, whether it ended as
    intended, its steps, the measure of its own sample (NaN without one), and the optimum, if
    any."""

    point: np.ndarray
    stop: str
    ended: bool
    steps: list[Step]
    objective: float
    optimum: Optimum | None = None


def by_sample(population: Population, journal: Journal, say: Callable[..., None]) -> Found:
    """Sample-average approximation: the statistics of one sample, by quadratic programming.

    The statistics have kinks where parcels change ranks, smaller ones for larger samples. Where
    they keep the residual above the tolerance, the search ends when it finds no lower design.
    """
    config = population.config
    encounters = jax.tree.map(np.asarray, draw(config, config.sample, 0))
    steps: list[Step] = []

    def progress(record: Record) -> None:
        steps.append(
            Step(record.objective, record.violation, record.statuses, record.rungs)
        )
        say(_line(record.evaluation, config, steps[-1], record.elapsed))

    found = minimize(
        population.program,
        population.start,
        data=(encounters,),
        tolerance=config.tolerance,
        feasibility=config.feasibility,
        budget=config.budget,
        worst_status=Status.NON_FINITE,
        journal=journal,
        progress=progress,
    )
    ended = found.feasible and found.stop.name in ("OPTIMAL", "STAGNATED")
    return Found(found.point, found.stop.value, ended, steps, found.objective, found)


def by_batches(population: Population, journal: Journal, say: Callable[..., None]) -> Found:
    """Stochastic descent: optax' Adam on the augmented Lagrangian of a fresh batch a step, the
    multipliers following each batch's margins; the design is the mean of the last half."""
    config = population.config
    with jax.numpy_dtype_promotion("standard"):
        transform = optax.adam(optax.cosine_decay_schedule(config.rate, config.steps, 0.1))
    point = population.start
    steps: list[Step] = []
    tail: list[np.ndarray] = []
    descent, scale = None, 1.0
    for number in range(config.steps):
        encounters = jax.tree.map(np.asarray, draw(config, config.batch, 2 + number))
        compute = functools.partial(population.program, point, encounters)
        numbers, _ = journal.numbers(point, (encounters,), compute)
        if descent is None:
            scale = float(np.max(np.abs(numbers.objectives))) or 1.0
            multipliers = Multipliers(np.ones(1), np.zeros(numbers.margins.size))
            descent = FirstOrder(transform, multipliers, share=0.1)
        at = Evaluation(
            point, numbers.objectives / scale, numbers.margins, numbers.objective_rows / scale,
            numbers.margin_rows, numbers.status, False,
        )  # fmt: skip
        steps.append(
            Step(
                at.worst * scale, at.violation, tuple(numbers.statuses.tolist()),
                tuple(np.bincount(numbers.rungs).tolist()),
            )  # fmt: skip
        )
        say(_line(number + 1, config, steps[-1], None))
        point = descent.step(at)
        if not np.all(np.isfinite(point)):
            return Found(
                at.point, "the numbers of a batch are not finite", False, steps, float("nan")
            )
        if 2 * number >= config.steps:
            tail.append(point)
    mean = np.mean(tail, axis=0)
    return Found(mean, f"{config.steps} steps done", True, steps, float("nan"))


def _line(number: int, config, step: Step, elapsed: float | None) -> str:
    text = (
        f"{number:4d}  {config.measure} of the {config.severity.replace('_', ' ')} "
        f"{step.objective:9.4g} {config.unit}  violation {step.violation:8.1e}  "
    )
    finer, bad = sum(step.rungs[1:]), sum(step.statuses[Status.INCONSISTENT:])
    text += f"{finer} computed finer  " if finer else ""
    text += f"{bad} left out  " if bad else ""
    return text + ("" if elapsed is None else f"{elapsed:7.1f} s")
