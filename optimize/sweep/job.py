"""Sweeps: scenes over a grid, a Latin hypercube or a Sobol sequence of any of their numbers.

    python -m optimize.sweep --out out --vary mass=1:30:64 distance=0.5:1.1:64

computes the points chunk by chunk on every core (or GPU) of the machine, prints its progress, and
stores every finished chunk: the same command resumes after a kill. It counts the statuses and
writes sweep.zarr (an `xarray.Dataset` with variables, outputs, units, statuses:
`fencejax.SweepTable.load(out)`, or `xarray.open_zarr(path, consolidated=False)`), result.json and
figures. It needs `pip install -e '.[sweep]'`.

Larger ones run on a Dask cluster, whose scheduler and workers have the same packages. By hand:

    dask scheduler                                              # on HOST
    dask worker tcp://HOST:8786 --nworkers auto --nthreads 1    # on every machine; GPUs: dask-cuda
    python -m optimize.sweep --scheduler tcp://HOST:8786 --out out --scene whole_sort \\
        --sampling sobol --count 1048576 --vary mass offset angle belt_speed thickness

On Slurm, `dask_jobqueue.SLURMCluster(cores=64, processes=64, memory="64GB").scale(jobs=4)`, on
Kubernetes `dask_kubernetes.operator.KubeCluster`, give the scheduler's address, or the `Client` for
`fencejax.run_sweep(..., client=client)`. Chunks go to free workers. Where a worker dies, another
one computes its chunk again; where the scheduler or this process dies, finished chunks are kept,
and the same command resumes the sweep. Only this process writes.
"""

import contextlib
import dataclasses
import logging
import multiprocessing.resource_tracker
import os
import signal
import time
from collections.abc import Iterator
from typing import Any

import jax
import numpy as np

import fencejax as fj
from fencejax.study import Progress, SweepTable, run_sweep, sweep_library

from ..common import command
from ..common.files import write_figure
from ..common.report import write_json
from . import page
from .configuration import SweepConfig, configure
from .outcome import Outcome

# Timeout for an answer of the scheduler [s].
_PATIENCE = 15


class _Reporter:
    """Prints the progress of the sweep, at most once in `every` seconds."""

    def __init__(self, say, every: float = 1.0):
        self._say, self._every, self._last = say, every, -np.inf

    def __call__(self, now: Progress) -> None:
        if now.elapsed - self._last < self._every and now.done < now.total:
            return
        self._last = now.elapsed
        self._say(
            f"  {now.done:9d} of {now.total} lanes {100 * now.done / now.total:6.1f} %"
            f"{now.rate:10.0f} lanes/s {_clock(now.left):>9} left {now.bad:7d} bad"
        )


def _clock(seconds: float) -> str:
    """A time as h:mm:ss."""
    whole = int(np.ceil(seconds))
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"


