"""Executables kept in the folder of `_kept_programs`: where one is found there is nothing to
trace, to lower or to compile.

An executable is found by what a traced program is found by, and by the kind of processor. It is
written as JAX writes it, as a pickle, and must be trusted as much as JAX's own cache in that
folder.
"""

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
from jax.experimental.compilation_cache import compilation_cache

from ._identity import UnknownError
from ._kept_programs import Program, Store, abstract, keeping, processor
from ._xla import all_settings, nothing_is_traced

_without_cache = threading.Lock()
"""Locked while JAX's cache is off, which is a setting of the whole process."""


def compiled(
    function: Callable[[list[Any]], Any], options: dict[str, Any] | None, *what: Any
) -> Callable[[list[Any]], Any]:
    """`jax.jit(function)`, a map from a list of arrays to a pytree, whose executable is in the
    folder of `keep_programs` too: where it is found there is nothing to trace, lower or compile.

    `what` distinguishes it from all others, as for `kept`.
    """
    jitted = jax.jit(function, compiler_options=options)
    ready: dict[Any, Program | None] = {}
    of: list[Store | None] = [None]

    def run(numbers: list[Any]) -> Any:
        store = keeping()
        if store is None or jax.config.jax_disable_jit or not nothing_is_traced():  # pyright: ignore
            return jitted(numbers)
        if not all(isinstance(number, jax.Array) for number in numbers):
            return jitted(numbers)
        if of[0] is not store:
            ready.clear()
            of[0] = store
        key = tuple((number.aval, number.sharding) for number in numbers), all_settings()
        if key not in ready:
            place = _place(store, numbers, options, what)
            ready[key] = None
            if place is not None:
                program = _load(store, place)
                found = None if program is None else _tried(program, numbers)
                if program is not None and found is not None:
                    ready[key] = program
                    return jax.tree.unflatten(program.results, found)
                ready[key] = program = _compile(function, numbers, options)
                _save(store, place, program, len(numbers))
        program = ready[key]
        if program is None:
            return jitted(numbers)
        return jax.tree.unflatten(program.results, program.run(numbers))

    return run


def _place(store: Store, numbers, options, what) -> Path | None:
    """The file of the executable for such numbers, if they are all on the first device."""
    if any(number.device != jax.devices()[0] for number in numbers):
        return None
    what = "compiled", processor(), [list(pair) for pair in (options or {}).items()], *what
    try:
        known = [abstract(number) for number in numbers]
        return store.place(what, jax.tree.structure(numbers), known, "executable")
    except UnknownError:
        return None


def _tried(program: Program, numbers) -> list[jax.Array] | None:
    """The results of an executable, if it runs here: a missing part shows only when it runs."""
    try:
        return jax.block_until_ready(program.run(numbers))
    except Exception:
        return None


def _compile(function, numbers, options) -> Program:
    """A program compiled without JAX's cache, as a program that JAX has read from there cannot be
    written completely."""
    structure = []

    def flat(numbers):
        found, shape = jax.tree.flatten(function(numbers))
        structure.append(shape)
        return found

    lowered = jax.jit(flat, compiler_options=options).lower(numbers)
    with _without_cache:
        was = jax.config.jax_enable_compilation_cache  # pyright: ignore
        jax.config.update("jax_enable_compilation_cache", False)
        compilation_cache.reset_cache()
        try:
            return Program(lowered.compile(), structure[0])
        finally:
            jax.config.update("jax_enable_compilation_cache", was)
            compilation_cache.reset_cache()


def _load(store: Store, place: Path) -> Program | None:
    """The executable kept there, if the file is complete and JAX can read it."""
    from jax.experimental import serialize_executable

    found = store.read(place)
    if found is None:
        return None
    results, content = found
    count, _, program = content.partition(b"\n")
    given = jax.tree.structure((([0] * int(count),), {}))
    flat = jax.tree.structure([0] * results.num_leaves)
    devices = jax.devices()[:1]
    try:
        run = serialize_executable.deserialize_and_load(
            program, given, flat, execution_devices=devices
        )
    except Exception:
        return None
    return Program(run, results)


def _save(store: Store, place: Path, program: Program, count: int) -> None:
    """Keep an executable that takes `count` arrays, if JAX can write it."""
    from jax.experimental import serialize_executable

    try:
        written, _, _ = serialize_executable.serialize(program.run)
    except Exception:
        return
    store.write(place, program.results, b"%d\n" % count + written)
