"""Sweeps on the disk: chunks that survive kills, folders, several processes."""

import dataclasses
import json
import os
import signal
import socket
import subprocess
import sys

import numpy as np
import pytest
from study.small_sweep import CHUNKS, SMALL, assert_same, small

import fencejax as fj
from fencejax.study import FILE, SceneFamily, Store, Sweep, SweepTable, run_sweep, sampling
from optimize.sweep import main
from optimize.sweep.configuration import SweepConfig


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The small sweep, computed at one go by this process."""
    return main(small(tmp_path_factory.mktemp("whole")), quiet=True).table


# ---- chunks on the disk

KILLED = """
import os, signal, sys
from pathlib import Path
import fencejax.study
from optimize.sweep import main
from optimize.sweep.configuration import SweepConfig

plain = os.fsync

def fsync(file):
    # In the middle of writing the third chunk, the manifest having been the first file.
    fsync.count += 1
    if fsync.count == 4:
        os.kill(os.getpid(), {signal})
    plain(file)

fsync.count = 0
os.fsync = fsync
main(SweepConfig(**eval(sys.argv[1])))
"""


def child(code, *arguments, **extra):
    environment = dict(os.environ, JAX_COMPILATION_CACHE_DIR=os.environ["FENCEJAX_TEST_CACHE"])
    return subprocess.Popen(
        [sys.executable, *code, *arguments], env=environment | extra,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip


def plain_settings(config):
    changes = {k: v for k, v in vars(config).items() if v != getattr(SweepConfig(), k)}
    return repr({k: str(v) if k == "out" else v for k, v in changes.items()}).replace(
        repr(str(config.out)), f"Path({str(config.out)!r})"
    )


def test_kill_loses_nothing_and_repeats_nothing(whole, tmp_path):
    config = small(tmp_path)
    killed = child(["-c", KILLED.replace("{signal}", str(int(signal.SIGKILL)))],
                   plain_settings(config))  # fmt: skip
    said, _ = killed.communicate(timeout=300)
    assert killed.returncode == -signal.SIGKILL, said
    chunks = tmp_path / "chunks"
    kept = {file.name: file.stat().st_mtime_ns for file in chunks.glob("[0-9]*.npz")}
    assert len(kept) == 2
    assert len(list(chunks.glob(".*.part"))) == 1
    assert not (tmp_path / FILE).exists()
    reports = []
    table = run_sweep(config.sweep(), tmp_path, chunk=16, group=8, progress=reports.append)
    assert_same(table, whole)
    # Only the two missing chunks were computed, and the two there were left alone.
    assert len(reports) == CHUNKS - 2
    assert all(report.before == 32 for report in reports)
    assert reports[-1].done == reports[-1].total == 60
    for name, time in kept.items():
        assert (chunks / name).stat().st_mtime_ns == time
    assert not list(chunks.glob(".*.part"))


def test_finished_sweep_is_read_and_not_computed(whole, tmp_path):
    whole_again = run_sweep(SMALL.sweep(), tmp_path, chunk=16, group=8)
    for file in (tmp_path / "chunks").iterdir():
        file.unlink()
    reports = []
    table = run_sweep(SMALL.sweep(), tmp_path, chunk=16, group=8, progress=reports.append)
    assert not reports
    assert_same(table, whole_again)
    assert_same(table, whole)


def test_other_configuration_in_the_folder_is_refused(tmp_path):
    Store(tmp_path, SMALL.sweep().describe() | {"chunk": 16, "group": 8})
    other = dataclasses.replace(SMALL, duration=0.06).sweep()
    text = "holds another one: duration is 0.05 there and 0.06 here. Choose another folder"
    with pytest.raises(ValueError, match=text):
        run_sweep(other, tmp_path, chunk=16, group=8)
    with pytest.raises(ValueError, match="chunk is 16 there and 8 here"):
        run_sweep(SMALL.sweep(), tmp_path, chunk=8, group=8)
    moved = dataclasses.replace(SMALL, vary=("mass=1:21:5", *SMALL.vary[1:])).sweep()
    with pytest.raises(ValueError, match=r"variables\[0\].upper is 20.0 there and 21.0 here"):
        run_sweep(moved, tmp_path, chunk=16, group=8)


def test_every_part_counts_in_the_configuration():
    def hashed(**settings):
        samples = sampling.grid(["mass"], 2)
        names = settings.pop("names", samples.names)
        family = SceneFamily("oblique_impact", names, **settings)
        return json.dumps(Sweep(family, samples).describe(), sort_keys=True)

    plain = hashed()
    assert plain == hashed()
    variants = [
        {"fence": fj.Fence(thickness=0.05)}, {"fence": fj.Fence(taper=fj.Uniform())},
        {"drive": fj.HarmonicDrive(top_speed=1.6)}, {"parcel": fj.Parcel(damping=1e5)},
        {"belt": fj.Belt(speed=1.0)}, {"belt": None}, {"fence_friction": None},
        {"duration": 0.2}, {"fixed": {"distance": 0.9}}, {"options": {"corner": 4}},
    ]  # fmt: skip
    assert len({plain, *(hashed(**variant) for variant in variants)}) == 1 + len(variants)


def test_damaged_files_are_named(tmp_path):
    store = Store(tmp_path, {"a": 1})
    store.write(0, {"x": np.arange(3)})
    np.testing.assert_array_equal(store.read(0)["x"], [0, 1, 2])
    whole_file = store.path(0).read_bytes()
    store.path(0).write_bytes(whole_file[:-30])
    with pytest.raises(ValueError, match="cannot be read .*Delete it and run"):
        store.read(0)
    (tmp_path / "manifest.json").write_text("{")
    with pytest.raises(ValueError, match="manifest of a sweep.*Choose another folder"):
        Store(tmp_path, {"a": 1})
    (tmp_path / FILE).write_bytes(b"none")
    with pytest.raises(ValueError, match="written by SweepTable.save"):
        SweepTable.load(tmp_path / FILE)


def test_two_processes_do_not_share_a_share(tmp_path):
    first, second = Store(tmp_path, {"a": 1}), Store(tmp_path, {"a": 1})
    first.lock(0)
    with pytest.raises(RuntimeError, match="another process computes share 0"):
        second.lock(0)
    second.lock(1)
    first.release()
    third = Store(tmp_path, {"a": 1})
    third.lock(0)
    third.release()
    second.release()


# ---- several processes


def test_shares_meet_in_one_folder(whole, tmp_path):
    def share(index):
        reports = []
        table = run_sweep(
            SMALL.sweep(), tmp_path, chunk=16, group=8, share=(index, 3), wait=False,
            progress=reports.append,
        )  # fmt: skip
        return table, reports[-1].total

    found = [share(index) for index in (1, 2, 0)]
    assert [table for table, _ in found[:2]] == [None, None]
    assert [lanes for _, lanes in found] == [16, 16, 16 + 12]
    assert_same(found[-1][0], whole)


def test_two_processes_equal_one(whole, tmp_path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    flags = [
        "--out", str(tmp_path), "--vary", *SMALL.vary, "--duration", "0.05", "--fidelity", "fast",
        "--chunk", "16", "--group", "8", "--no-plots", "--tolerated", "0.3",
        "--coordinator", f"127.0.0.1:{port}", "--processes", "2",
    ]  # fmt: skip
    # The second has two devices: how many there are changes nothing either.
    both = [
        child(["-m", "optimize.sweep"], *flags, "--process", str(index),
              "--devices", str(1 + index), JAX_PLATFORMS="cpu")
        for index in (0, 1)
    ]  # fmt: skip
    said = [process.communicate(timeout=300)[0] for process in both]
    assert [process.returncode for process in both] == [0, 0], "\n".join(said)
    assert "1 cpu device, process 0 of 2" in said[0]
    assert "2 cpu devices, process 1 of 2" in said[1]
    # Each had its share: lanes 0-15 and 32-47, 16-31 and 48-59.
    assert "32 of 32 lanes" in said[0]
    assert "28 of 28 lanes" in said[1]
    assert "IMPOSSIBLE 10" in said[0]
    assert_same(SweepTable.load(tmp_path / FILE), whole)
