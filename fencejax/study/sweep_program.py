"""The compiled program of a sweep's chunks: lanes in groups, on one device."""

import concurrent.futures
import dataclasses
import functools
import threading
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import SingleDeviceSharding

from .. import _check
from ..results import Measure, refined
from .lane_groups import CPU_GROUP, in_groups
from .scene_family import structure_of
from .sweep import Lane
from .sweep_store import digest
from .sweep_table import derivative

# Half a second of impacts; storing a chunk takes a fiftieth of a second.
_CPU_CHUNK = 4096
# Other devices compute many lanes at once.
_WIDE_CHUNK = 16384
# Enough chunks for progress reports and for resuming.
_LEAST_CHUNKS = 16


@dataclasses.dataclass(frozen=True)
class Plan:
    """The division of a sweep: `chunks` chunks of `chunk` lanes each, computed on a device in
    groups of `group` lanes that run through their loops together."""

    chunk: int
    group: int
    chunks: int

    @classmethod
    def of(cls, count: int, chunk: int | None, group: int | None, platform: str) -> "Plan":
        """The plan for `count` lanes; an argument that is `None` is chosen for the platform, but
        independent of the number of devices and workers. No chunk is longer than the sweep.

        Raises `ValueError` where the chunk is no multiple of the group.
        """
        narrow = platform == "cpu"
        if group is None:
            step = min(CPU_GROUP, count if chunk is None else chunk)
        else:
            step = _check.count("group", group, least=1)
        if chunk is None:
            even = -(-count // _LEAST_CHUNKS)
            size = min(_CPU_CHUNK if narrow else _WIDE_CHUNK, even)
            size = -(-size // step) * step
        else:
            size = _check.count("chunk", chunk, least=1)
        if group is None and not narrow:
            step = size
        if size % step:
            raise ValueError(
                f"Argument `chunk` must be a multiple of `group` = {step}, but is {size}. Write "
                f"{-(-size // step) * step}."
            )
        step = min(step, count)
        size = min(size, -(-count // step) * step)
        return cls(size, step, -(-count // size))

    def lanes(self, number: int, count: int) -> slice:
        """The lanes of a chunk, of `count` in all."""
        return slice(number * self.chunk, min(count, (number + 1) * self.chunk))


@dataclasses.dataclass(frozen=True)
class _Job:
    """The key of a compiled program: `lane`, identified by its description, its measures and the
    structure of its parts, with the sizes of chunk and group, and the devices."""

    lane: Lane = dataclasses.field(compare=False)
    description: str
    measures: tuple[Measure, ...]
    structure: Any
    chunk: int
    group: int
    devices: tuple[Any, ...]


# Four sweeps, with three rungs each.
@functools.lru_cache(maxsize=12)
def _compiled(job: _Job) -> list[Any]:
    """The compiled program, once for each device: points of shape (chunk, n) and the number of
    lanes wanted -> arrays by name, in which only those first lanes have a meaning.

    It is traced once, and its code is the same on every device. A single program over all devices
    would be compiled differently for each number of devices, and its results would differ in the
    last bit. The number of lanes is an argument, so that a partly filled chunk costs less, and the
    code is the same for chunks of any length. Cached for further sweeps of the same kind.
    """
    size = len(job.lane.family.names)
    batch = jax.vmap(job.lane)

    def computed(values, count):
        return in_groups(batch, values, job.group, count, job.lane.family.scene)

    jitted = jax.jit(computed)

    def lowered(device):
        place = SingleDeviceSharding(device)
        values = jax.ShapeDtypeStruct((job.chunk, size), jnp.result_type(float), sharding=place)
        count = jax.ShapeDtypeStruct((), jnp.int32, sharding=place)
        return jitted.lower(values, count)

    # Programs are traced one after the other and compiled in parallel.
    programs = [lowered(device) for device in job.devices]
    with concurrent.futures.ThreadPoolExecutor(max_workers=len(programs)) as pool:
        return list(pool.map(lambda program: program.compile(), programs))


_compiling = threading.Lock()


def compile_chunks(
    lane: Lane, plan: Plan, devices: Sequence[Any]
) -> list[Callable[[np.ndarray], dict[str, np.ndarray]]]:
    """For each device the function from a chunk's points, (lanes, n), to its columns, each of
    shape (lanes,). It is compiled at the first use, and for a finer rung when a lane is first in
    doubt."""
    runs = _runs(lane, plan, devices)
    return [functools.partial(_settled, run, lane, plan, devices, k) for k, run in enumerate(runs)]


def _runs(
    lane: Lane, plan: Plan, devices: Sequence[Any]
) -> list[Callable[[np.ndarray], dict[str, np.ndarray]]]:
    """For each device the function from points to columns at the lane's own fidelity."""
    description = digest(dataclasses.replace(lane, refine=False).describe())
    with _compiling:
        found = _compiled(
            _Job(
                lane, description, lane.measures, structure_of(lane.family),
                plan.chunk, plan.group, tuple(devices),
            )
        )  # fmt: skip
    pairs = zip(found, devices, strict=True)
    return [functools.partial(_computed, lane, plan, *pair) for pair in pairs]


def _settled(
    run: Callable[[np.ndarray], dict[str, np.ndarray]],
    lane: Lane,
    plan: Plan,
    devices: Sequence[Any],
    device: int,
    points: np.ndarray,
) -> dict[str, np.ndarray]:
    """The columns of a chunk on one of the devices, each lane at the first rung at which it is not
    in doubt, or at the last; with a column `rung` where the lane has `refine`. `run` computes the
    first rung."""
    if not lane.refine:
        return run(points)
    finer = lane.rungs()

    def compute(rung: int, part: np.ndarray):
        columns = (_runs(finer[rung - 1], plan, devices)[device] if rung else run)(part)
        return columns, columns["status"]

    found = refined(compute, points, 1 + len(finer), grouped=False)
    return {**found.numbers, "rung": found.rungs.astype(np.int32)}


def _computed(
    lane: Lane, plan: Plan, program: Any, device: Any, points: np.ndarray
) -> dict[str, np.ndarray]:
    """The columns of a chunk."""
    count = len(points)
    # The last lane is repeated, so that every chunk has the same shape.
    picks = np.minimum(np.arange(plan.chunk), count - 1)
    values = points[picks].astype(jnp.result_type(float))
    wanted = np.asarray(count, np.int32)
    arrays = jax.device_get(program(*jax.device_put((values, wanted), device)))
    columns = {name: np.asarray(leaf)[:count] for name, leaf in arrays.items()}
    slopes = columns.pop("gradient", None)
    if slopes is not None:
        for name, slope in zip(lane.family.names, slopes.T, strict=True):
            columns[derivative(str(lane.gradient_of), name)] = slope
    return columns
