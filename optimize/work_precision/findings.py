"""The results of the job, for each fidelity and in total."""

import dataclasses

import numpy as np

import fencejax as fj

from . import front
from .configuration import WorkPrecisionConfig
from .errors import Errors, Outcome, spread
from .ladder import Ladder, Point
from .measure import Times


@dataclasses.dataclass(frozen=True, eq=False)
class Rung:
    """A fidelity measured over all impacts: its outcome and errors, run times of one lane in a
    batch [s] by number of lanes, bytes of intermediate arrays of the batched gradient, and
    optionally its costs in a separate process. `named`: one of the named rungs."""

    name: str
    named: bool
    fidelity: fj.Fidelity
    outcome: Outcome
    errors: Errors
    value_times: dict[int, Times]
    gradient_time: Times
    memory: int | None
    cold: dict | None

    def error(self, kind: str) -> float:
        """95 % quantile of the peak force's error over the scenes, of `"value"` or `"gradient"`."""
        return spread(getattr(self.errors, kind)[:, 0])["95 %"]


@dataclasses.dataclass(frozen=True, eq=False)
class Report:
    """The results of the job.

    `rungs` and `grid` are measured over all impacts, `knobs` over the first ones: each point with
    its errors against the finest of its knob. `split` holds, by rung, errors of (discretisation,
    smoothing). `stages` holds errors of the rungs in slide and sort. `check` are the reference's
    own errors, by scene. `predicted` are errors of the whole product grid if effects added up.
    """

    config: WorkPrecisionConfig
    ladder: Ladder
    truth: Outcome
    check: dict[str, Errors]
    rungs: list[Rung]
    grid: list[Rung]
    knobs: dict[str, list[tuple[Point, Errors]]]
    split: dict[str, tuple[Errors, Errors]]
    stages: dict[str, dict[str, Errors]]
    integrators: dict[str, Errors]
    orders: dict[str, dict]
    predicted: dict[fj.Fidelity, tuple[float, float]]
    failures: dict[str, str]
    elapsed: float

    def front(self, kind: str) -> list[Rung]:
        """The measured points that no other dominates in time a lane and error, of `"value"` or
        `"gradient"`, the fastest first."""
        points = [*self.rungs, *self.grid]
        lanes = len(self.truth.values)
        times = [
            p.value_times[lanes].median if kind == "value" else p.gradient_time.median
            for p in points
        ]
        return [points[k] for k in front.pareto(times, [p.error(kind) for p in points])]

    @property
    def succeeded(self) -> bool:
        """Whether every point ran and gave finite numbers."""
        return not self.failures and bool(np.all(np.isfinite(self.truth.values)))
