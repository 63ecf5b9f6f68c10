"""Sweeps: points, scenes by name, chunks that survive kills, several processes, one table."""

import dataclasses
import json
import os
import signal
import socket
import subprocess
import sys

import jax
import numpy as np
import pytest

import fencejax as fj
from fencejax import sampling, scene_family
from fencejax.scene_family import SceneFamily
from fencejax.store import Store
from fencejax.sweep import Sweep
from fencejax.sweep_run import FILE, Plan, run_sweep
from fencejax.sweep_table import IMPOSSIBLE, SweepTable
from optimize.sweep import main
from optimize.sweeping import figures
from optimize.sweeping.configuration import SweepConfig, configure

# One small program serves most tests: 60 impacts in chunks of 16 lanes, two groups each. The
# fence's reach of 1 m is less than the farthest place of touch.
SMALL = SweepConfig(
    vary=("mass=1:20:5", "reach=1:1.3:3:linear", "distance=0.6:1.2:4"),
    duration=0.05,
    fidelity="fast",
    chunk=16,
    group=8,
    tolerated=0.3,
    plots=False,
)
CHUNKS = 4


def small(out, **changes):
    return dataclasses.replace(SMALL, out=out, **changes)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The small sweep, computed at one go by this process."""
    return main(small(tmp_path_factory.mktemp("whole")), quiet=True).table


def assert_same(one, other):
    """Tables equal bit by bit."""
    for column in ("variables", "outputs", "gradient"):
        a, b = getattr(one, column), getattr(other, column)
        assert list(a) == list(b)
        for name in a:
            np.testing.assert_array_equal(a[name], b[name], err_msg=name)
    np.testing.assert_array_equal(one.status, other.status)
    assert one.units == other.units
    assert one.shape == other.shape


# ---- points


def test_grid_runs_through_all_combinations():
    mass = sampling.variable("mass", 1.0, 100.0)
    found = sampling.grid([mass, sampling.variable("distance", 0.5, 1.0)], (3, 2))
    assert found.shape == (3, 2)
    expected = [[1, 0.5], [1, 1], [10, 0.5], [10, 1], [100, 0.5], [100, 1]]
    np.testing.assert_allclose(found.values, expected, rtol=1e-14)
    # Bounds are met exactly: what lies beyond them may be no scene.
    assert found.values[:, 0].max() <= 100.0
    assert found.values[:, 0].min() == 1.0


@pytest.mark.parametrize("lay", [sampling.latin_hypercube, sampling.sobol])
def test_each_slice_of_each_variable_holds_one_point(lay):
    count = 32
    found = lay(["mass", "distance", "thickness"], count, seed=5)
    assert found.values.shape == (count, 3)
    for variable, column in zip(found.variables, found.values.T, strict=True):
        if variable.scaling == "linear":
            share = (column - variable.lower) / (variable.upper - variable.lower)
        else:
            share = np.log(column / variable.lower) / np.log(variable.upper / variable.lower)
        assert sorted(np.floor(share * count).astype(int)) == list(range(count))
    again = lay(["mass", "distance", "thickness"], count, seed=5)
    np.testing.assert_array_equal(again.values, found.values)
    other = lay(["mass", "distance", "thickness"], count, seed=6)
    assert np.all(other.values != found.values)


def test_sobol_fills_the_square_evenly():
    # Scrambling keeps a (t, m, 2)-net: of 64 points, each 8 x 8 box holds one (t = 0 in 2-D).
    found = sampling.sobol([sampling.variable("distance", 0, 1), sampling.variable("turn", 0, 1)],
                           64, seed=1)  # fmt: skip
    boxes = np.floor(8 * found.values).astype(int)
    assert len({tuple(box) for box in boxes}) == 64


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: sampling.sobol(["mass"], 1000), "power of two.*Write 512 or 1024"),
        (lambda: sampling.grid(["mass", "mass"], 3), "must not repeat a name"),
        (lambda: sampling.grid(["mass"], 1), "`counts` must be at least 2.*`fixed`"),
        (lambda: sampling.grid(["mass"], (3, 3)), r"a number for each of \['mass'\].*holds 2"),
        (lambda: sampling.grid([], 3), "at least one name"),
        (lambda: sampling.variable("hue"), "`hue` must be given bounds"),
        (lambda: sampling.variable("mass", 0.0, 1.0), "`mass.lower` must be.* above 0"),
        (lambda: sampling.variable("mass", 2.0, 1.0), "`mass.lower` must be below"),
        (lambda: sampling.latin_hypercube(["mass"], 0), "`count` must be at least 1"),
        (lambda: sampling.given({"mass": [1.0, np.nan]}), "must be finite"),
        (lambda: sampling.given({"mass": [1.0, 1.0]}), "must vary"),
        (lambda: sampling.given({"mass": [1.0], "angle": [0, 1]}), "columns of one length"),
    ],
)
def test_bad_points_are_refused(make, text):
    with pytest.raises(ValueError, match=text):
        make()


# ---- scenes by name


def changed(kind, name, drive=None):
    """Leaves of a scene that change with a named number, by their place in it."""
    family = SceneFamily(kind, [name], drive=drive, duration=0.1)
    known = scene_family.VARIABLES[name.partition("[")[0]]
    middle = 0.5 * (known.lower + known.upper)
    scenes = [family.scene([value]) for value in (middle, 0.9 * middle + 0.1 * known.upper)]
    old, new = (jax.tree_util.tree_flatten_with_path(scene)[0] for scene in scenes)
    pairs = zip(old, new, strict=True)
    return {jax.tree_util.keystr(p) for (p, a), (_, b) in pairs if not np.array_equal(a, b)}


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("thickness", {".fence.thickness"}),
        ("reach", {".fence.rigid_length", ".fence.flexible_length"}),
        ("youngs_modulus", {".fence.material.youngs_modulus"}),
        ("top_speed", {".drive.top_speed"}),
        ("mass", {".parcel.mass"}),
        ("stiffness", {".parcel.stiffness"}),
        ("belt_speed", {".belt.speed"}),
        ("gravity", {".belt.gravity"}),
        ("belt_static_friction", {".belt.friction.static"}),
        ("fence_kinetic_friction", {".fence_friction.kinetic"}),
        ("border_static_friction", {".border.friction.static"}),
        ("offset", {".start.offset"}),
        ("angle", {".start.angle"}),
    ],
)
def test_name_changes_its_number_alone(name, expected):
    assert changed("whole_sort", name) == expected


def test_every_name_of_every_kind_changes_something():
    for kind, own in scene_family.KINDS.items():
        names = SceneFamily(kind, []).known
        assert set(own) <= set(names)
        for name in names:
            assert changed(kind, name), (kind, name)


def test_element_of_a_free_form_drive():
    drive = fj.SplineDrive([0.2, 0.5, 0.2])
    assert changed("whole_sort", "control_angles[1]", drive) == {".drive.control_angles"}
    family = SceneFamily("whole_sort", ["control_angles[1]"], drive=drive, duration=1.36)
    found = family.scene([0.4]).drive
    assert isinstance(found, fj.SplineDrive)
    np.testing.assert_array_equal(found.control_angles, [0.2, 0.4, 0.2])


def test_fixed_numbers_and_parts_are_kept():
    family = SceneFamily(
        "oblique_impact",
        ["distance"],
        fixed={"mass": 3.0, "length_ratio": 0.0},
        fence=fj.Fence(width=0.2),
        options={"corner": 2},
        duration=0.2,
    )
    direct = fj.scenes.oblique_impact(
        fence=fj.Fence(rigid_length=0.0, flexible_length=1.2, width=0.2),
        parcel=fj.Parcel(mass=3.0), distance=0.9, corner=2, duration=0.2,
    )  # fmt: skip
    found = family.scene([0.9])
    assert jax.tree.structure(found) == jax.tree.structure(direct)
    pairs = zip(jax.tree.leaves(found), jax.tree.leaves(direct), strict=True)
    for a, b in pairs:
        np.testing.assert_allclose(a, b, rtol=1e-15)


@pytest.mark.parametrize(
    ("arguments", "settings", "text"),
    [
        (("free_fall", ["mass"]), {}, "`kind` must be one of"),
        (("oblique_impact", ["offset"]), {}, "`names` must name numbers of .*holds 'offset'"),
        (("oblique_impact", ["border_static_friction"]), {}, "holds 'border_static_friction'"),
        (("oblique_impact", ["belt_speed"]), {"belt": None}, "holds 'belt_speed'"),
        (("oblique_impact", ["mass"]), {"fixed": {"mass": 2.0}}, "must not repeat a name"),
        (("oblique_impact", ["mass"]), {"options": {"angle": 2.0}}, "`options` must be one of"),
        (("whole_sort", ["cycle_time"]), {}, "`duration` .* must be given where .*cycle_time"),
    ],
)
def test_bad_names_are_refused(arguments, settings, text):
    with pytest.raises(ValueError, match=text):
        SceneFamily(*arguments, **settings)


@pytest.mark.parametrize(
    ("kind", "name", "bounds", "text"),
    [
        ("oblique_impact", "mass", (-1.0, 2.0), "`mass` must be above 0"),
        ("oblique_impact", "distance", (0.5, 1.3), "`distance` must be at most 1.2"),
        ("oblique_impact", "drive_angle", (0.1, 0.7), "The drive turns back there"),
        ("oblique_impact", "center_x", (-0.3, 0.3), "lies inside the rectangle"),
        ("whole_sort", "offset", (-0.1, 0.3), "`offset` must be at least 0"),
        ("whole_sort", "top_speed", (-2.0, 2.0), "`top_speed` must be at least 0"),
    ],
)
def test_bound_without_a_scene_is_refused(kind, name, bounds, text):
    samples = sampling.grid([sampling.variable(name, *bounds, scaling="linear")], 3)
    with pytest.raises(ValueError, match=f"`{name}` must be within the scene.*{text}"):
        Sweep(SceneFamily(kind, samples.names, duration=0.25), samples)


def test_possible_agrees_with_the_checks_of_the_scene():
    drive = fj.SCurveDrive()
    names = ["reach", "distance", "drive_angle", "acceleration", "center_y"]
    family = SceneFamily("border_and_fence", names, drive=drive)
    # Each row but the first breaks one bound.
    rows = np.array([
        [1.2, 1.0, 0.10, 8.0, 0.0],
        [0.9, 1.0, 0.10, 8.0, 0.0],
        [1.2, 1.0, 0.70, 8.0, 0.0],
        [1.2, 1.0, 0.60, 8.0, 0.0],
        [1.2, 1.0, 0.10, 20.0, 0.0],
        [1.2, 1.0, 0.10, 8.0, 0.2],
    ])  # fmt: skip
    possible = jax.jit(jax.vmap(lambda row: family.possible(family.scene(row))))(rows)
    allowed = []
    for row in rows:
        try:
            scene = family.scene(row)
            fj.SCurveDrive(**{f.name: getattr(scene.drive, f.name)
                              for f in dataclasses.fields(drive)})  # fmt: skip
            allowed.append(True)
        except ValueError:
            allowed.append(False)
    assert allowed == [True, False, False, False, False, False]
    np.testing.assert_array_equal(possible, allowed)


# ---- what is computed


def test_outputs_are_those_of_simulate(whole):
    lane = 3 * 12 + 2 * 4 + 1
    numbers = {name: column[lane] for name, column in whole.variables.items()}
    scene = fj.scenes.oblique_impact(
        fence=fj.Fence(
            rigid_length=numbers["reach"] * 0.375, flexible_length=numbers["reach"] * 0.625
        ),
        parcel=fj.Parcel(mass=numbers["mass"]), distance=numbers["distance"], duration=0.05,
    )  # fmt: skip
    only = ("peak_force", "tip_deflection")
    result = fj.simulate(scene, fidelity=fj.Fidelity.fast(), only=only)
    for name in only:
        # Lanes of a group wait for each other's last Newton iteration: the tolerance is theirs.
        np.testing.assert_allclose(whole.outputs[name][lane], getattr(result, name), rtol=1e-5)
    assert whole.status[lane] == result.status


def test_impossible_lanes_are_counted_and_not_numbers(whole):
    beyond = whole.variables["distance"] > whole.variables["reach"]
    assert 0 < np.sum(beyond) < beyond.size
    np.testing.assert_array_equal(whole.status == IMPOSSIBLE, beyond)
    np.testing.assert_array_equal(np.isnan(whole.outputs["peak_force"]), beyond)
    assert whole.counts()["IMPOSSIBLE"] == np.sum(beyond)
    assert sum(whole.counts().values()) == beyond.size
    # The others are good or say why not: the lightest parcels part within a few of these steps.
    rough = whole.status == fj.Status.STEP_TOO_COARSE
    np.testing.assert_array_equal(whole.good, ~beyond & ~rough)
    assert np.sum(rough) < 0.1 * rough.size


def test_chunks_and_padding_do_not_change_results(whole, tmp_path):
    # 60 lanes: 4 chunks of 16 with 4 lanes of padding, or 3 of 24 with 12; the groups stay.
    other = run_sweep(SMALL.sweep(), tmp_path, chunk=24, group=8)
    assert_same(other, whole)


def test_lanes_without_good_numbers_are_counted(tmp_path):
    mass, place = np.tile([5.0, 1e12], 8), np.repeat([0.6, 0.8], 8)
    samples = sampling.given({
        "mass": mass, "reach": np.repeat([1.1, 1.2], 8), "distance": place,
    })  # fmt: skip
    sweep = dataclasses.replace(SMALL.sweep(), samples=samples)
    said = []
    table = run_sweep(sweep, tmp_path, chunk=16, group=8, progress=said.append)
    assert table is not None
    assert np.all(table.status[mass < 10] <= fj.Status.LEFT_OVER_TIP)
    assert np.all(table.status[mass > 10] > fj.Status.LEFT_OVER_TIP)
    assert said[-1].bad == 8
    # Sound lanes are not touched by their neighbours: each place has its one force.
    force = table.outputs["peak_force"]
    for here in (0.6, 0.8):
        np.testing.assert_allclose(force[(mass < 10) & (place == here)], force[place == here][0])
    assert np.all(force[mass < 10] > 100)


def test_gradient_is_that_of_the_outputs(tmp_path):
    # A point and its neighbours: central differences, error of second order in the step and
    # Newton's tolerance 1e-6 over it.
    base, step = np.array([8.0, 0.8]), 3e-3
    rows = [base]
    for index in range(2):
        for sign in (1, -1):
            row = base.copy()
            row[index] *= 1 + sign * step
            rows.append(row)
    mass, distance = np.array(rows).T
    samples = sampling.given({"mass": mass, "distance": distance})
    family = SceneFamily("oblique_impact", samples.names, duration=0.05)
    # The smallest program there is with a fence that bends.
    fidelity = fj.Fidelity.fast(modes=1, static_correction=False, geometry="small", elements=4)
    sweep = Sweep(family, samples, ("peak_force",), "peak_force", fidelity)
    table = run_sweep(sweep, tmp_path)
    assert table is not None
    force = table.outputs["peak_force"]
    for index, name in enumerate(samples.names):
        up, down = force[1 + 2 * index], force[2 + 2 * index]
        slope = (up - down) / (2 * step * base[index])
        np.testing.assert_allclose(table.gradient[name][0], slope, rtol=1e-2)


# ---- chunks on the disk

KILLED = """
import os, signal, sys
from pathlib import Path
import fencejax.store
from optimize.sweep import main
from optimize.sweeping.configuration import SweepConfig

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


