"""Sweeps on a Dask cluster: the same numbers, whichever process is killed."""

import contextlib
import os
import signal
import subprocess
import sys

import distributed
import jax
import pytest
from study.small_sweep import CHUNKS, PLAIN, assert_same, plain, tiny

from fencejax.study import SweepTable, WorkerSettings, run_sweep
from optimize.sweep import main
from optimize.sweep.configuration import SweepConfig

# Timeout for steps that take seconds on an idle machine [s].
PATIENCE = 120


def started(*command, output=subprocess.DEVNULL):
    # The output of a scheduler and its workers is not read: a full pipe would block them.
    # The flags of XLA that this process has, tests' own modules, one cache for compiled programs.
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(sys.path),
        "JAX_COMPILATION_CACHE_DIR": os.environ["FENCEJAX_TEST_CACHE"],
        "JAX_NUMPY_DTYPE_PROMOTION": "strict",
    }
    return subprocess.Popen(
        [sys.executable, *command], env=environment, stdout=output, stderr=subprocess.STDOUT,
        text=True,
    )  # fmt: skip


class Dask:
    """A scheduler and its workers, each a process."""

    def __init__(self, folder):
        self._file = str(folder / "scheduler.json")
        self.scheduler = started(
            "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0",
            "--no-dashboard", "--scheduler-file", self._file,
        )  # fmt: skip
        self.workers = []

    def work(self):
        """One worker more, which nobody starts again."""
        self.workers.append(started(
            "-m", "distributed.cli.dask_worker", "--scheduler-file", self._file, "--nthreads", "1",
            "--no-nanny", "--no-dashboard",
        ))  # fmt: skip

    @contextlib.contextmanager
    def client(self, workers):
        client = distributed.Client(scheduler_file=self._file, timeout=PATIENCE)
        try:
            client.wait_for_workers(workers, timeout=PATIENCE)
            yield client
        finally:
            client.close(timeout=2)

    def end(self):
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.communicate()


@pytest.fixture(scope="module")
def dask(tmp_path_factory):
    cluster = Dask(tmp_path_factory.mktemp("dask"))
    cluster.work()
    cluster.work()
    yield cluster
    cluster.end()


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The plain sweep, by this process."""
    return run_sweep(plain(), tmp_path_factory.mktemp("alone"), **PLAIN)


def test_simulations_are_the_same_bit_by_bit(dask, tmp_path):
    here = run_sweep(tiny(), tmp_path / "here", **PLAIN)
    with dask.client(2) as client:
        there = run_sweep(tiny(), tmp_path / "there", **PLAIN, client=client)
    assert_same(there, here)
    assert_same(SweepTable.load(tmp_path / "there"), here)


CLIENT = """
import sys
import distributed, jax
import fencejax as fj
from study.small_sweep import PLAIN, plain
from fencejax.study import run_sweep

jax.config.update("jax_enable_x64", True)
with distributed.Client(sys.argv[2]) as client:
    report = lambda now: print(now.done, flush=True)
    run_sweep(plain(), sys.argv[1], **PLAIN, client=client, progress=report)
"""


def test_the_client_is_killed(dask, alone, tmp_path):
    with dask.client(2) as client:
        address = client.scheduler.address
        killed = started("-c", CLIENT, str(tmp_path), address, output=subprocess.PIPE)
        assert killed.stdout is not None
        line = killed.stdout.readline()
        killed.send_signal(signal.SIGKILL)
        rest, _ = killed.communicate(timeout=PATIENCE)
        assert line.strip() == "8", line + rest
        reports = []
        table = run_sweep(plain(), tmp_path, **PLAIN, client=client, progress=reports.append)
    assert_same(table, alone)
    assert reports[0].before >= 8


def test_a_worker_is_killed(dask, alone, tmp_path):
    dask.work()
    with dask.client(3) as client:

        def progress(now):
            if now.done == 8:
                dask.workers[-1].kill()

        table = run_sweep(plain(), tmp_path, **PLAIN, client=client, progress=progress)
    assert_same(table, alone)
    assert_same(SweepTable.load(tmp_path), alone)


def test_the_scheduler_is_killed(alone, tmp_path):
    cluster, reports = Dask(tmp_path), []
    try:
        cluster.work()
        with cluster.client(1) as client:

            def progress(now):
                reports.append(now)
                cluster.scheduler.kill()

            with pytest.raises(RuntimeError, match="scheduler of the Dask cluster is gone. What"):
                run_sweep(plain(), tmp_path / "sweep", **PLAIN, client=client, progress=progress)
    finally:
        cluster.end()
    assert 0 < len(reports) < CHUNKS
    left = []
    table = run_sweep(plain(), tmp_path / "sweep", **PLAIN, progress=left.append)
    assert len(left) == CHUNKS - len(reports)
    assert_same(table, alone)


def test_workers_are_set_as_the_process_that_asks():
    mine = WorkerSettings.here()
    mine.adopt()
    assert mine.double
    assert "xla_force_host_platform_device_count" not in mine.flags
    (name, version), *rest = mine.versions
    assert name == "fencejax"
    other = mine._replace(versions=((name, "9.9"), *rest))
    with pytest.raises(RuntimeError, match=f"fencejax {version} here and 9.9 there. Install the"):
        other.adopt()
    jax.numpy.zeros(1)
    with pytest.raises(RuntimeError, match=r"other settings of XLA. Restart the workers"):
        mine._replace(flags="--xla_of_another=kind").adopt()


def test_nobody_answers(tmp_path, monkeypatch):
    monkeypatch.setattr("optimize.sweep.job._PATIENCE", 0.2)
    config = SweepConfig(out=tmp_path, scheduler="tcp://127.0.0.1:1", points=2)
    with pytest.raises(RuntimeError, match="127.0.0.1:1 does not answer. Start it by `dask sche"):
        main(config, quiet=True)
