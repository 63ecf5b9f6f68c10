"""Traced programs kept in a folder: the same numbers in another process, nothing traced, and never
those of other source."""

import functools
import gc
import importlib
import os
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import jax
import pytest

import fencejax as fj
from fencejax import (
    _identity as identity,
    _kept_executables as kept_executables,
    _kept_programs as kept_programs,
)
from fencejax.derivatives import by_columns

PACKAGE = Path(fj.__file__).parent
# Value, derivative, and a batch of derivatives, of a scene in one coordinate; then a drive law that
# is known by no name.
SCRIPT = """
import sys
import jax, jax.numpy as jnp, numpy as np
jax.config.update("jax_enable_x64", True)
import fencejax as fj
fj.tune_compiler()
if sys.argv[1:]:
    fj.cache_programs(sys.argv[1])

def peak(speed):
    scene = fj.scenes.rigid_wall(speed=speed, duration=0.03)
    return fj.simulate(scene, fidelity=fj.Fidelity.fast(), only="peak_force").peak_force

traced = []
run = sys.modules["fencejax.simulate"]._run
sys.modules["fencejax.simulate"]._run = lambda *given: (traced.append(1), run(*given))[1]
result = fj.simulate(fj.scenes.rigid_wall(duration=0.03), fidelity=fj.Fidelity.fast())
found = [result.peak_force, result.energy.residual, *result.history.time[-2:]]
found += [jax.grad(peak)(1.3), jax.jit(peak)(1.3)]
found += list(jax.jit(jax.vmap(jax.grad(peak)))(jnp.array([1.0, 1.3])))
print(len(traced), result.status, *(float(x).hex() for x in found))
"""


def run(*arguments, package=PACKAGE):
    """How often something was traced, and the numbers."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, *map(str, arguments)], capture_output=True, text=True,
        env=os.environ | {"PYTHONPATH": str(package.parent)}, cwd=package.parent,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    count, *numbers = done.stdout.split()
    return int(count), numbers


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("programs")


@pytest.fixture(scope="module")
def first(folder):
    return run(folder)


def test_another_process_traces_nothing_and_finds_the_same(folder, first):
    assert first[0] == 3
    assert run(folder) == (0, first[1])
    # The result, the value, the derivative and that of two lanes; the result compiled, too.
    kinds = [file.suffix for file in (folder / "traced").iterdir()]
    assert sorted(kinds) == [".executable", *4 * [".program"]]
    # As one that is not kept.
    scene = fj.scenes.rigid_wall(duration=0.03)
    result = fj.simulate(scene, fidelity=fj.Fidelity.fast())
    expected = [result.peak_force, result.energy.residual, *result.history.time[-2:]]
    found = [float.fromhex(x) for x in first[1][1:5]]
    assert found == pytest.approx([float(x) for x in expected], rel=1e-12, abs=1e-9)


def test_other_source_finds_nothing(folder, first, tmp_path):
    copy = tmp_path / "fencejax"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    with (copy / "model" / "friction.py").open("a") as file:
        file.write("\n# Another line.\n")
    assert run(folder, package=copy)[0] == 3


# --- In this process -------------------------------------------------------------------------


@pytest.fixture
def store(tmp_path, monkeypatch):
    monkeypatch.setattr(kept_programs, "_store", None)
    kept_programs.keep_programs(tmp_path)
    return tmp_path


def call(what, argument=1.0, function=jax.numpy.sin):
    return kept_programs.kept(lambda x: {"result": function(x), "none": None}, what)(argument)


def test_programs_differ_by_name_type_and_settings(store):
    call("a")
    assert len(list(store.iterdir())) == 1
    call("a")
    assert len(list(store.iterdir())) == 1
    others = [("b", 1.0), ("a", 1), ("a", jax.numpy.ones(3)), (("a", None), 1.0)]
    others += [(("a", fj.Fidelity()), 1.0), (("a", fj.Fidelity(modes=3)), 1.0)]
    for count, (what, argument) in enumerate(others, 2):
        assert call(what, argument)["none"] is None
        assert len(list(store.iterdir())) == count
    with jax.default_matmul_precision("highest"):
        call("a")
    assert len(list(store.iterdir())) == count + 1


class Swing(fj.HarmonicDrive):
    """Of another module than the package's."""


@pytest.mark.parametrize("what", [Swing(), print, jax.numpy.ones(2)])
def test_what_is_not_known_by_its_fields_is_not_kept(store, what):
    assert float(call(what)["result"]) == pytest.approx(0.8414709848)
    assert list(store.iterdir()) == []