# ---- plans


def test_plan_covers_all_lanes_whatever_the_machine():
    for count in (1, 5, 63, 64, 65, 1000, 20000, 10**6):
        for platform in ("cpu", "gpu"):
            plan = Plan.of(count, None, None, platform)
            assert plan.chunk % plan.group == 0
            assert plan.chunk * plan.chunks >= count > plan.chunk * (plan.chunks - 1)
    assert Plan.of(10**6, None, None, "cpu") == Plan(1024, 64, 977)
    with pytest.raises(ValueError, match="`chunk` must be a multiple of `group` = 8.*Write 24"):
        Plan.of(100, 20, 8, "cpu")
    with pytest.raises(ValueError, match="`share` must be"):
        run_sweep(SMALL.sweep(), "nowhere", share=(2, 2))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"outputs": ("hue",)}, "`outputs` must be one of"),
        ({"outputs": ()}, "`outputs` must name at least one"),
        ({"gradient_of": "impulse"}, "`gradient_of` must be one of"),
        ({"samples": sampling.grid(["mass"], 2)}, "`family` must have the names of the samples"),
    ],
)
def test_bad_sweeps_are_refused(changes, text):
    with pytest.raises(ValueError, match=text):
        dataclasses.replace(SMALL.sweep(), **changes)


