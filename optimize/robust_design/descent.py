"""The two ways to the robust design: a fixed sample, or fresh parcels at every step."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np
import optax

from fencejax.design import Evaluation, Journal, Multipliers, Numbers, Record, augmented, minimize
from fencejax.results import Status

from ..common import designs
from .parcels import draw
from .problem import Population


class Step(NamedTuple):
    """An evaluation: the measure [the severity's unit], the violation of the limits [1], how often
    each status occurred, the number of parcels."""

    objective: float
    violation: float
    statuses: tuple[int, ...]


class Found(NamedTuple):
    """A design's logits, why the search ended, whether that was what it looks for, its steps, and
    the measure of its own sample (NaN where there is none)."""

    point: np.ndarray
    stop: str
    ended: bool
    steps: list[Step]
    objective: float


def by_sample(population: Population, journal: Journal, say: Callable[..., None]) -> Found:
    """Sample-average approximation: the statistics of one sample, by quadratic programming.

    The statistics have kinks where parcels change ranks, finer the larger the sample; the search
    ends where nothing lower is found, if the kinks keep the residual above the tolerance.
    """
    config = population.config
    encounters = jax.tree.map(np.asarray, draw(config, config.sample, 0))
    steps: list[Step] = []

    def progress(record: Record) -> None:
        steps.append(Step(record.objective, record.violation, record.statuses))
        say(_line(record.evaluation, config, steps[-1], record.elapsed))

    found = minimize(
        population.program,
        designs.inside(population.start),
        data=(encounters,),
        logits=True,
        method="sqp",
        tolerance=config.tolerance,
        feasibility=config.feasibility,
        budget=config.budget,
        worst_status=Status.NON_FINITE,
        journal=journal,
        progress=progress,
    )
    ended = found.feasible and found.stop.name in ("OPTIMAL", "STAGNATED")
    return Found(found.point, found.stop.value, ended, steps, found.objective)


def by_batches(population: Population, journal: Journal, say: Callable[..., None]) -> Found:
    """Stochastic descent: optax' Adam on the augmented Lagrangian of a fresh batch a step, the
    multipliers following each batch's margins; the design is the mean of the last half."""
    config = population.config
    schedule = optax.cosine_decay_schedule(config.rate, config.steps, 0.1)
    with jax.numpy_dtype_promotion("standard"):
        transform = optax.adam(schedule)
        point = designs.inside(population.start)
        state = transform.init(point)
    steps: list[Step] = []
    tail: list[np.ndarray] = []
    held, scale, penalty = None, 1.0, 10.0
    for number in range(config.steps):
        encounters = jax.tree.map(np.asarray, draw(config, config.batch, 2 + number))
        known = journal.find(point, (encounters,))
        if known is None:
            numbers = population.program(point, encounters)
            journal.add(point, (encounters,), numbers)
        else:
            numbers = Numbers(*known)
        if held is None:
            scale = float(np.max(np.abs(numbers.objectives))) or 1.0
            held = Multipliers(np.ones(1), np.zeros(numbers.margins.size))
        at = Evaluation(
            point, numbers.objectives / scale, numbers.margins, numbers.objective_rows / scale,
            numbers.margin_rows, numbers.status, False,
        )  # fmt: skip
        steps.append(Step(at.worst * scale, at.violation, tuple(numbers.statuses.tolist())))
        say(_line(number + 1, config, steps[-1], None))
        slope = augmented(at, held, penalty)[1]
        if not np.all(np.isfinite(slope)):
            return Found(
                point, "the numbers of a batch are not finite", False, steps, float("nan")
            )
        # A batch's margins are noisy: the multipliers follow a tenth of what they ask for.
        moved = np.maximum(held.margins - 0.1 * penalty * at.margins, 0.0)
        held = Multipliers(held.weights, moved)
        with jax.numpy_dtype_promotion("standard"):
            change, state = transform.update(slope, state, point)
        # Within 1 % of the bounds' range, where a logit can still be moved.
        point = designs.inside(point + np.asarray(change))
        if 2 * number >= config.steps:
            tail.append(point)
    mean = np.mean(tail, axis=0)
    return Found(mean, f"{config.steps} steps done", True, steps, float("nan"))


def _line(number: int, config, step: Step, elapsed: float | None) -> str:
    text = (
        f"{number:4d}  {config.measure} of the {config.severity.replace('_', ' ')} "
        f"{step.objective:9.4g} {config.unit}  violation {step.violation:8.1e}  "
    )
    bad = sum(step.statuses[Status.STEP_TOO_COARSE:])
    text += f"{bad} left out  " if bad else ""
    return text + ("" if elapsed is None else f"{elapsed:7.1f} s")
