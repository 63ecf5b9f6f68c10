"""Sweeps on the disk: chunks that survive kills and full disks, folders that are not ours."""

import dataclasses
import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import tracemalloc

import diffrax
import numpy as np
import pytest
from study.small_sweep import CHUNKS, PLAIN, SMALL, assert_same, plain

import fencejax as fj
from fencejax.study import FILE, SceneFamily, Store, Sweep, SweepTable, lanes, run_sweep, sampling


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """The folder of a finished sweep, and its table."""
    folder = tmp_path_factory.mktemp("kept")
    return folder, run_sweep(plain(), folder, **PLAIN)


@pytest.fixture
def copied(kept, tmp_path):
    """A copy of that folder."""
    return shutil.copytree(kept[0], tmp_path / "copied")


def again(folder, sweep=None):
    """The sweep run again, and how many lanes it has computed."""
    reports = []
    table = run_sweep(sweep or plain(), folder, **PLAIN, progress=reports.append)
    return table, sum(1 for _ in reports)


# ---- kills and full disks

KILLED = """
import os, signal, sys
import jax
from zarr.storage import LocalStore
from study.small_sweep import PLAIN, plain
from fencejax.study import run_sweep

jax.config.update("jax_enable_x64", True)
put = LocalStore.set

async def interrupted(self, key, value, *rest):
    await put(self, key, value, *rest)
    # In the middle of the third chunk: its other columns, or its record, are not there.
    if key.endswith("c/2"):
        os.kill(os.getpid(), signal.SIGKILL)

LocalStore.set = interrupted
run_sweep(plain(), sys.argv[1], **PLAIN)
"""