# ---- the table


def table_of(shape, kind, gradient=True):
    count = int(np.prod(shape))
    rng = np.random.default_rng(3)
    variables = {"mass": 1 + rng.random(count), "distance": 0.5 + rng.random(count)}
    if kind == "grid":
        mesh = np.meshgrid(np.linspace(1, 2, shape[0]), np.linspace(0.5, 1, shape[1]),
                           indexing="ij")  # fmt: skip
        variables = dict(zip(variables, (m.ravel() for m in mesh), strict=True))
    force = 100 * variables["mass"] * variables["distance"] ** 2
    status = np.zeros(count, np.int32)
    status[1], status[3] = IMPOSSIBLE, fj.Status.NEVER_TOUCHED
    leave = np.where(status == 3, np.nan, 1.0)
    leave[[1, 3, 4]] = np.nan
    return SweepTable(
        variables, {"peak_force": force, "leave_x": leave}, status, "peak_force",
        {"mass": force / variables["mass"], "distance": 2 * force / variables["distance"]},
        {"mass": "kg", "distance": "m", "peak_force": "N", "leave_x": "m"},
        shape, {"mass": "logarithmic", "distance": "linear"}, {"samples": {"kind": kind}},
    )  # fmt: skip


def test_missing_numbers_are_counted_in_good_lanes():
    # Lane 1 is no scene; 3 never touched and 4 have no place where the parcel leaves.
    assert table_of((4, 3), "grid").missing() == {"leave_x": 2}


