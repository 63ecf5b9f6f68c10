"""The compiler's settings, and that importing the package starts nothing."""

import gc
import os
import subprocess
import sys
from pathlib import Path

import pytest

import fencejax as fj

QUIET = """
import fencejax, optimize
from jax._src.xla_bridge import backends_are_initialized
import os, sys
assert not backends_are_initialized()
# What takes long to import waits until it is needed.
assert not {"diffrax", "scipy", "matplotlib", "pint", "jinja2", "ezdxf"} & set(sys.modules)
assert os.environ.get("XLA_FLAGS") == given
"""

TUNED = """
import os
import jax
import fencejax as fj
fj.tune_compiler(devices=2)
once = os.environ["XLA_FLAGS"]
fj.tune_compiler(devices=2)
assert os.environ["XLA_FLAGS"] == once
assert len(jax.devices("cpu")) == 2
program = jax.jit(lambda x: jax.lax.fori_loop(0, 9, lambda i, y: y[::-1] + x, x))
text = program.lower(jax.numpy.zeros(1000)).compile().as_text()
# The whole loop is one call of one kernel: more than the thousand bytes that XLA would allow.
assert "xla_cpu_small_call" in text
try:
    fj.tune_compiler(devices=3)
except RuntimeError as error:
    assert "before any array is made" in str(error)
else:
    raise AssertionError("JAX has read its flags: it was too late")
print(once)
"""


def run(code, flags=None):
    environment = {k: v for k, v in os.environ.items() if k != "XLA_FLAGS"}
    if flags is not None:
        environment["XLA_FLAGS"] = flags
    return subprocess.run(
        [sys.executable, "-c", f"given = {flags!r}\n{code}"],
        env=environment, capture_output=True, text=True,
    )


def test_import_starts_nothing():
    done = run(QUIET)
    assert done.returncode == 0, done.stderr


def test_loops_become_one_kernel():
    done = run(TUNED)
    assert done.returncode == 0, done.stderr


def test_what_is_set_already_stays():
    extra = "--xla_backend_extra_options="
    given = f"{extra}xla_cpu_small_while_loop_byte_threshold=77 --xla_cpu_enable_fast_math=false"
    code = "import fencejax as fj, os; fj.tune_compiler(); print(os.environ['XLA_FLAGS'])"
    done = run(code, given)
    assert done.returncode == 0, done.stderr
    assert "threshold=77," in done.stdout
    assert done.stdout.count(extra) == 1
    assert "--xla_cpu_enable_fast_math=false" in done.stdout


UNTUNED = """
import jax
jax.config.update("jax_enable_x64", True)
import fencejax as fj
if given:
    fj.tune_compiler()
fidelity = fj.Fidelity.fast(modes=1, geometry="small")
def peak(thickness):
    scene = fj.scenes.normal_impact(fence=fj.Fence(thickness=thickness), duration=0.05)
    return fj.simulate(scene, fidelity=fidelity, only=["peak_force"]).peak_force
print(*jax.jit(jax.value_and_grad(peak))(0.045))
"""


def test_settings_change_results_by_rounding_only():
    # Newton's method leaves 5e-7 of the force, which may fall either way.
    one, other = (run(UNTUNED, flags) for flags in (None, "--xla_cpu_enable_fast_math=false"))
    assert one.returncode == other.returncode == 0, one.stderr + other.stderr
    numbers = [[float(x) for x in done.stdout.split()] for done in (one, other)]
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-6)


def test_devices_are_counted():
    with pytest.raises(ValueError, match=r"`devices` must be at least 1 \[1\], but is 0"):
        fj.tune_compiler(devices=0)


CACHED = """
import os, sys
sys.path.insert(0, {path!r})
import fencejax as fj
fj.tune_compiler()
import jax
jax.jit(lambda x: x + 1)(1.0)
print(fj.cache_programs({folder}))
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
jax.jit(lambda x: jax.numpy.sin(x) + 1)(1.0)
"""


def cached(tmp_path, folder="", **environment):
    """The folder that a process says it keeps its programs in, and how many are there."""
    code = CACHED.format(path=str(Path(fj.__file__).parents[1]), folder=folder)
    usual = {"XDG_CACHE_HOME": str(tmp_path), "HOME": str(tmp_path), "LOCALAPPDATA": str(tmp_path)}
    outside = {k: v for k, v in os.environ.items() if not k.startswith("JAX_")}
    done = subprocess.run(
        [sys.executable, "-c", code], env=outside | usual | environment, capture_output=True,
        text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    shown = done.stdout.strip()
    return shown, 0 if shown == "None" else len(list(Path(shown).iterdir()))


def test_programs_are_kept_in_the_users_folder_or_in_one_that_is_given(tmp_path):
    # Also where something has compiled before.
    shown, count = cached(tmp_path)
    assert Path(shown).is_relative_to(tmp_path)
    assert Path(shown).parent.name == "fencejax"
    assert count
    own = tmp_path / "own"
    assert cached(tmp_path, repr(str(own)))[0] == str(own)
    # JAX's own setting of the folder takes precedence, and so does its switch.
    configured = tmp_path / "told"
    shown, count = cached(tmp_path, JAX_COMPILATION_CACHE_DIR=str(configured))
    assert (shown, count > 0) == (str(configured), True)
    assert cached(tmp_path, JAX_ENABLE_COMPILATION_CACHE="false")[0] == "None"
    # A folder that cannot be made: the user's own is ignored, a given one raises an error.
    file = tmp_path / "file"
    file.touch()
    assert cached(tmp_path, XDG_CACHE_HOME=str(file), HOME=str(file))[0] == "None"
    with pytest.raises(OSError, match="file"):
        fj.cache_programs(file / "inner")


def test_the_package_says_what_it_is_and_what_to_run_next(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "fencejax"], capture_output=True, text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"fencejax {fj.__version__}\n")
    for text in ("devices", "cpu", os.environ["FENCEJAX_TEST_CACHE"], "optimize.design --help"):
        assert text in done.stdout


def test_the_collector_comes_back():
    from fencejax._xla import many_objects

    @many_objects()
    def fails():
        assert not gc.isenabled()
        raise KeyError

    with pytest.raises(KeyError):
        fails()
    assert gc.isenabled()
    gc.disable()
    try:
        with many_objects():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()
