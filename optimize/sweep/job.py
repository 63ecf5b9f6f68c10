"""Sweeps: scenes over a grid, a Latin hypercube or a Sobol sequence of any of their numbers.

    python -m optimize.sweep --out out --vary mass=1:30:64 distance=0.5:1.1:64

computes the points chunk by chunk on every core (or GPU) of the machine, says how far it is, and
keeps every finished chunk: the same command goes on after a kill. It counts the statuses and
writes sweep.npz (variables, outputs, units, statuses: `numpy.load`, or
`fencejax.SweepTable.load(path).to_xarray()`), result.json and figures.

Several processes do the same sweep together, in one folder that all of them see. On a cluster:

    #!/bin/bash
    #SBATCH --nodes=4 --ntasks-per-node=1 --cpus-per-task=64 --time=2:00:00 --requeue
    #SBATCH --open-mode=append
    cd $SLURM_SUBMIT_DIR
    source .venv/bin/activate
    export JAX_PLATFORMS=cpu        # leave it out where the nodes have GPUs
    srun python -m optimize.sweep --cluster --out $SCRATCH/sweep \\
        --scene whole_sort --sampling sobol --count 1048576 \\
        --vary mass offset angle belt_speed thickness
    # Killed or requeued, the job goes on where it was: submit it again.

Where a process dies, JAX ends the others within two minutes; what they had done is kept.
Without Slurm or MPI, start on every machine k = 0 ... 3 (process 0 on HOST):
`python -m optimize.sweep --coordinator HOST:1234 --processes 4 --process k --out /shared/sweep ...`
"""

import dataclasses
import time

import jax
import numpy as np

import fencejax as fj
from fencejax.study import Progress, SweepTable, run_sweep

from ..common import command
from ..common.report import write_json
from . import figures
from .configuration import SweepConfig, configure


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What the job found: the table, at process 0, whether few enough lanes are bad, and the time
    it took [s]."""

    table: SweepTable | None
    succeeded: bool
    elapsed: float


class _Reporter:
    """Says how far the sweep is, at most once in `every` seconds."""

    def __init__(self, say, every: float = 1.0):
        self._say, self._every, self._last = say, every, -np.inf

    def __call__(self, now: Progress) -> None:
        if now.awaited:
            self._say(f"  share done, {now.awaited} chunks of other processes to come")
            return
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
    """Run the job, or what is missing of it, and write its files into `config.out`."""
    jax.config.update("jax_enable_x64", True)
    begin = time.perf_counter()
    config = SweepConfig() if config is None else config
    say = (lambda *parts: None) if quiet else (lambda *parts: print(*parts, flush=True))
    sweep = config.sweep()
    devices, processes = jax.local_devices(), jax.process_count()
    place = f", process {jax.process_index()} of {processes}" if processes > 1 else ""
    say(
        f"{sweep.samples.count} lanes of {config.scene} over {', '.join(sweep.samples.names)}, "
        f"{len(devices)} {devices[0].platform} device{'s' if len(devices) > 1 else ''}{place}; "
        "compiling ..."
    )
    table = run_sweep(
        sweep,
        config.out,
        chunk=config.chunk or None,
        group=config.group or None,
        progress=_Reporter(say),
    )
    if table is None:
        return Outcome(None, True, time.perf_counter() - begin)
    counts, missing = table.counts(), table.missing()
    say("statuses: " + ", ".join(f"{name} {number}" for name, number in counts.items()))
    for name, number in missing.items():
        say(f"  {name}: not a number in {number} lanes whose status is good")
    share = 1 - float(np.mean(table.good))
    if config.plots:
        figures.save(figures.draw(table), config.out)
    outcome = Outcome(table, share <= config.tolerated, time.perf_counter() - begin)
    write_json(config.out / "result.json", {
        "config": dataclasses.asdict(config),
        "lanes": sweep.samples.count,
        "statuses": counts,
        "not_finite": missing,
        "bad_share": share,
        "succeeded": outcome.succeeded,
        "quantiles": _quantiles(table),
        "units": table.units,
        "elapsed": outcome.elapsed,
    })  # fmt: skip
    if not outcome.succeeded:
        say(
            f"{100 * share:.1f} % of the lanes have no good numbers, more than the "
            f"{100 * config.tolerated:g} % of --tolerated"
        )
    say(f"wrote {config.out} ({outcome.elapsed:.1f} s in all)")
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


def _joined(config: SweepConfig) -> Outcome:
    join(config)
    return main(config)


def join(config: SweepConfig) -> None:
    """Set the compiler for this machine and, for several processes, meet the others."""
    devices = config.local_devices
    fj.tune_compiler(devices=devices if devices > 1 else None)
    if config.cluster:
        jax.distributed.initialize()
    elif config.processes > 1:
        jax.distributed.initialize(config.coordinator, config.processes, config.process)


def run():
    """The job from the command line."""
    command.run(
        "sweep",
        configure,
        _joined,
        refused=(ValueError, TypeError, RuntimeError),
        stopped="stopped; the same command goes on from here",
        tune=False,
    )