def test_file_opens_with_numpy(tmp_path):
    table = table_of((4, 3), "grid")
    table.save(tmp_path / "t.npz")
    with np.load(tmp_path / "t.npz", allow_pickle=False) as data:
        np.testing.assert_array_equal(data["mass"], table.variables["mass"])
        np.testing.assert_array_equal(data["peak_force"], table.outputs["peak_force"])
        np.testing.assert_array_equal(data["gradient"][:, 1], table.gradient["distance"])
        names = [*data["variables"], *data["outputs"]]
        assert dict(zip(names, data["units"], strict=True)) == table.units
        meaning = dict(zip(data["status_codes"], data["status_names"], strict=True))
        assert [meaning[s] for s in data["status"][:4]] == [
            "SUCCESSFUL", "IMPOSSIBLE", "SUCCESSFUL", "NEVER_TOUCHED",
        ]  # fmt: skip
    read = SweepTable.load(tmp_path / "t.npz")
    assert_same(read, table)
    np.testing.assert_array_equal(read.axes["distance"], [0.5, 0.75, 1.0])
    assert read.grid("peak_force").shape == (4, 3)
    with pytest.raises(ValueError, match="Only a grid has axes"):
        _ = table_of((12,), "sobol").axes


def test_dataset_is_labelled():
    pytest.importorskip("xarray")
    table = table_of((4, 3), "grid")
    data = table.to_xarray()
    assert dict(data.sizes) == {"mass": 4, "distance": 3}
    assert data.peak_force.attrs["units"] == "N"
    assert data.mass.attrs["units"] == "kg"
    assert data.d_peak_force_d_mass.attrs["units"] == "(N) / (kg)"
    at = data.peak_force.sel(mass=2.0, distance=0.75)
    assert float(at) == pytest.approx(100 * 2 * 0.75**2)
    assert data.status.attrs["flag_meanings"].split()[0] == "IMPOSSIBLE"
    loose = table_of((12,), "sobol").to_xarray()
    assert dict(loose.sizes) == {"lane": 12}
    np.testing.assert_array_equal(loose.mass, table_of((12,), "sobol").variables["mass"])


