"""Many scenes at a time: chunk by chunk, on every device, in several processes, and resumable."""

import concurrent.futures
import dataclasses
import functools
import math
import queue
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import SingleDeviceSharding

from .. import _check
from ..results import Status
from .sweep import Lane, Sweep
from .sweep_store import Store, digest
from .sweep_table import SweepTable

FILE = "sweep.npz"
"""Name of the file with the whole sweep, in its folder."""

# Lanes that go through a loop together: many keep a core's vector units busy, few wait less for
# the slowest. Measured on one core: 64 is the best, 32 and 128 are 10 % slower, 16 is 25 %.
_CPU_GROUP = 64
_CPU_CHUNK = 1024
# Other devices are wide: they want all lanes at once, and many of them.
_WIDE_CHUNK = 16384
# So that there is something to report, and to keep, before the end.
_LEAST_CHUNKS = 16
# While others compute [s].
_LOOKED_AGAIN = 0.2
_SAID_AGAIN = 10.0


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
        number of its devices and of the processes.

        Raises `ValueError` where the chunk is no multiple of the group.
        """
        narrow = platform == "cpu"
        if group is None:
            step = min(_CPU_GROUP, count if chunk is None else chunk)
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
        return cls(size, step, -(-count // size))


@dataclasses.dataclass(frozen=True)
class Progress:
    """How far a process is with its share: lanes `done` (`before` of them in earlier runs) of
    `total`; `rate` [lanes/s] and `left` [s], NaN until the first chunk is there; `elapsed` [s],
    compilation included; `bad`, lanes without good numbers in this run; `awaited`, chunks of other
    processes that are not there yet, once this one has done its share."""

    done: int
    before: int
    total: int
    rate: float
    left: float
    elapsed: float
    bad: int
    awaited: int = 0


@dataclasses.dataclass(frozen=True)
class _Job:
    """What a program is compiled for: `lane`, known by its description, in chunks of groups, on
    devices."""

    lane: Lane = dataclasses.field(compare=False)
    description: str
    chunk: int
    group: int
    devices: tuple[Any, ...]


@functools.lru_cache(maxsize=16)
def _compiled(job: _Job) -> list[Any]:
    """The compiled program, once for each device: points of shape (chunk, n) and the number of
    groups that are wanted -> arrays by name, of whose lanes those of the wanted groups count.

    It is traced once and its code is the same everywhere. One program over all devices would be
    compiled into another for each number of them, and its results differ in the last bit. The
    number of groups is no constant, so that a chunk that is not full costs what it holds, and the
    code is the same for chunks of any length. Kept for further sweeps of the same kind.
    """
    size = len(job.lane.family.names)
    batch = jax.vmap(job.lane)

    def computed(values, wanted):
        groups = values.reshape(job.chunk // job.group, job.group, size)

        def put(index, found):
            one = batch(jax.lax.dynamic_index_in_dim(groups, index, keepdims=False))
            return {name: leaf.at[index].set(one[name]) for name, leaf in found.items()}

        shapes = jax.eval_shape(batch, groups[0])
        empty = {n: jnp.zeros((len(groups), *s.shape), s.dtype) for n, s in shapes.items()}
        found = jax.lax.fori_loop(0, wanted, put, empty)
        return {name: leaf.reshape(job.chunk, *leaf.shape[2:]) for name, leaf in found.items()}

    jitted = jax.jit(computed)

    def lowered(device):
        place = SingleDeviceSharding(device)
        values = jax.ShapeDtypeStruct((job.chunk, size), jnp.result_type(float), sharding=place)
        wanted = jax.ShapeDtypeStruct((), jnp.int32, sharding=place)
        return jitted.lower(values, wanted)

    # Python's part one after the other, the compiler's part beside each other.
    programs = [lowered(device) for device in job.devices]
    with concurrent.futures.ThreadPoolExecutor(max_workers=len(programs)) as pool:
        return list(pool.map(lambda program: program.compile(), programs))


def compile_chunks(sweep: Sweep, plan: Plan, devices: Sequence[Any]) -> list[Any]:
    """The program of each device for a sweep's chunks, compiled where it has not been before."""
    lane = sweep.lane
    return _compiled(
        _Job(lane, digest(lane.describe()), plan.chunk, plan.group, tuple(devices))
    )


