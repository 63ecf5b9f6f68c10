"""Unconstrained descent by optax, one evaluation at a time and on the host.

Each evaluation brings the whole Jacobian, so that the gradient of any augmented Lagrangian at a
point already visited is free. optax's own line search (zoom) does not know that, nor what a failed
evaluation is, and puts the simulator inside its loop two more times; here optax gives the
direction and a safeguarded line search of a few lines gives the step.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax

from .lagrangian import Evaluation, Vector

Merit = Callable[[Evaluation], tuple[float, Vector]]
Evaluate = Callable[[Vector], Evaluation | None]
Accepted = Callable[[Evaluation], bool]

_MEMORY = 10
# Lengths of a step in z: beyond the longest a sigmoid is flat; below the shortest all is rounding.
_LONGEST = 3.0
_SHORTEST = 1e-10


class Descent(NamedTuple):
    """Where a descent ended, and whether it ended for want of progress."""

    at: Evaluation
    stalled: bool


class _Directions:
    """An optax transformation as a source of steps, compiled.

    optax mixes widths of integers, which a session with strict promotion of types refuses; the
    promotion is therefore named here.
    """

    def __init__(self, transform: optax.GradientTransformation):
        self._init, self._update = transform.init, jax.jit(transform.update)

    def fresh(self, point: Vector):
        """The state of a transformation that has seen nothing."""
        with jax.numpy_dtype_promotion("standard"):
            return self._init(jnp.asarray(point))

    def advance(self, state, point: Vector, gradient: Vector):
        """The step [as numbers on the host] and the next state."""
        with jax.numpy_dtype_promotion("standard"):
            step, state = self._update(gradient, state, point)
        return np.asarray(step), state


class Lbfgs:
    """Limited-memory BFGS directions (`optax.scale_by_lbfgs`) with a cubic backtracking search."""

    def __init__(self):
        self._directions = _Directions(
            optax.chain(optax.scale_by_lbfgs(memory_size=_MEMORY), optax.scale(-1.0))
        )

    def run(
        self,
        evaluate: Evaluate,
        merit: Merit,
        start: Evaluation,
        past: Iterable[Evaluation],
        accepted: Accepted,
    ) -> Descent:
        """Descend from `start` until `accepted` says so, or nothing lower is found.

        `past`: evaluations already made, oldest first; the memory is built from their gradients.
        `evaluate` gives `None` where the budget is spent.
        """
        directions = self._directions
        state = directions.fresh(start.point)
        last: tuple[Vector, Vector] | None = None
        for old in past:
            if np.array_equal(old.point, start.point):
                continue
            gradient = merit(old)[1]
            if last is None or (old.point - last[0]) @ (gradient - last[1]) > 1e-12:
                _, state = directions.advance(state, old.point, gradient)
                last = (old.point, gradient)
        at = start
        value, gradient = merit(at)
        while True:
            fresh = last is None
            if last is not None and (at.point - last[0]) @ (gradient - last[1]) <= 1e-12:
                state, fresh = directions.fresh(at.point), True
            direction, state = directions.advance(state, at.point, gradient)
            last = (at.point, gradient)
            if direction @ gradient >= 0:
                state, fresh = directions.fresh(at.point), True
                _, state = directions.advance(state, at.point, gradient)
                direction = -gradient
            length = float(np.linalg.norm(direction))
            if fresh:
                first = min(0.1 * _LONGEST, float(np.linalg.norm(gradient)))
            else:
                first = min(length, _LONGEST)
            direction = direction * (first / max(length, 1e-300))
            found = self._search(evaluate, merit, at, direction, value, gradient)
            if found is None:
                return Descent(at, True)
            at = found
            value, gradient = merit(at)
            if accepted(at):
                return Descent(at, False)

    @staticmethod
    def _search(evaluate, merit, at, direction, value, gradient) -> Evaluation | None:
        """A point along `direction` that is low enough (Armijo); `None` where there is none."""
        slope, share = float(direction @ gradient), 1.0
        size = float(np.linalg.norm(direction))
        while share * size > _SHORTEST:
            trial = evaluate(at.point + share * direction)
            if trial is None:
                return None
            if trial.failed:
                share *= 0.3
                continue
            there, inclined = merit(trial)
            # 1e-13: what rounding leaves of a merit of order 1.
            if there <= value + 1e-4 * share * slope + 1e-13:
                return trial
            share = _cubic(share, value, slope, there, float(direction @ inclined))
        return None


def _cubic(share: float, value: float, slope: float, there: float, inclined: float) -> float:
    """Minimiser of the cubic through values and slopes at 0 and `share`, kept inside."""
    bend = slope + inclined - 3 * (there - value) / share
    root = np.sqrt(max(bend**2 - slope * inclined, 0.0))
    denominator = inclined - slope + 2 * root
    if denominator <= 0:
        return 0.3 * share
    guess = share * (1 - (inclined + root - bend) / denominator)
    return float(np.clip(guess, 0.1 * share, 0.6 * share))


class Adam:
    """`optax.adam`: a step at every evaluation, halved where the evaluation failed."""

    def __init__(self, rate: float = 0.05):
        self._directions = _Directions(optax.adam(rate))

    def run(
        self,
        evaluate: Evaluate,
        merit: Merit,
        start: Evaluation,
        past: Iterable[Evaluation],
        accepted: Accepted,
    ) -> Descent:
        """As `Lbfgs.run`; `past` is not used."""
        del past
        directions = self._directions
        state = directions.fresh(start.point)
        at = start
        while True:
            step, state = directions.advance(state, at.point, merit(at)[1])
            if np.linalg.norm(step) < _SHORTEST:
                return Descent(at, True)
            trial = evaluate(at.point + step)
            while trial is not None and trial.failed and np.linalg.norm(step) > _SHORTEST:
                step = 0.5 * step
                trial = evaluate(at.point + step)
            if trial is None or trial.failed:
                return Descent(at, True)
            at = trial
            if accepted(at):
                return Descent(at, False)