def test_source_that_changed_after_the_start_is_not_kept(store, monkeypatch):
    monkeypatch.setattr(identity, "STARTED", 0.0)
    for known in (identity.source, kept_programs._source):
        known.cache_clear()
    call("a")
    for known in (identity.source, kept_programs._source):
        known.cache_clear()
    assert list(store.iterdir()) == []


def test_a_file_that_is_not_whole_is_made_anew(store):
    call("a")
    (file,) = store.iterdir()
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2])
    assert float(call("a")["result"]) == pytest.approx(0.8414709848)
    assert len(file.read_bytes()) == len(content)


def test_without_what_jax_has_for_itself_nothing_is_kept(tmp_path, monkeypatch):
    """Of a version of JAX that has these functions no longer, or by another name."""
    from fencejax import _xla

    assert _xla._private("config", "no_such_function") is None
    assert _xla._private("no_such_module", "trace_context") is None
    store = kept_programs.Store(tmp_path)
    assert store.place(("what",), jax.tree.structure(0), []) is not None
    monkeypatch.setattr(_xla, "_trace_context", None)
    assert store.place(("what",), jax.tree.structure(0), []) is None
    assert not _xla.nothing_is_traced()
    monkeypatch.setattr(_xla, "_backends_are_initialized", None)
    monkeypatch.setenv("XLA_FLAGS", "")
    fj.tune_compiler()
    assert "small_while_loop" in os.environ["XLA_FLAGS"]


def test_the_folder_has_a_bound(store, monkeypatch):
    call("first")
    (first,) = store.iterdir()
    os.utime(first, (0, 0))
    call("second")
    size = sum(file.stat().st_size for file in store.iterdir())
    monkeypatch.setattr(kept_programs, "_BOUND", size)
    call("third")
    # The one used longest ago has made room.
    assert len(list(store.iterdir())) == 2
    assert not first.exists()


def test_a_folder_that_cannot_be_written_is_done_without(tmp_path, monkeypatch):
    file = tmp_path / "file"
    file.touch()
    monkeypatch.setattr(kept_programs, "_store", None)
    kept_programs.keep_programs(file / "inner")
    assert float(call("a")["result"]) == pytest.approx(0.8414709848)


def test_second_derivatives_and_lanes_of_lanes_are_kept(store):
    def cube(x):
        return {"y": x**3}

    def slope(x):
        return jax.grad(lambda x: by_columns(cube, what=("cube",))(x)["y"])(x)

    assert float(jax.grad(slope)(2.0)) == 12.0
    many = jax.vmap(jax.vmap(slope))(jax.numpy.array([[1.0, 2.0], [3.0, 4.0]]))
    assert many.tolist() == [[3.0, 12.0], [27.0, 48.0]]
    count = len(list(store.iterdir()))
    # Slope, curvature, and the slope of lanes and of lanes of lanes, which is made by way of it.
    assert count == 4
    assert float(jax.grad(slope)(2.0)) == 12.0
    assert len(list(store.iterdir())) == count


# --- Executables -----------------------------------------------------------------------------


def executable(what="a", options=None, traced=None):
    """A map of two numbers to a tree, kept compiled; `traced` counts how often it is traced."""

    def function(numbers):
        if traced is not None:
            traced.append(1)
        return {"sum": jax.numpy.sin(numbers[0]) + numbers[1], "none": None}

    return kept_executables.compiled(function, options, what)


NUMBERS = [jax.numpy.float64(1.0), jax.numpy.float64(2.0)]
SUM = 2.8414709848


def test_an_executable_is_found_again(store):
    traced = []
    for _ in range(2):
        # Another one each time, as in another process.
        found = executable(traced=traced)
        for _ in range(2):
            assert float(found(NUMBERS)["sum"]) == pytest.approx(SUM)
            assert found(NUMBERS)["none"] is None
        assert len(traced) == 1
    (file,) = store.iterdir()
    assert file.suffix == ".executable"


def test_executables_differ_by_name_type_options_and_settings(store):
    executable()(NUMBERS)
    executable("b")(NUMBERS)
    executable(options={"xla_backend_optimization_level": 0})(NUMBERS)
    executable()([jax.numpy.ones(2), *NUMBERS[1:]])
    assert len(list(store.iterdir())) == 4
    run = executable()
    with jax.default_matmul_precision("highest"):
        run(NUMBERS)
    run(NUMBERS)
    assert len(list(store.iterdir())) == 5