def run_sweep(
    sweep: Sweep,
    folder: Path | str,
    *,
    chunk: int | None = None,
    group: int | None = None,
    devices: Sequence[Any] | None = None,
    share: tuple[int, int] | None = None,
    wait: bool = True,
    progress: Callable[[Progress], None] | None = None,
) -> SweepTable | None:
    """Compute a sweep into a folder, or what is missing of it there.

    Every finished chunk is a file, written in one go: after a kill, the same call goes on where it
    stopped. The folder's manifest holds the configuration; at the end there is `FILE`.

    **Arguments:**

    - `folder`: made where it is missing; shared by all processes.
    - `chunk`: lanes that a device computes at a time, which bounds its memory; by default 1024 on
      a CPU (a device a core: `tune_compiler(devices=...)`), 16384 elsewhere, less for few lanes.
    - `group`: lanes of these that go through their loops together, by default 64 on a CPU, all
      elsewhere. They wait for each other's last Newton iteration, so that results change with
      their company within the tolerance of these iterations (relative, up to 1e-6 or so).
    - `devices`: by default all of this process.
    - `share`: (k, p): this process computes every p-th chunk from the k-th on; by default its
      place among the processes of `jax.distributed`, (0, 1) for one alone.
    - `wait`: stay until the other processes have done their shares, too.
    - `progress`: called after each chunk.

    Returns the table to process 0, `None` to the others; also `None` to process 0 where it has not
    waited and chunks are missing. The results are the same, bit by bit, however many chunks,
    devices and processes of one kind took part, and however often they were stopped.

    Raises `ValueError` where the folder holds another sweep and `RuntimeError` where another
    process is at work on the same share.
    """
    begin = time.perf_counter()
    index, processes = _share(share)
    devices = jax.local_devices() if devices is None else list(devices)
    count = sweep.samples.count
    plan = Plan.of(count, chunk, group, devices[0].platform)
    # Chunks of one cut do not fit another.
    store = Store(folder, sweep.describe() | {"chunk": plan.chunk, "group": plan.group})
    finished = _finished(store)
    if finished is not None:
        return finished if index == 0 else None
    store.lock(index)
    try:
        there = store.done()
        mine = range(index, plan.chunks, processes)
        missing = [number for number in mine if number not in there]

        def lanes(numbers) -> int:
            return sum(min(plan.chunk, count - plan.chunk * number) for number in numbers)

        total = lanes(mine)
        before = done = total - lanes(missing)
        bad, rate, start = 0, float("nan"), None
        for number, arrays in _computed(sweep, plan, devices, missing):
            if arrays is None:
                # Compiled: from here on the clock tells the speed.
                start = time.perf_counter()
                continue
            store.write(number, arrays)
            done += lanes([number])
            status = arrays["status"]
            bad += int(np.sum((status < 0) | (status > Status.LEFT_OVER_TIP)))
            now = time.perf_counter()
            assert start is not None
            rate = (done - before) / (now - start)
            if progress is not None:
                left = (total - done) / rate
                progress(Progress(done, before, total, rate, left, now - begin, bad))
        said = -math.inf
        while awaited := _awaited(store, plan, index):
            if not wait:
                return None
            now = time.perf_counter()
            if progress is not None and now - said > _SAID_AGAIN:
                said = now
                progress(Progress(done, before, total, rate, 0.0, now - begin, bad, awaited))
            time.sleep(_LOOKED_AGAIN)
        if index > 0:
            return None
        table = _gather(sweep, plan, store)
        table.save(store.folder / FILE)
        store.tidy()
        return table
    finally:
        store.release()


