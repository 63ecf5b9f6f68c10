"""Values, elasticities and run times of scenes at a fidelity, and the errors between two runs."""

import functools
import time
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..fidelity import Fidelity
from ..lanes import each_lane
from ..results import Status
from ..simulate import simulate
from .scene_groups import Group


class Measured(NamedTuple):
    """Quantities of shape (scenes, q), elasticities (scenes, q, n) or `None`, the worst status,
    run time [s], compile time [s]."""

    values: np.ndarray
    slopes: np.ndarray | None
    status: Status
    time: float
    compile_time: float


def _program(group: Group, fidelity: Fidelity, quantities: tuple[str, ...], slopes: bool):
    """Scenes -> quantities, elasticities' numerators, statuses."""

    def run(scales, scene):
        if scales:
            scene = group.scaled(scene, scales)
        result = simulate(scene, fidelity=fidelity, only=quantities)
        values = jnp.stack([getattr(result, name) for name in quantities])
        return values, (values, result.status)

    def one(scene):
        if not slopes:
            values, (_, status) = run((), scene)
            return values, None, status
        ones = [jnp.ones_like(leaf) for leaf in group.read(scene)]
        rows, (values, status) = jax.jacfwd(run, has_aux=True)(ones, scene)
        return values, jnp.concatenate([r.reshape(len(quantities), -1) for r in rows], 1), status

    return jax.jit(functools.partial(each_lane, one))


def _median_time(program, scenes) -> float:
    """Median run time [s] of three to fifteen runs, half a second of them at most."""
    times: list[float] = []
    while len(times) < 3 or (len(times) < 15 and sum(times) < 0.5):
        begin = time.perf_counter()
        jax.block_until_ready(program(scenes))
        times.append(time.perf_counter() - begin)
    return float(np.median(times))


def measure(
    group: Group,
    fidelity: Fidelity,
    quantities: tuple[str, ...],
    *,
    slopes: bool,
    timed: bool = True,
) -> Measured:
    """Compile and run the scenes of a group, with elasticities where `slopes`; the run time is a
    median of several runs where `timed`, else that of the first."""
    begin = time.perf_counter()
    program = _program(group, fidelity, quantities, slopes).lower(group.scenes).compile()
    compile_time = time.perf_counter() - begin
    begin = time.perf_counter()
    values, rows, status = jax.device_get(program(group.scenes))
    spent = time.perf_counter() - begin
    if rows is not None:
        # p dq/dp / q; 0 where neither the quantity nor its derivative is anything but 0.
        nothing = (values == 0)[..., None] & (rows == 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            rows = np.where(nothing, 0.0, rows / values[..., None])
    spent = _median_time(program, group.scenes) if timed else spent
    return Measured(values, rows, Status(int(np.max(status))), spent, compile_time)


def value_error(measured: Measured, truth: Measured) -> float:
    """Largest |q - q_ref| / |q_ref| [1]."""
    a, b = measured.values, truth.values
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.where(same, 0.0, np.abs(a - b) / np.abs(b))
    return _largest(error)


def gradient_error(measured: Measured, truth: Measured) -> float:
    """Largest |e - e_ref| / |e_ref| [1], e the elasticities of a quantity in a scene."""
    assert measured.slopes is not None
    assert truth.slopes is not None
    unknown = np.isnan(measured.slopes) & np.isnan(truth.slopes)
    off = np.linalg.norm(np.where(unknown, 0.0, measured.slopes - truth.slopes), axis=-1)
    size = np.linalg.norm(np.where(unknown, 0.0, truth.slopes), axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.where(off == 0, 0.0, off / size)
    return _largest(error)


def _largest(error: np.ndarray) -> float:
    """The largest error; unknown ones count as infinite."""
    return float(np.max(np.where(np.isnan(error), np.inf, error)))