def test_dataset_without_xarray_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ImportError, match=r"fencejax\[xarray\]"):
        table_of((4, 3), "grid").to_xarray()


# ---- the script


def test_figures_fit_the_points():
    drawn = figures.draw(table_of((4, 3), "grid"))
    assert set(drawn) == {"peak_force", "leave_x", "elasticities"}
    axes, bar = drawn["peak_force"].axes[:2]
    assert axes.get_xlabel() == "distance [m]"
    assert axes.get_ylabel() == "mass [kg]"
    assert axes.get_yscale() == "log"
    assert bar.get_ylabel() == "peak force [N]"
    # The lane without a scene is left blank, the others hold their values.
    shown = axes.collections[0].get_array()
    assert shown is not None
    assert int(np.ma.count_masked(shown)) == 1
    loose = figures.draw(table_of((64,), "sobol"))["peak_force"]
    panels = [panel for panel in loose.axes if panel.get_visible()]
    assert [panel.get_xlabel() for panel in panels] == ["mass [kg]", "distance [m]"]
    assert panels[0].get_ylabel() == "peak force [N]"


def test_script_writes_its_files_and_says_whether_it_succeeded(whole, tmp_path, capsys):
    outcome = main(small(tmp_path, plots=True))
    assert_same(outcome.table, whole)
    said = capsys.readouterr().out
    assert "60 of 60 lanes" in said
    assert "IMPOSSIBLE 10" in said
    content = json.loads((tmp_path / "result.json").read_text())
    assert content["statuses"] == whole.counts()
    assert (tmp_path / "peak_force.png").stat().st_size > 1000
    assert outcome.succeeded
    strict = main(small(tmp_path, tolerated=0.01))
    assert not strict.succeeded
    assert "more than the 1 % of --tolerated" in capsys.readouterr().out