def main(config: SweepConfig | None = None, *, quiet: bool = False) -> Outcome:
    """Run the job, or the missing part of it, and write its files into `config.out`."""
    say = command.begin(quiet)
    begin = time.perf_counter()
    config = SweepConfig() if config is None else config
    # Missing libraries are reported before anything is compiled.
    for library in ("xarray", "zarr", "dask"):
        sweep_library(library)
    sweep = config.sweep()
    for line in config.notes:
        say(line)
    lanes = f"{sweep.samples.count} lanes of {config.scene} over {', '.join(sweep.samples.names)}"
    with _client(config) as client:
        if client is None:
            devices = jax.local_devices()
            place = f"{len(devices)} {devices[0].platform} device{'s' if len(devices) > 1 else ''}"
            say(f"{lanes}, {place}; compiling ...")
        else:
            say(f"{lanes}, on the workers of {client.scheduler.address}; waiting for the first ...")
        table = run_sweep(
            sweep,
            config.out,
            chunk=config.chunk or None,
            group=config.group or None,
            client=client,
            progress=_Reporter(say),
        )
    counts, missing = table.counts(), table.missing()
    say("statuses: " + ", ".join(f"{name} {number}" for name, number in counts.items()))
    for status in fj.Status:
        if status.name in counts and status > fj.Status.LEFT_OVER_TIP:
            flag = " (by --fidelity)" if status.numerical else ""
            say(f"  {status.name}: {status.text}{flag}")
    if np.any(table.rung):
        say(f"computed again at a finer fidelity: {np.sum(table.rung > 0)} lanes")
    for name, number in missing.items():
        say(f"  {name}: not a number in {number} lanes whose status is good")
    share = 1 - float(np.mean(table.good))
    outcome = Outcome(table, share <= config.tolerated, time.perf_counter() - begin)
    quantiles = _quantiles(table)
    write_json(config.out / "result.json", {
        "config": dataclasses.asdict(config),
        "lanes": sweep.samples.count,
        "statuses": counts,
        "computed_finer": int(np.sum(table.rung > 0)),
        "not_finite": missing,
        "bad_share": share,
        "succeeded": outcome.succeeded,
        "quantiles": quantiles,
        "units": table.units,
        "elapsed": outcome.elapsed,
    })  # fmt: skip
    drawn = table.plot() if config.plots else {}
    for name, figure in drawn.items():
        write_figure(config.out / f"{name}.png", figure)
    page.write(config, sweep, outcome, quantiles, tuple(drawn))
    if not outcome.succeeded:
        say(
            f"{100 * share:.1f} % of the lanes have no good numbers, more than the "
            f"{100 * config.tolerated:g} % of --tolerated"
        )
    say(f"wrote {config.out} ({time.perf_counter() - begin:.1f} s in all)")
    return outcome


def _quantiles(table: SweepTable) -> dict[str, dict[str, float]]:
    """Quantiles of the outputs over the good lanes that have them."""
    found = {}
    for name, column in table.outputs.items():
        values = column[table.good & np.isfinite(column)]
        if values.size:
            shares = (0.0, 0.05, 0.5, 0.95, 1.0)
            found[name] = {f"{s:g}": float(np.quantile(values, s)) for s in shares}
    return found


@contextlib.contextmanager
def _client(config: SweepConfig) -> Iterator[Any]:
    """A client of the Dask cluster in the configuration, `None` without one."""
    if not config.workers and config.scheduler == "none":
        yield None
        return
    distributed = sweep_library("distributed")
    # Its own log is replaced by one line here.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with contextlib.ExitStack() as stack:
        place: Any = config.scheduler
        if config.workers:
            place = stack.enter_context(_local_cluster(distributed, config.workers))
        try:
            client = distributed.Client(place, timeout=_PATIENCE)
        except (OSError, ValueError) as error:
            raise RuntimeError(
                f"Argument `scheduler` must be the address of a Dask scheduler, but {place} does "
                "not answer. Start it by `dask scheduler`, and write the address that it says."
            ) from error
        yield stack.enter_context(client)


def _local_cluster(distributed: Any, workers: int) -> Any:
    """Workers on this machine, which leave an interrupt to this process and end with it."""
    # Python's resource tracker: an interrupt ends this process before it has deregistered its
    # resources, and the tracker would warn of that. It unblocks the signals of the thread that
    # starts it.
    os.environ.setdefault("PYTHONWARNINGS", "ignore::UserWarning:multiprocessing.resource_tracker")
    blocks = hasattr(signal, "pthread_sigmask")
    if blocks:
        multiprocessing.resource_tracker.ensure_running()
        # Inherited by the cluster's thread and processes.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        # No spilling to disk: the memory limit is that of the machine.
        return distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, memory_limit=0, dashboard_address=None,
            silence_logs=logging.CRITICAL,
        )  # fmt: skip
    finally:
        if blocks:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def _tuned(config: SweepConfig) -> Outcome:
    """The job, with the compiler set for this machine."""
    devices = 1 if config.workers or config.scheduler != "none" else config.local_devices
    fj.tune_compiler(devices=devices if devices > 1 else None)
    return main(config)


def run():
    """The job from the command line."""
    command.run(
        "sweep",
        configure,
        _tuned,
        refused=(ValueError, TypeError, RuntimeError, ImportError),
        stopped=command.RESUMED,
        tune=False,
    )
