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

# Half a second of impacts: to keep a chunk takes a fiftieth of a second.
_CPU_CHUNK = 4096
# Other devices are wide: they want all lanes at once, and many of them.
_WIDE_CHUNK = 16384
# So that there is something to report, and to keep, before the end.
_LEAST_CHUNKS = 16


@dataclasses.dataclass(frozen=True)
class Plan:
    """How a sweep is cut up: `chunk` lanes at a time on a device, in groups of `group` that go
    through their loops together; `chunks` of them."""

    chunk: int
    group: int
    chunks: int

    @classmethod
    def of(cls, count: int, chunk: int | None, group: int | None, platform: str) -> "Plan":
        """The plan for `count` lanes; what is `None` is chosen for the platform, whatever the
        number of its devices and of the workers. No chunk is longer than the sweep.

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
    """What a program is compiled for: `lane`, known by its description, by its measures and by its
    parts' structure, in chunks of groups, on devices."""

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
    lanes that are wanted -> arrays by name, of whose lanes the first so many count.

    It is traced once and its code is the same everywhere. One program over all devices would be
    compiled into another for each number of them, and its results differ in the last bit. The
    number of lanes is no constant, so that a chunk that is not full costs what it holds, and the
    code is the same for chunks of any length. Kept for further sweeps of the same kind.
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

    # Python's part one after the other, the compiler's part beside each other.
    programs = [lowered(device) for device in job.devices]
    with concurrent.futures.ThreadPoolExecutor(max_workers=len(programs)) as pool:
        return list(pool.map(lambda program: program.compile(), programs))


_compiling = threading.Lock()


def compile_chunks(
    lane: Lane, plan: Plan, devices: Sequence[Any]
) -> list[Callable[[np.ndarray], dict[str, np.ndarray]]]:
    """For each device the function from a chunk's points, (lanes, n), to its columns, each of
    shape (lanes,); compiled where it has not been before, for the finer rungs where a lane is in
    doubt for the first time."""
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
    """The columns of a chunk by one of the devices, each lane at the first rung at which its
    numbers are not in doubt, or at the last; with `rung`, where lanes are to be refined. `run` is
    the first rung's."""
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
    # Filled up with its last lane, so that every chunk has the same shape.
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