@pytest.mark.parametrize("spoilt", ["cut", "nonsense", "written again"])
def test_an_executable_that_does_not_run_is_compiled_anew(store, spoilt):
    executable()(NUMBERS)
    (file,) = store.iterdir()
    content = file.read_bytes()
    if spoilt == "cut":
        file.write_bytes(content[: len(content) // 2])
    else:
        keeper = kept_programs.keeping()
        if spoilt == "nonsense":
            keeper.write(file, keeper.read(file)[0], b"2\nnonsense")
        else:
            # JAX writes what it has read itself without its kernels.
            read = kept_executables._load(keeper, file)
            kept_executables._save(keeper, file, read, len(NUMBERS))
    assert float(executable()(NUMBERS)["sum"]) == pytest.approx(SUM)
    traced = []
    assert float(executable(traced=traced)(NUMBERS)["sum"]) == pytest.approx(SUM)
    assert not traced


def test_an_executable_is_whole_where_jax_has_the_program_in_its_cache(store):
    # Known to JAX in this process and in its folder alike.
    jax.jit(lambda numbers: jax.numpy.sin(numbers[0]) + numbers[1])(NUMBERS)
    executable()(NUMBERS)
    traced = []
    assert float(executable(traced=traced)(NUMBERS)["sum"]) == pytest.approx(SUM)
    assert not traced
    assert jax.config.jax_enable_compilation_cache


def test_two_that_compile_at_once_leave_the_cache_on(store, monkeypatch):
    """The second begins, where it can, while the first compiles, and ends after it."""
    begun, ended = threading.Event(), threading.Event()

    def slow(*parts):
        if threading.current_thread().name == "first":
            begun.wait(1)
        else:
            begun.set()
            ended.wait(10)
        return kept_programs.Program(*parts)

    def first():
        executable("first")(NUMBERS)
        ended.set()

    monkeypatch.setattr(kept_executables, "Program", slow)
    threads = [
        threading.Thread(target=first, name="first"),
        threading.Thread(target=lambda: executable("second")(NUMBERS)),
    ]
    try:
        for thread in threads:
            thread.start()
            time.sleep(0.3)
        for thread in threads:
            thread.join()
        assert jax.config.jax_enable_compilation_cache
    finally:
        jax.config.update("jax_enable_compilation_cache", True)
    assert len(list(store.iterdir())) == 2


def test_executables_are_for_numbers_alone_that_nothing_is_done_to(store):
    run = executable()
    assert float(run([1.0, 2.0])["sum"]) == pytest.approx(SUM)
    assert float(jax.jit(lambda: run(NUMBERS)["sum"])()) == pytest.approx(SUM)
    with jax.disable_jit():
        assert float(run(NUMBERS)["sum"]) == pytest.approx(SUM)
    assert list(store.iterdir()) == []
    executable(Swing())(NUMBERS)
    assert list(store.iterdir()) == []


def test_a_first_scene_compiles_nothing():
    """Nor do an import of the package and the making of a scene import what they do not need."""
    script = """
import sys
import jax
compiled = []
jax.monitoring.register_event_duration_secs_listener(
    lambda event, _, **__: compiled.append(event) if "backend_compile" in event else None
)
import fencejax as fj
fj.scenes.oblique_impact()
rooms = [f"fencejax.{room}" for room in ("design", "plot", "sorter", "study")]
print(len(compiled), *(name for name in [*rooms, "optax", "scipy"] if name in sys.modules))
"""
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["0"]


# --- In memory


def test_programs_that_are_kept_no_longer_leave_the_memory(monkeypatch):
    """Of four simulations the last one is kept: no more executables live after the fourth than
    after the second."""
    module = sys.modules["fencejax.simulate"]
    few = functools.lru_cache(maxsize=1)(module._program.__wrapped__)
    monkeypatch.setattr(module, "_program", few)
    scene, client, alive = fj.scenes.rigid_wall(duration=0.01), jax.devices()[0].client, []
    for k in range(4):
        fidelity = fj.Fidelity.standard().replace(step=2.5e-4 * (1 - 1e-3 * k), step_tolerance=None)
        fj.simulate(scene, fidelity=fidelity, history=False, only="peak_force")
        gc.collect()
        alive.append(len(client.live_executables()))
    assert alive[-1] == alive[1]


def test_every_kind_of_program_is_kept_in_a_bounded_number():
    """A whole sort's takes some 100 MB, with its gradient."""
    kept = ("simulate", "_program"), ("study.batch", "_program"), ("study.response", "_programs"), \
        ("study.sweep_program", "_compiled"), ("study.fit_signals", "program_of"), \
        ("study.fit_signals", "curvature_of")  # fmt: skip
    for place, name in kept:
        module = importlib.import_module(f"fencejax.{place}")
        assert getattr(module, name).cache_parameters()["maxsize"] <= 32
