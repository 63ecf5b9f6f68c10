"""Settings of the whole test session, made before anything else is imported."""

import atexit
import gc
import os
import shutil
import signal
import sys
import tempfile
import threading
from pathlib import Path

# Programs here run once: the least of the compiler's effort does for them, without passes that only
# make programs faster or check what others made (some 10 % of the time to compile), without the
# notes on what may overlap in memory, which only later optimisations read, and as one piece each
# instead of up to 32 for as many cores (together 10 to 20 %). Not where speed is measured.
# `simplify-while-loops` stays: without it sums are rounded otherwise, by more than golden numbers
# allow for.
_LEFT_OUT = (
    "while-loop-invariant-code-motion", "reshape-mover", "tree_reduction_rewriter",
    "while-loop-constant-sinking", "while-loop-trip-count-annotator", "simplify-conditional",
    "dynamic-dimension-simplifier", "zero_sized_hlo_elimination", "hlo-verifier",
)
_LEAST = (
    "--xla_backend_optimization_level=0",
    f"--xla_disable_hlo_passes={','.join(_LEFT_OUT)}",
    "--xla_llvm_enable_alias_scope_metadata=false",
    "--xla_llvm_enable_noalias_metadata=false",
    "--xla_llvm_enable_invariant_load_metadata=false",
    "--xla_cpu_parallel_codegen_split_count=1",
)
if not any(argument.startswith("--bench") for argument in sys.argv):
    os.environ.setdefault("XLA_FLAGS", " ".join(_LEAST))

# A shell starts what runs in the background with interrupts ignored, and so would be the jobs that
# tests start and interrupt.
_IGNORED = signal.getsignal(signal.SIGINT) == signal.SIG_IGN
if _IGNORED and threading.current_thread() is threading.main_thread():
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Tracing makes millions of objects that stay: to look for garbage among them as often as usual
# takes a fifth of its time.
gc.set_threshold(200_000, 50, 100)

# What one process of a session has compiled serves the others, those of jobs that tests start too,
# and itself where it has dropped it; gone when the session ends. Left to itself, JAX keeps what
# takes a second and more: few programs here.
if "FENCEJAX_TEST_CACHE" not in os.environ:
    os.environ["FENCEJAX_TEST_CACHE"] = tempfile.mkdtemp(prefix="fencejax-")
    atexit.register(shutil.rmtree, os.environ["FENCEJAX_TEST_CACHE"], ignore_errors=True)
os.environ["JAX_COMPILATION_CACHE_DIR"] = os.environ["FENCEJAX_TEST_CACHE"]
os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0.1"
# Where in the source each operation of a program comes from is read by nobody here, and takes a
# tenth of the time to trace.
os.environ.setdefault("JAX_TRACEBACK_IN_LOCATIONS_LIMIT", "0")

import jax  # noqa: E402

import fencejax as fj  # noqa: E402
from fencejax._kept_programs import keep_programs  # noqa: E402

fj.tune_compiler()

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")

import pytest  # noqa: E402


def pytest_addoption(parser):
    parser.addoption(
        "--bench",
        metavar="DIR",
        default=None,
        help="run the tests marked `bench` and write their figures into DIR",
    )


def pytest_collection_modifyitems(config, items):
    if config.getoption("--bench") is not None:
        for item in items:
            item.add_marker(pytest.mark.timeout(0))
        return
    skip = pytest.mark.skip(reason="measures speed: give --bench DIR")
    for item in items:
        if "bench" in item.keywords:
            item.add_marker(skip)


# Linux allows a process so many mapped pieces of memory (vm.max_map_count); each compiled program
# has some thirty, and the compiler crashes where it gets no more.
_MAPPED = Path("/proc/self/maps")
_MANY = 65530 // 3


@pytest.fixture(autouse=True, scope="module")
def _few_programs_are_kept():
    """Compiled programs are dropped between files where there are too many."""
    yield
    if _MAPPED.exists() and _MAPPED.read_bytes().count(b"\n") > _MANY:
        jax.clear_caches()
        gc.collect()


@pytest.fixture(autouse=True, scope="module")
def _traced_programs_are_not_kept():
    """What a file has switched on, by running a job, say, holds for no other: some count what is
    traced."""
    yield
    keep_programs(None)


@pytest.fixture
def bench_directory(request):
    """The folder named by --bench, made where it is missing."""
    directory = Path(request.config.getoption("--bench"))
    directory.mkdir(parents=True, exist_ok=True)
    return directory


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config):
    """Speed is measured by one process alone."""
    return 0 if config.getoption("--bench") else None
