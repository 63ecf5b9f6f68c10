"""A sweep's chunks on a Dask cluster, sent to whichever worker is free."""

import concurrent.futures
import contextlib
import functools
import importlib.metadata
import itertools
import pickle
import threading
import time
import uuid
from collections.abc import Generator, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import numpy as np

from .._xla import adopt_flags, compiler_flags
from .sweep import Lane, Sweep
from .sweep_program import Plan, compile_chunks
from .sweep_store import digest, sweep_library

if TYPE_CHECKING:
    import distributed

# Chunks sent in advance for each thread of the cluster, so that none waits for the next one, and
# the least number in all, as a cluster may grow. Their points are in the scheduler's memory.
_AHEAD = 4
_POLL_INTERVAL = 0.02  # [s]
_LEAST_AHEAD = 64

_GONE = (
    "The scheduler of the Dask cluster is gone. What was computed is kept: start it, and run the "
    "same sweep again."
)


@functools.cache
def _versions() -> tuple[tuple[str, str], ...]:
    names = ("fencejax", "jax", "jaxlib")
    return tuple((name, importlib.metadata.version(name)) for name in names)


class WorkerSettings(NamedTuple):
    """Settings that results depend on besides the job: versions, precision, compiler flags."""

    versions: tuple[tuple[str, str], ...]
    double: bool
    flags: str

    @classmethod
    def here(cls) -> "WorkerSettings":
        return cls(_versions(), bool(jax.config.read("jax_enable_x64")), compiler_flags())

    def adopt(self) -> None:
        """Apply the settings to this process, a worker.

        Raises `RuntimeError` where its versions differ, or where JAX has computed already with
        other flags.
        """
        mine = WorkerSettings.here()
        if mine == self:
            return
        if mine.versions != self.versions:
            different = ", ".join(
                f"{name} {there} here and {wanted} there"
                for (name, wanted), (_, there) in zip(self.versions, mine.versions, strict=True)
                if wanted != there
            )
            raise RuntimeError(
                f"A worker must have the versions of the process that sends it chunks, but has "
                f"{different}. Install the same versions on all machines."
            )
        adopt_flags(self.flags)
        jax.config.update("jax_enable_x64", self.double)


class _Job(NamedTuple):
    """The job of a worker: its settings, the pickled lane with its digest, and the plan. The lane
    contains JAX arrays and is therefore unpickled only after the settings are applied."""

    settings: WorkerSettings
    lane: bytes
    description: str
    plan: Plan


def _platform(settings: WorkerSettings) -> str:
    """The platform on which a worker computes."""
    settings.adopt()
    return jax.local_devices()[0].platform


@functools.lru_cache(maxsize=4)
def _lane(pickled: bytes, description: str) -> Lane:
    lane = pickle.loads(pickled)
    if digest(lane.describe()) != description:
        raise RuntimeError(
            "A worker must see the same scenes as the process that sends it chunks, but does not. "
            "Install the same packages on all machines."
        )
    return lane


_turns: dict[int, int] = {}


def _compute(job: _Job, points: np.ndarray) -> dict[str, np.ndarray]:
    """The columns of a chunk, by a worker."""
    job.settings.adopt()
    lane, devices = _lane(job.lane, job.description), jax.local_devices()
    # Each thread of a worker has a device of its own, if there are enough.
    turn = _turns.setdefault(threading.get_ident(), len(_turns))
    programs = compile_chunks(lane, job.plan, devices)
    return programs[turn % len(devices)](points)


class Cluster:
    """Computes on the workers of a Dask cluster: the next chunk goes to a free worker, and chunks
    of a lost worker go to another one."""

    def __init__(self, sweep: Sweep, client: "distributed.Client"):
        """Waits for the first worker."""
        self._library = sweep_library("distributed")
        self._sweep, self._client, self._settings = sweep, client, WorkerSettings.here()
        lane = sweep.lane
        self._lane = sweep_library("cloudpickle").dumps(lane), digest(lane.describe())
        with self._with_remedy():
            self.platform = client.submit(_platform, self._settings, pure=False).result()

    def chunks(
        self, plan: Plan, missing: list[int]
    ) -> Generator[tuple[int, dict[str, np.ndarray] | None], None, None]:
        """Chunks with their numbers as they are computed; first `None`."""
        if not missing:
            return
        yield -1, None
        values, left = self._sweep.samples.values, iter(missing)
        job, name = _Job(self._settings, *self._lane, plan), uuid.uuid4().hex
        sent: dict[Any, int] = {}

        def send(most: int) -> list[Any]:
            new = []
            for number in itertools.islice(left, most):
                points = values[plan.lanes(number, len(values))]
                future = self._client.submit(
                    _compute, job, points, key=f"sweep-{name}-{number}", priority=-number
                )
                sent[future] = number
                new.append(future)
            return new

        try:
            with self._with_remedy():
                arriving = self._library.as_completed(send(self._ahead()))
            while sent:
                with self._with_remedy():
                    if not arriving.has_ready():
                        if self._client.status != "running":
                            raise RuntimeError(_GONE)
                        time.sleep(_POLL_INTERVAL)
                        continue
                    future = next(arriving)
                    columns, number = future.result(), sent.pop(future)
                    future.release()
                    arriving.update(send(max(0, self._ahead() - len(sent))))
                yield number, columns
        finally:
            for future in sent:
                future.release()

    def _ahead(self) -> int:
        threads: Any = self._client.nthreads()
        return max(_LEAST_AHEAD, _AHEAD * sum(threads.values()))

    @contextlib.contextmanager
    def _with_remedy(self) -> Iterator[None]:
        """Raise a `RuntimeError` with a remedy for a lost cluster, or for a chunk that ends every
        worker."""
        try:
            yield
        except self._library.KilledWorker as error:
            raise RuntimeError(
                f"A chunk has ended {error.allowed_failures + 1} workers, one after the other: "
                "they lack memory, most likely. What was computed is kept: give them more and run "
                "the same sweep again, or take another folder and smaller chunks."
            ) from error
        except (concurrent.futures.CancelledError, OSError) as error:
            # Dask's own, where a connection is closed, is an OSError.
            raise RuntimeError(_GONE) from error
