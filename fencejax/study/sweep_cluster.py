"""A sweep's chunks on a Dask cluster: sent as they are wanted, computed by whom is free."""

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

# Chunks sent ahead of each thread of the cluster, so that none waits for the next, and at least:
# a cluster may grow. Their points are in the scheduler's memory.
_AHEAD = 4
_LOOKED_AGAIN = 0.02  # [s]
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
    """What results depend on beside the job: the versions, the precision, the compiler's flags."""

    versions: tuple[tuple[str, str], ...]
    double: bool
    flags: str

    @classmethod
    def here(cls) -> "WorkerSettings":
        return cls(_versions(), bool(jax.config.read("jax_enable_x64")), compiler_flags())

    def adopt(self) -> None:
        """Set this process, a worker, in the same way.

        Raises `RuntimeError` where its versions differ, or where JAX has computed already with
        other flags.
        """
        mine = WorkerSettings.here()
        if mine == self:
            return
        if mine.versions != self.versions:
            told = ", ".join(
                f"{name} {there} here and {wanted} there"
                for (name, wanted), (_, there) in zip(self.versions, mine.versions, strict=True)
                if wanted != there
            )
            raise RuntimeError(
                f"A worker must have the versions of the process that sends it chunks, but has "
                f"{told}. Install the same versions on all machines."
            )
        adopt_flags(self.flags)
        jax.config.update("jax_enable_x64", self.double)


class _Job(NamedTuple):
    """What a worker has to know: how it is set, the pickled lane and its digest, the plan. The lane
    is unpickled after the settings are made: it holds JAX's arrays."""

    settings: WorkerSettings
    lane: bytes
    description: str
    plan: Plan


def _platform(settings: WorkerSettings) -> str:
    """What a worker computes on."""
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
    # Each of a worker's threads has its device, as far as there are as many.
    turn = _turns.setdefault(threading.get_ident(), len(_turns))
    programs = compile_chunks(lane, job.plan, devices)
    return programs[turn % len(devices)](points)


class Cluster:
    """The workers of a Dask cluster compute: the next chunk goes to whom is free, and those of a
    worker that is lost to another one."""

    def __init__(self, sweep: Sweep, client: "distributed.Client"):
        """Waits for the first worker."""
        self._library = sweep_library("distributed")
        self._sweep, self._client, self._settings = sweep, client, WorkerSettings.here()
        lane = sweep.lane
        self._lane = sweep_library("cloudpickle").dumps(lane), digest(lane.describe())
        with self._said():
            self.platform = client.submit(_platform, self._settings, pure=False).result()

    def chunks(
        self, plan: Plan, missing: list[int]
    ) -> Generator[tuple[int, dict[str, np.ndarray] | None], None, None]:
        """Chunks by number as they are computed; before them `None`."""
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
            with self._said():
                arriving = self._library.as_completed(send(self._ahead()))
            while sent:
                with self._said():
                    if not arriving.has_ready():
                        if self._client.status != "running":
                            raise RuntimeError(_GONE)
                        time.sleep(_LOOKED_AGAIN)
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
    def _said(self) -> Iterator[None]:
        """A cluster that is lost, or a chunk that ends every worker, in one line with its
        remedy."""
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
