"""The trial of a candidate fidelity: its errors against a reference, and the verdict."""

import dataclasses
import math
from collections.abc import Sequence

from ..fidelity import Fidelity
from ..results import Status, coarser
from .measurement import gradient_error, measure, value_error
from .scene_groups import Group

PASSES = "accurate enough"
VALUE_FAILS = "value too far off"
GRADIENT_FAILS = "gradient too far off"


@dataclasses.dataclass(frozen=True)
class Trial:
    """The measurements of one candidate.

    **Fields:**

    - `fidelity`: the candidate.
    - `outcome`: the verdict, in words.
    - `passed`: whether it met both errors.
    - `value_error`: largest relative error of a quantity over the scenes [1]; `None` if not
      measured.
    - `gradient_error`: largest error of a gradient, as elasticities relative to their norm [1];
      `None` if not measured.
    - `value_time`, `gradient_time`: run time of all scenes together [s], median of several runs of
      the compiled program, for the value and for value and gradient; `None` if not measured.
    - `compile_time`: time to compile what was measured [s].

    >>> trial = fj.Trial(fj.Fidelity.fast(), "accurate enough", passed=True, value_time=2e-3)
    >>> trial.fidelity, trial.time
    (Fidelity.fast(), 0.002)
    """

    fidelity: Fidelity
    outcome: str
    passed: bool = False
    value_error: float | None = None
    gradient_error: float | None = None
    value_time: float | None = None
    gradient_time: float | None = None
    compile_time: float = 0.0

    @property
    def time(self) -> float:
        """The run time that counts [s]: with the gradient if that was measured."""
        known = self.value_time if self.gradient_time is None else self.gradient_time
        return math.inf if known is None else known


class Judge:
    """Compares candidates with the reference, and the reference with its coarser companion.

    `value_bound` and `gradient_bound` are the errors asked for [1]; the latter is `None` without a
    gradient.

    Raises `ValueError` where the reference cannot solve a scene.
    """

    def __init__(
        self,
        groups: Sequence[Group],
        quantities: tuple[str, ...],
        reference: Fidelity,
        value_bound: float,
        gradient_bound: float | None,
        margin: float,
    ):
        self.groups, self.quantities, self.reference = groups, quantities, reference
        self.value_bound, self.gradient_bound = value_bound, gradient_bound
        self.margin = margin
        slopes = gradient_bound is not None
        self.companion = coarser(reference, smoothing=2.0)
        self.truth = self._measured(reference, slopes, timed=False)
        worst = max(truth.status for truth in self.truth)
        if worst >= Status.STEP_TOO_COARSE:
            raise ValueError(
                f"Argument `scene_or_scenes` must hold scenes that the reference can solve, but "
                f"one ends as {worst.name}: {worst.text}."
            )
        second = self._measured(self.companion, slopes, timed=False)
        self.own_value = self._worst(value_error, second)
        self.own_gradient = self._worst(gradient_error, second) if slopes else None
        self.time = sum(truth.time for truth in self.truth)

    def _measured(self, fidelity: Fidelity, slopes: bool, timed: bool = True):
        return [
            measure(group, fidelity, self.quantities, slopes=slopes, timed=timed)
            for group in self.groups
        ]

    def _worst(self, error, runs) -> float:
        return max(error(*pair) for pair in zip(runs, self.truth, strict=True))

    def _meets(self, error: float, own: float, bound: float) -> bool:
        return self.margin * error + own <= bound

    @property
    def supported(self) -> bool:
        """Whether the reference is good enough for the errors asked for."""
        fine = self.own_value < self.value_bound
        if self.gradient_bound is None or self.own_gradient is None:
            return fine
        return fine and self.own_gradient < self.gradient_bound

    def trial(self, fidelity: Fidelity) -> Trial:
        """Compare the value first; the gradient, which costs more to compile, only if that
        passes."""
        runs = self._measured(fidelity, False)
        worst, value = max(run.status for run in runs), self._worst(value_error, runs)
        trial = Trial(
            fidelity,
            "",
            value_error=value,
            value_time=sum(run.time for run in runs),
            compile_time=sum(run.compile_time for run in runs),
        )
        if not self._meets(value, self.own_value, self.value_bound):
            return dataclasses.replace(trial, outcome=VALUE_FAILS)
        if worst >= Status.STEP_TOO_COARSE:
            return dataclasses.replace(trial, outcome=f"{worst.name}: {worst.text}")
        if self.gradient_bound is None or self.own_gradient is None:
            return dataclasses.replace(trial, outcome=PASSES, passed=True)
        runs = self._measured(fidelity, True)
        gradient = self._worst(gradient_error, runs)
        passed = self._meets(gradient, self.own_gradient, self.gradient_bound)
        return dataclasses.replace(
            trial,
            outcome=PASSES if passed else GRADIENT_FAILS,
            passed=passed,
            gradient_error=gradient,
            gradient_time=sum(run.time for run in runs),
            compile_time=trial.compile_time + sum(run.compile_time for run in runs),
        )

    def distance(self, trial: Trial) -> tuple[float, float]:
        """The errors of a trial over their bounds, by which the best of the failed ones is
        found."""
        value = math.inf if trial.value_error is None else trial.value_error / self.value_bound
        if self.gradient_bound is None:
            return value, 0.0
        if trial.gradient_error is None:
            return math.inf, value
        return max(value, trial.gradient_error / self.gradient_bound), value