def test_kill_loses_nothing_and_repeats_nothing(kept, tmp_path):
    killed = subprocess.run(
        [sys.executable, "-c", KILLED, str(tmp_path)], timeout=300, capture_output=True, text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    with pytest.raises(ValueError, match=r"1[1-3] of its 13 chunks are missing or damaged"):
        SweepTable.load(tmp_path)
    table, computed = again(tmp_path)
    assert_same(table, kept[1])
    # Several devices compute at a time: the two before it, or one of them, are kept.
    assert CHUNKS - 2 <= computed < CHUNKS
    assert again(tmp_path)[1] == 0
    assert_same(SweepTable.load(tmp_path), kept[1])


@pytest.mark.parametrize("writes", [0, 3, 12, 22, 33])
def test_full_disk_loses_nothing(kept, tmp_path, monkeypatch, writes):
    """The disk takes so many files: none, some of the metadata, one chunk and a half, more."""
    from zarr.storage import LocalStore

    put, taken = LocalStore.set, []

    async def full(self, key, value, *rest):
        taken.append(key)
        if len(taken) > writes:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        await put(self, key, value, *rest)

    with monkeypatch.context() as patch:
        patch.setattr(LocalStore, "set", full)
        with pytest.raises(OSError, match="No space left on device.*make room") as raised:
            run_sweep(plain(), tmp_path, **PLAIN)
    assert "\n" not in str(raised.value)
    assert not [name for name in os.listdir(tmp_path) if name != FILE]
    table, computed = again(tmp_path)
    assert_same(table, kept[1])
    assert_same(SweepTable.load(tmp_path), kept[1])
    assert (computed < CHUNKS) == (writes >= 22)


# ---- two at once


def test_two_different_sweeps_never_share_a_fresh_folder(tmp_path):
    """Eight claims by two threads at a time: one has the folder, the other is refused."""

    def claim(sweep, folder, start, outcome):
        samples = sweep.samples
        status = np.zeros(samples.count, np.int32)
        empty = lanes(
            dict(zip(samples.names, samples.values.T, strict=True)), {}, status, units=sweep.units,
            scalings={name: "linear" for name in samples.names}, outputs=(), gradient_of=None,
            shape=samples.shape, configuration=sweep.describe(),
        )  # fmt: skip
        start.wait()
        try:
            outcome.append(Store(folder / FILE, empty, 8))
        except ValueError as error:
            outcome.append(error)

    for trial in range(8):
        outcome, start, folder = [], threading.Barrier(2), tmp_path / str(trial)
        threads = [
            threading.Thread(target=claim, args=(sweep, folder, start, outcome))
            for sweep in (plain(), plain(11.0))
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        refused = [found for found in outcome if isinstance(found, ValueError)]
        assert len(outcome) == 2
        assert len(refused) == 1
        assert "holds another one: samples.variables[0].upper is" in str(refused[0])


def test_the_same_sweep_twice_at_once_does_no_harm(kept, tmp_path):
    found = []
    threads = [
        threading.Thread(target=lambda: found.append(run_sweep(plain(), tmp_path, **PLAIN)))
        for _ in range(2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for table in (*found, SweepTable.load(tmp_path)):
        assert_same(table, kept[1])
    assert len(found) == 2


# ---- damaged and foreign


def chunk_of(folder, name, number):
    """The file of a column's chunk."""
    (file,) = (folder / FILE / name / "c").glob(f"{number}*")
    return next(file.rglob("*")) if file.is_dir() else file


def truncate(folder):
    file = chunk_of(folder, "tip_deflection", 4)
    file.write_bytes(file.read_bytes()[:-9])


def empty(folder):
    chunk_of(folder, "record", 4).write_bytes(b"")


def lose(folder):
    chunk_of(folder, "peak_force", 4).unlink()


def foreign(folder):
    chunk_of(folder, "peak_force", 4).write_text("notes of mine")


def another_number(folder):
    """Chunk 5 in the place of chunk 4, record and all."""
    for name in ("peak_force", "tip_deflection", "record"):
        shutil.copy(chunk_of(folder, name, 5), chunk_of(folder, name, 4))


def another_job(folder):
    """Chunk 4 of another sweep, record and all."""
    other = folder.parent / "other"
    run_sweep(plain(11.0), other, **PLAIN)
    for name in ("peak_force", "tip_deflection", "record"):
        shutil.copy(chunk_of(other, name, 4), chunk_of(folder, name, 4))


@pytest.mark.parametrize(
    "damage", [truncate, empty, lose, foreign, another_number, another_job],
    ids=lambda damage: damage.__name__,
)  # fmt: skip
def test_a_damaged_chunk_alone_is_computed_anew(kept, copied, damage):
    damage(copied)
    with pytest.raises(ValueError, match="1 of its 13 chunks are missing or damaged. Run the same"):
        SweepTable.load(copied)
    table, computed = again(copied)
    assert computed == 1
    assert_same(table, kept[1])
    assert_same(SweepTable.load(copied), kept[1])


def other_points(folder):
    (folder / FILE / "mass" / "c" / "0").unlink()


def no_metadata(folder):
    (folder / FILE / "zarr.json").unlink()


def half_the_metadata(folder):
    file = folder / FILE / "zarr.json"
    file.write_bytes(file.read_bytes()[:200])


def half_of_a_column(folder):
    file = folder / FILE / "status" / "zarr.json"
    file.write_bytes(file.read_bytes()[:99])


def other_attributes(folder):
    file = folder / FILE / "zarr.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"attributes": {}}))


def a_file(folder):
    shutil.rmtree(folder / FILE)
    (folder / FILE).write_text("")


def folder_a_file(folder):
    shutil.rmtree(folder)
    folder.write_text("")


@pytest.mark.parametrize(
    "damage",
    [no_metadata, half_the_metadata, half_of_a_column, other_attributes, a_file, folder_a_file],
    ids=lambda damage: damage.__name__,
)
def test_what_is_no_sweep_is_refused_in_one_line(copied, damage):
    damage(copied)
    for read in (lambda: again(copied), lambda: SweepTable.load(copied)):
        with pytest.raises((ValueError, OSError), match="[Cc]hoose another folder") as raised:
            read()
        assert "\n" not in str(raised.value)


def test_points_that_are_not_those_of_the_configuration_are_refused(copied):
    other_points(copied)
    with pytest.raises(ValueError, match="its points are not those of its configuration"):
        SweepTable.load(copied)


def test_other_configuration_in_the_folder_is_refused(copied):
    text = "holds another one: samples.variables.0..upper is 10.0 there and 11.0 here.*Choose anoth"
    with pytest.raises(ValueError, match=text):
        run_sweep(plain(11.0), copied, **PLAIN)
    with pytest.raises(ValueError, match="chunk is 8 there and 4 here"):
        run_sweep(plain(), copied, chunk=4, group=4)


def test_every_part_counts_in_the_configuration():
    def hashed(**settings):
        samples = sampling.grid(["mass"], 2)
        names = settings.pop("names", samples.names)
        family = SceneFamily("oblique_impact", names, **settings)
        return json.dumps(Sweep(family, samples).describe(), sort_keys=True)

    same = hashed()
    assert same == hashed()
    variants = [
        {"fence": fj.Fence(thickness=0.05)}, {"fence": fj.Fence(taper=fj.Uniform())},
        {"drive": fj.HarmonicDrive(top_speed=1.6)}, {"parcel": fj.Parcel(damping=1e5)},
        {"belt": fj.Belt(speed=1.0)}, {"belt": None}, {"fence_friction": None},
        {"duration": 0.2}, {"fixed": {"distance": 0.9}}, {"options": {"corner": 4}},
    ]  # fmt: skip
    assert len({same, *(hashed(**variant) for variant in variants)}) == 1 + len(variants)
    small = SMALL.sweep()
    fidelities = [
        small.fidelity, fj.Fidelity.standard(), fj.Fidelity.fast(integrator=diffrax.Kvaerno3()),
        fj.Fidelity.fast(integrator=diffrax.Kvaerno5()),
    ]  # fmt: skip
    described = [dataclasses.replace(small, fidelity=f).describe() for f in fidelities]
    assert len({json.dumps(one, sort_keys=True) for one in described}) == len(fidelities)


# ---- what the store is to others


def test_store_opens_with_xarray(kept):
    import xarray

    folder, table = kept
    data = xarray.open_zarr(folder / FILE, consolidated=False)
    assert data.peak_force.attrs["units"] == "N"
    assert data.mass.attrs["units"] == "kg"
    assert data.status.dtype == np.int32
    np.testing.assert_array_equal(data.status, table.status)
    np.testing.assert_array_equal(data.peak_force, table.outputs["peak_force"])
    meanings = dict(zip(data.status.flag_values, data.status.flag_meanings.split(), strict=True))
    assert meanings[-1] == "IMPOSSIBLE"
    assert meanings[0] == "SUCCESSFUL"
    assert json.loads(data.attrs["configuration"])["scene"] == "oblique_impact"
    # Job and number of each chunk.
    record = data.record.to_numpy()
    assert {bytes(row[:32]).hex() for row in record} == {data.attrs["job"]}
    assert [int.from_bytes(bytes(row[32:40])) for row in record] == list(range(CHUNKS))


@pytest.mark.parametrize("name", ["xarray", "zarr", "dask.array"])
def test_without_the_extra_the_remedy_is_named(tmp_path, monkeypatch, name):
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ImportError, match=r"pip install -e '.\[sweep\]'; a sweep by jax.vmap"):
        run_sweep(plain(), tmp_path, **PLAIN)


# ---- memory


def test_a_sweep_of_any_length_asks_for_the_memory_of_its_table(tmp_path, monkeypatch):
    """Between 32,768 and 131,072 lanes: two numbers, two results and two marks each, 40 bytes, and
    of every chunk, 4,096 lanes, its record of 72 bytes. Nothing else is kept of a chunk."""

    def compiled(lane, plan, devices):
        def run(points):
            marks = np.zeros((2, len(points)), np.int32)
            results = dict(zip(("peak_force", "impulse"), points.T, strict=True))
            return {**results, "status": marks[0], "rung": marks[1]}

        return [run for _ in devices]

    monkeypatch.setattr(sys.modules["fencejax.study.sweep_run"], "compile_chunks", compiled)
    peaks = []
    # The first of them imports and makes what lasts.
    for count in (2**12, 2**15, 2**17):
        samples = sampling.sobol(["mass", "distance"], count)
        sweep = Sweep(
            SceneFamily("oblique_impact", samples.names), samples, ("peak_force", "impulse")
        )
        tracemalloc.start()
        table = run_sweep(sweep, tmp_path / str(count))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert len(table.dataset["peak_force"]) == count
    each = (peaks[2] - peaks[1]) / (2**17 - 2**15)
    # A tenth for what Python and Zarr note of a chunk; of the smaller one they may have noted more,
    # by some tens of kB: a byte of 98,304.
    assert 39 < each < 44
