"""Settings of XLA for loops over a few small arrays, a barrier to fusion, and the settings of JAX
that decide what is traced."""

import contextlib
import functools
import gc
import importlib
import os
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import jaxlib.version
from equinox.internal import unvmap_any
from jax.extend.core import jaxpr_as_fun
from jaxtyping import Array


def _private(module: str, name: str) -> Callable[..., Any] | None:
    """A private function of JAX; `None` where this version has none of that name."""
    try:
        return getattr(importlib.import_module(f"jax._src.{module}"), name, None)
    except ImportError:
        return None


# There is no public name for these. Without them programs are not kept between processes, and there
# is no error where XLA's settings come too late.
_trace_context = _private("config", "trace_context")
_trace_state_clean = _private("core", "trace_state_clean")
_backends_are_initialized = _private("xla_bridge", "backends_are_initialized")

_LARGE = 10**9
_DEVICES = "--xla_force_host_platform_device_count="

# XLA ignores settings that a backend does not know.
_EXTRA = {
    # A loop becomes one kernel if it moves fewer bytes than this, instead of one a fusion.
    "xla_cpu_small_while_loop_byte_threshold": str(_LARGE),
    # Results that share their arithmetic are computed together.
    "xla_cpu_use_multi_output_fusion": "true",
    # Loops over a few numbers, such as the columns of a derivative, are short as they are.
    "xla_cpu_disable_loop_unrolling": "true",
}
# LLVM's own. They switch off two searches whose time grows with the square of a loop's length:
# - An order of instructions before registers are given out. Another pass orders them again, and
#   programs run as fast without the first.
# - Whether the table of a kernel's buffers is a copy of a constant, which it never is. LLVM would
#   go through everything that reads the table, again after each reader that it removes.
_LLVM = {"-pre-RA-sched": "fast", "-instcombine-max-copied-from-constant-users": "0"}
# An unknown flag of this kind, or of LLVM, stops the process: given only to versions that are known
# to have it.
_FLAGS = {
    "xla_cpu_use_fusion_emitters": "false",
    # These and the simplifications around them undo each other's work, round after round, each
    # through the whole program. What does not change within a loop is moved out of it by LLVM too,
    # where the loop is one kernel. `hlo-verifier` changes no program: it checks XLA's own passes.
    "xla_disable_hlo_passes": "reshape-mover,while-loop-invariant-code-motion,hlo-verifier",
}
_KNOWN = (0, 7, 0), (0, 11, 0)


def shares_arithmetic() -> bool:
    """Whether XLA computes common parts of several results once: on a CPU only if it is set to."""
    requested = "xla_cpu_use_multi_output_fusion=true" in os.environ.get("XLA_FLAGS", "")
    return requested or jax.default_backend() != "cpu"


def _flags_known() -> bool:
    """Whether this version of XLA is known to have `_LLVM` and `_FLAGS`."""
    return _KNOWN[0] <= jaxlib.version.__version_info__ < _KNOWN[1]


def _has_computed() -> bool:
    """Whether JAX has computed in this process, as far as that can be known."""
    return _backends_are_initialized is not None and _backends_are_initialized()


def tune_compiler(devices: int | None = None) -> None:
    """Set XLA's compiler for the CPU to make one kernel of each loop and to compile sooner.

    Left to itself, XLA runs every piece of a step as a kernel of its own, and most of the time
    goes into starting them: one impact then takes some eight times as long. The settings go into
    the environment variable `XLA_FLAGS`, which is read when JAX computes for the first time in a
    process; what is set there already stays. They change results by rounding only, and hold for
    everything that the process compiles for a CPU.

    **Arguments:**

    - `devices`: number of devices that JAX shall see on this CPU, for sweeps that use all of its
      cores (`jax.sharding`, `jax.pmap`). Each loop then runs on one core.

    Raises `ValueError` if `devices` is not at least 1 and `RuntimeError` if JAX has computed
    already, so that the settings would be ignored.

    >>> fj.tune_compiler()
    """
    if devices is not None and devices < 1:
        raise ValueError(f"Argument `devices` must be at least 1 [1], but is {devices}.")
    given = os.environ.get("XLA_FLAGS", "")
    flags = given.split()
    known = _EXTRA | (_LLVM if _flags_known() else {})
    extra = [f"{key}={value}" for key, value in known.items() if key not in given]
    if extra:
        # XLA takes the last of several lists: one list, with what was given in it.
        lead = "--xla_backend_extra_options="
        listed = [flag.removeprefix(lead) for flag in flags if flag.startswith(lead)]
        flags = [flag for flag in flags if not flag.startswith(lead)]
        flags.append(lead + ",".join([*listed, *extra]))
    if _flags_known():
        flags += [f"--{key}={value}" for key, value in _FLAGS.items() if key not in given]
    if devices is not None:
        others = [flag for flag in flags if not flag.startswith(_DEVICES)]
        flags = [*others, f"{_DEVICES}{devices}"]
    wanted = " ".join(flags)
    if wanted == given:
        return
    if _has_computed():
        raise RuntimeError(
            "JAX has computed already in this process, and reads XLA_FLAGS only once. Call "
            "fj.tune_compiler() right after the imports, before any array is made."
        )
    os.environ["XLA_FLAGS"] = wanted


