"""Running a sweep chunk by chunk, on all devices or on a cluster, and resuming it."""

import concurrent.futures
import contextlib
import dataclasses
import queue
import threading
import time
from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from ..results import Status
from .sweep import Sweep
from .sweep_cluster import Cluster
from .sweep_program import Plan, compile_chunks
from .sweep_store import FILE, Store, sweep_library
from .sweep_table import SweepTable, lanes

if TYPE_CHECKING:
    import distributed
    import xarray


@dataclasses.dataclass(frozen=True)
class Progress:
    """The progress of a sweep: lanes `done` (`before` of them in earlier runs) of `total`; `rate`
    [lanes/s]; `left`, the remaining time [s]; `elapsed` [s], compilation included; `bad`, the lanes
    of this run without good numbers."""

    done: int
    before: int
    total: int
    rate: float
    left: float
    elapsed: float
    bad: int


def run_sweep(
    sweep: Sweep,
    folder: Path | str,
    *,
    chunk: int | None = None,
    group: int | None = None,
    devices: Sequence[Any] | None = None,
    client: "distributed.Client | None" = None,
    progress: Callable[[Progress], None] | None = None,
) -> SweepTable:
    """Compute a sweep, or the missing part of it, into a folder.

    The folder's `FILE` is a Zarr store with an `xarray.Dataset` along the dimension `lane`; every
    finished chunk is written as a region of it, with a record of its job, its number and the digest
    of its numbers. After a kill the same call resumes the sweep. It needs the extra `sweep`.

    **Arguments:**

    - `folder`: created where it is missing.
    - `chunk`: lanes that a device computes at a time, which bounds its memory; by default 4096 on
      a CPU (a device a core: `tune_compiler(devices=...)`), 16384 elsewhere, less for few lanes.
    - `group`: lanes of a chunk that run through their loops together, by default 64 on a CPU, all
      elsewhere. Each loop runs until the slowest lane of its group is done; the other lanes keep
      their numbers meanwhile.
    - `devices`: of this process; by default all.
    - `client`: of a Dask cluster, whose workers compute instead of this process: chunks go to free
      workers, and those of a lost worker are computed again. Only this process writes.
    - `progress`: called after each chunk.

    Lanes in doubt are computed again at the next rungs (`Sweep.refine`), together with those of
    their chunk. The results are identical bit by bit for any number of devices and workers of one
    kind and after any interruptions; without lanes in doubt, also for any chunk size.

    Raises `ImportError` without the extra; `ValueError` where the folder has another sweep, one of
    another version or source of fencejax, or something else, and for measures and parts whose code
    cannot be read; `OSError` where it cannot be written; `RuntimeError` where the cluster is lost.

    >>> samples = fj.sampling.given({"mass": [5.0, 15.0]})
    >>> family, rigid = fj.SceneFamily("oblique_impact", ["mass"]), fj.Fidelity.coarse(modes=0)
    >>> fj.run_sweep(fj.Sweep(family, samples, ["peak_force"], fidelity=rigid), "two")
    SweepTable of 2 lanes
      mass [kg]       [5 kg, 15 kg]
      peak_force [N]  [1175 N, 2866 N]
      status          SUCCESSFUL 2
    """
    begin = time.perf_counter()
    sweep_library("zarr")
    engine = _Devices(sweep, devices) if client is None else Cluster(sweep, client)
    count = sweep.samples.count
    plan = Plan.of(count, chunk, group, engine.platform)
    # Chunks of different sizes are not compatible.
    configuration: dict[str, Any] = sweep.describe() | {"chunk": plan.chunk, "group": plan.group}
    store = Store(Path(folder) / FILE, _empty(sweep, plan, configuration), plan.chunk)
    whole = {name: np.empty(count, kind) for name, kind in store.columns.items()}

    def put(number: int, columns: dict[str, np.ndarray]) -> int:
        here = plan.lanes(number, count)
        for name, column in whole.items():
            column[here] = columns[name]
        return here.stop - here.start

    missing, done = [], 0
    for number in range(plan.chunks):
        found = store.read(number)
        if found is None:
            missing.append(number)
        else:
            done += put(number, found)
    before, bad, start = done, 0, 0.0
    with contextlib.closing(engine.chunks(plan, missing)) as computed:
        for number, columns in computed:
            if columns is None:
                # Compiled: from here on the time gives the rate.
                start = time.perf_counter()
                continue
            store.write(number, columns)
            done += put(number, columns)
            status = columns["status"]
            bad += int(np.sum((status < 0) | (status > Status.LEFT_OVER_TIP)))
            if progress is not None:
                now = time.perf_counter()
                rate = (done - before) / (now - start)
                left = (count - done) / rate
                progress(Progress(done, before, count, rate, left, now - begin, bad))
    return SweepTable(_empty(sweep, plan, configuration, whole))


def _empty(
    sweep: Sweep, plan: Plan, configuration: dict[str, Any], whole: Any = None
) -> "xarray.Dataset":
    """The sweep's dataset, with the given columns or, lazily, with zeros."""
    samples = sweep.samples
    if whole is None:
        array, real = sweep_library("dask.array"), np.dtype(jnp.result_type(float))
        kinds = {**dict.fromkeys(sweep.columns, real), "status": np.dtype(np.int32)}
        if sweep.refine:
            kinds["rung"] = np.dtype(np.int32)
        whole = {
            name: array.zeros(samples.count, dtype=kind, chunks=plan.chunk)
            for name, kind in kinds.items()
        }
    return lanes(
        dict(zip(samples.names, samples.values.T.copy(), strict=True)),
        {name: whole[name] for name in sweep.columns},
        whole["status"],
        whole.get("rung"),
        units=sweep.units | sweep.columns,
        scalings={v.name: v.scaling for v in samples.variables},
        outputs=tuple(sweep.outputs),
        gradient_of=sweep.gradient_of,
        shape=samples.shape,
        configuration=configuration,
    )


class _Devices:
    """Computes in this process: each device has a thread that takes the next chunk as soon as it
    has finished one, so that no device waits for another."""

    def __init__(self, sweep: Sweep, devices: Sequence[Any] | None):
        self._sweep = sweep
        self._devices = jax.local_devices() if devices is None else list(devices)
        self.platform = self._devices[0].platform

    def chunks(
        self, plan: Plan, missing: list[int]
    ) -> Generator[tuple[int, dict[str, np.ndarray] | None], None, None]:
        """Chunks with their numbers as they are computed; first, after compilation, `None`."""
        if not missing:
            return
        used, lane = self._devices[: len(missing)], self._sweep.lane
        programs = compile_chunks(lane, plan, used)
        yield -1, None
        values = self._sweep.samples.values
        found: queue.SimpleQueue = queue.SimpleQueue()
        left, taking, stop = iter(missing), threading.Lock(), threading.Event()

        def next_chunk() -> int | None:
            with taking:
                return None if stop.is_set() else next(left, None)

        def work(program) -> None:
            try:
                while (number := next_chunk()) is not None:
                    found.put((number, program(values[plan.lanes(number, len(values))])))
            except BaseException as raised:
                found.put((-1, raised))

        with concurrent.futures.ThreadPoolExecutor(max_workers=len(used)) as pool:
            try:
                for program in programs:
                    pool.submit(work, program)
                for _ in missing:
                    number, columns = found.get()
                    if isinstance(columns, BaseException):
                        raise columns
                    yield number, columns
            finally:
                stop.set()