def _awaited(store: Store, plan: Plan, index: int) -> int:
    """Chunks that are not there yet; for processes other than 0, at least 1 until the whole sweep
    is in its file: they stay, so that all leave together."""
    awaited = plan.chunks - len(store.done())
    if index > 0 and not (store.folder / FILE).exists():
        return max(1, awaited)
    return awaited


def _share(share: tuple[int, int] | None) -> tuple[int, int]:
    index, processes = (jax.process_index(), jax.process_count()) if share is None else share
    _check.count("share[1]", processes, least=1)
    _check.count("share[0]", index)
    if index >= processes:
        raise ValueError(
            f"Argument `share` must be (k, p) with k below p, but is ({index}, {processes})."
        )
    return index, processes


def _computed(
    sweep: Sweep, plan: Plan, devices: Sequence[Any], missing: list[int]
) -> Iterator[tuple[int, dict[str, np.ndarray] | None]]:
    """Chunks by number as they are computed; before them, once it is compiled, `None`.

    Each device has a thread that takes the next chunk as soon as it is done with one: no device
    waits for another.
    """
    if not missing:
        return
    used = list(devices)[: len(missing)]
    programs = compile_chunks(sweep, plan, used)
    yield -1, None
    found: queue.SimpleQueue = queue.SimpleQueue()
    left, stop = iter(missing), threading.Event()
    taking = threading.Lock()

    def next_chunk() -> int | None:
        with taking:
            return None if stop.is_set() else next(left, None)

    def work(program, device) -> None:
        try:
            while (number := next_chunk()) is not None:
                found.put((number, _chunk(sweep, plan, program, device, number)))
        except BaseException as raised:
            found.put((-1, raised))

    with concurrent.futures.ThreadPoolExecutor(max_workers=len(used)) as pool:
        try:
            for program, device in zip(programs, used, strict=True):
                pool.submit(work, program, device)
            for _ in missing:
                number, arrays = found.get()
                if isinstance(arrays, BaseException):
                    raise arrays
                yield number, arrays
        finally:
            stop.set()


def _chunk(
    sweep: Sweep, plan: Plan, program, device: Any, number: int
) -> dict[str, np.ndarray]:
    """The arrays of a chunk, one entry a lane."""
    values = sweep.samples.values
    lanes = min(plan.chunk, len(values) - number * plan.chunk)
    # Filled up with its last lane, so that every chunk has the same shape.
    picks = number * plan.chunk + np.minimum(np.arange(plan.chunk), lanes - 1)
    points = values[picks].astype(jnp.result_type(float))
    wanted = np.asarray(-(-lanes // plan.group), np.int32)
    arrays = jax.device_get(program(*jax.device_put((points, wanted), device)))
    return {name: np.asarray(leaf)[:lanes] for name, leaf in arrays.items()}


def _finished(store: Store) -> SweepTable | None:
    """The whole sweep, where it is there already."""
    path = store.folder / FILE
    if not path.exists():
        return None
    table = SweepTable.load(path)
    return table if table.configuration == store.configuration else None


def _gather(sweep: Sweep, plan: Plan, store: Store) -> SweepTable:
    samples = sweep.samples
    parts = [store.read(number) for number in range(plan.chunks)]
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    slope = whole.get("gradient")
    return SweepTable(
        variables=dict(zip(samples.names, samples.values.T.copy(), strict=True)),
        outputs={name: whole[name] for name in sweep.outputs},
        status=whole["status"],
        gradient_of=sweep.gradient_of,
        gradient={} if slope is None else dict(zip(samples.names, slope.T.copy(), strict=True)),
        units=sweep.units,
        shape=samples.shape,
        scalings={v.name: v.scaling for v in samples.variables},
        configuration=store.configuration,
    )