def without_loops() -> dict[str, Any]:
    """Compiler options for a program without a loop of steps.

    Without XLA's newer emitters, which `tune_compiler` turns off as they make several kernels of
    such a loop, what is concatenated from many formulas is worked out over and over: a design's
    margins with their Jacobian then take a quarter of a minute to compile, and two seconds with
    them.
    """
    return {"xla_cpu_use_fusion_emitters": True} if _flags_known() else {}


def fusion_barrier(holds: Array, function: Callable[..., Any], *arguments: Any) -> Any:
    """`function(*arguments)`, computed once and stored in memory; NaN unless `holds`.

    Without it (see `fencejax.tune_compiler`), the compiler on a CPU fuses cheap arithmetic into
    every place that reads it, again and again: long scalar formulas with many results then take
    very long to compile and to run. A branch prevents that, as long as the compiler cannot know
    that it is always taken: `holds` must be true for every valid input, one for the whole batch,
    and not a constant. Where the compiler shares arithmetic, this is just `function(*arguments)`.
    """
    if shares_arithmetic():
        return function(*arguments)
    # Traced once, and not again.
    traced, shapes = jax.make_jaxpr(function, return_shape=True)(*arguments)
    results = jax.tree.structure(shapes)

    def computed(leaves):
        return jaxpr_as_fun(traced)(*leaves)

    def not_numbers(_):
        return [jnp.full(leaf.shape, jnp.nan, leaf.dtype) for leaf in jax.tree.leaves(shapes)]

    leaves = jax.tree.leaves(arguments)
    return jax.tree.unflatten(results, jax.lax.cond(holds, computed, not_numbers, leaves))


def sound(tree: Any) -> Array:
    """Whether all numbers of a pytree are finite, in at least one lane of a batch. The compiler
    does not know it as soon as one leaf of the tree is traced."""
    sums = [jnp.sum(leaf) for leaf in jax.tree.leaves(tree)]
    return unvmap_any(jnp.isfinite(functools.reduce(jnp.add, sums)))


def compiler_flags() -> str:
    """XLA's flags of this process as far as they decide results: all but the number of devices."""
    given = os.environ.get("XLA_FLAGS", "").split()
    return " ".join(flag for flag in given if not flag.startswith(_DEVICES))


def adopt_flags(flags: str) -> None:
    """Compile with the flags of another process, keeping this one's number of devices.

    Raises `RuntimeError` if JAX has computed already with other flags.
    """
    if flags == compiler_flags():
        return
    if _has_computed():
        raise RuntimeError(
            "JAX has computed already in this worker, with other settings of XLA. Restart the "
            "workers (client.restart())."
        )
    given = os.environ.get("XLA_FLAGS", "").split()
    mine = [flag for flag in given if flag.startswith(_DEVICES)]
    os.environ["XLA_FLAGS"] = " ".join([flags, *mine])


def traced_settings() -> list[str] | None:
    """JAX's settings that decide what is traced; `None` where they cannot be read."""
    if _trace_context is None:
        return None
    texts = (repr(value) for value in _trace_context())
    # An object that stands for the axes of transformations around a program does not affect it.
    return [text for text in texts if " at 0x" not in text]


def all_settings() -> tuple[Any, ...]:
    """JAX's settings by which it distinguishes compiled programs; `()` where they cannot be
    read."""
    return () if _trace_context is None else _trace_context()


@contextlib.contextmanager
def many_objects() -> Iterator[None]:
    """Switch off Python's garbage collector meanwhile, for a few seconds.

    A trace makes objects by the hundred thousand and keeps nearly all: one pass of the collector
    after another goes through them in vain, a sixth of the time.
    """
    on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if on:
            gc.enable()


def nothing_is_traced() -> bool:
    """Whether the caller is certainly not inside a transformation of JAX, and JAX's settings can be
    read."""
    if _trace_context is None or _trace_state_clean is None:
        return False
    return _trace_state_clean()
