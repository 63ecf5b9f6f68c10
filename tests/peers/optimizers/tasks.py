"""The two design problems on which methods are compared."""

import dataclasses
import functools
import time
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

import fencejax as fj
from fencejax.design import DesignSpace, Numbers, Program
from fencejax.results import Status
from optimize.co_design.configuration import CoDesignConfig
from optimize.co_design.problem import Joint
from optimize.peak_force import impacts
from optimize.peak_force.configuration import PeakForceConfig

FEASIBLE = 1e-3
"""The largest violation of a margin [1] at which a design counts as feasible."""
STARTS = 3


@dataclasses.dataclass(frozen=True)
class Task:
    """min over shares s in [0, 1]^n of the worst force over `scale` [N], margins at least 0.

    `value` and `slopes` give what a problem of `fencejax.minimize` and its Jacobian are at z.
    `price` [1] is the time of the latter over that of the former; both were taken of one design
    at a time, `value_time` and `slopes_time` [s].
    """

    name: str
    title: str
    space: DesignSpace
    value: Callable[..., Any]
    slopes: Program
    starts: np.ndarray
    scale: float
    price: float
    value_time: float
    slopes_time: float

    @property
    def size(self) -> int:
        """The number of variables."""
        return len(self.space.names)

    def numbers(self, share: np.ndarray) -> tuple[float, np.ndarray, bool]:
        """The worst case over the scale, the margins, and whether the evaluation failed."""
        objectives, margins, status = jax.device_get(self.value(share))
        failed = int(np.max(status)) > Status.LEFT_OVER_TIP or not np.all(np.isfinite(objectives))
        return float(np.max(objectives)) / self.scale, np.asarray(margins), failed

    @staticmethod
    def failed(found: Numbers) -> bool:
        """Whether the numbers are not to be relied on."""
        finite = all(np.all(np.isfinite(part)) for part in found)
        return not finite or found.status > Status.LEFT_OVER_TIP

    def rows(self, share: np.ndarray) -> Numbers:
        """Everything over the scale, with the derivatives."""
        found = self.slopes(share)
        return found._replace(
            objectives=found.objectives / self.scale,
            objective_rows=found.objective_rows / self.scale,
        )


def _fastest(functions, repeats: int = 60) -> list[float]:
    """The shortest times, taken in turns: what else the machine does only lengthens them."""
    times = [[] for _ in functions]
    for _ in range(repeats):
        for function, taken in zip(functions, times, strict=True):
            begin = time.perf_counter()
            function()
            taken.append(time.perf_counter() - begin)
    return [min(taken) for taken in times]


def _task(name, title, space, problem, program, start) -> Task:
    value = jax.jit(problem)
    first = start
    rng = np.random.default_rng(5)
    # The paper's fence, and designs a sixth of the range away from it in every variable.
    moved = [
        np.clip(first + rng.uniform(-1 / 6, 1 / 6, first.size), 0.02, 0.98)
        for _ in range(STARTS - 1)
    ]
    one, all_rows = (lambda: jax.device_get(value(start))), (lambda: program(start))
    scale = float(np.max(one()[0]))
    all_rows()
    fast, slow = _fastest((one, all_rows))
    return Task(
        name, title, space, value, program, np.stack([first, *moved]), scale, slow / fast,
        fast, slow,
    )  # fmt: skip


def fence() -> Task:
    """The fence alone: five variables, the worst of four impacts, `fast`."""
    config = PeakForceConfig(
        variables=("thickness", "length_ratio", "width", "youngs_modulus", "density"),
        distances=(0.8, 1.0),
        masses=(10.0, 20.0),
    )
    space = DesignSpace(config.variables)
    blows = impacts.Impacts(config.distances, config.masses, config.drive_angle, config.duration)
    problem = functools.partial(
        impacts.problem(space, blows, config.limits, 0.0), fidelity=fj.Fidelity.fast()
    )
    start = np.asarray(space.to_shares(space.values_of(space.fence, space.drive)))
    title = "fence, worst of four impacts"
    return _task("fence", title, space, problem, Program(problem), start)


def motion() -> Task:
    """Fence and free-form motion: twenty variables, one whole sort, `fast`."""
    joint = Joint(CoDesignConfig(masses=(15.0,), offsets=(0.05,), controls=16, fidelity="fast"))

    def problem(z):
        read = joint.read(z, fj.Fidelity.fast())
        return *joint.combined(read, 0.0), read["status"]

    title = "fence and free-form motion, one whole sort"
    return _task("motion", title, joint.space, problem, Program(problem), joint.start)


TASKS = {"fence": fence, "motion": motion}