def test_flags():
    assert configure([]) == SweepConfig()
    config = configure([
        "--vary", "mass", "thickness=0.02:0.06:7:linear", "--fixed", "distance=0.9",
        "--gradient", "impulse",
    ])  # fmt: skip
    samples = config.samples()
    assert samples.names == ("mass", "thickness")
    assert samples.shape == (48, 7)
    assert samples.variables[1].scaling == "linear"
    sweep = config.sweep()
    assert sweep.family.fixed == {"distance": 0.9}
    assert sweep.outputs == ("peak_force", "tip_deflection", "impulse")
    assert configure(["--quick"]).fidelity == "fast"


def test_help_names_every_default(capsys):
    with pytest.raises(SystemExit) as leaving:
        configure(["--help"])
    assert leaving.value.code == 0
    assert capsys.readouterr().out.count("(default:") == len(vars(SweepConfig())) + 1


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"vary": ("mass=1",)}, "`vary` must read name"),
        ({"vary": ("mass=a:b",)}, "`vary` must read name"),
        ({"vary": ("mass=1:2:3",), "sampling": "sobol"}, "must not give points a variable"),
        ({"fixed": ("distance",)}, "`fixed` must read name=value"),
        ({"processes": 2}, "`coordinator` must be given"),
        ({"processes": 2, "process": 2}, "`process` must be below"),
        ({"scene": "free_fall"}, "`scene` must be one of"),
        ({"tolerated": 2.0}, "`tolerated` must be within"),
        ({"points": 1}, "`points` must be at least 2"),
    ],
)
def test_bad_flags_are_refused(changes, text):
    with pytest.raises(ValueError, match=text):
        SweepConfig(**changes).sweep()
