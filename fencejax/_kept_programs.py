"""Programs kept in a folder, so that other processes need not trace and compile them again.

To trace and lower a scene and its derivative takes longer than to load the compiled program.
`jax.export` writes a lowered program, which another process calls as one operation. A program is
found by what it is made from: the package's source, the versions of all packages whose code takes
part, JAX's settings and XLA's flags, and the program's own name with its static structure, shapes
and types. A program with a part that is not identified by its name and fields, such as a user's own
drive law, is traced anew.
"""

import dataclasses
import functools
import hashlib
import importlib
import importlib.metadata
import json
import os
import platform
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.custom_batching
from jax.experimental.compilation_cache import compilation_cache

from ._identity import UnknownError, source
from ._xla import traced_settings

_TRACED = "jax", "jaxlib", "equinox", "diffrax", "lineax", "optimistix", "numpy", "jaxtyping"
_BOUND = 256 * 2**20
"""Size [bytes] of a folder above which the programs used longest ago are deleted."""


class _Leaf:
    """Stands for an array in a tree."""


# --- Trees as text ---------------------------------------------------------------------------


def _written(tree: Any) -> Any:
    """A tree in the terms of JSON: this package's classes by names and fields, arrays as `"*"`."""
    if isinstance(tree, _Leaf):
        return "*"
    kind = type(tree)
    if tree is None or kind in (bool, int, float):
        return tree
    if kind is str:
        return ["str", tree]
    if kind is jax.tree_util.PyTreeDef:
        return ["structure", _text(tree)]
    if kind in (tuple, list):
        return [kind.__name__, *map(_written, tree)]
    if kind is dict and all(isinstance(key, str) for key in tree):
        return ["dict", *([key, _written(value)] for key, value in tree.items())]
    name = kind.__module__, kind.__qualname__
    if name[0].partition(".")[0] != __package__ or "<" in name[1]:
        raise UnknownError(name)
    if dataclasses.is_dataclass(kind):
        return ["fields", *name, *([key, _written(value)] for key, value in vars(tree).items())]
    if isinstance(tree, tuple) and hasattr(tree, "_fields"):
        return ["named", *name, *map(_written, tree)]
    raise UnknownError(name)


def _read(text: Any) -> Any:
    """The tree that `_written` has written."""
    if text == "*":
        return _Leaf()
    if not isinstance(text, list):
        return text
    kind, *rest = text
    if kind == "str":
        return rest[0]
    if kind in ("tuple", "list"):
        return {"tuple": tuple, "list": list}[kind](map(_read, rest))
    if kind == "dict":
        return {key: _read(value) for key, value in rest}
    module, name, *values = rest
    if module.partition(".")[0] != __package__:
        raise UnknownError(module)
    found: Any = importlib.import_module(module)
    for part in name.split("."):
        found = getattr(found, part)
    if kind == "named":
        return found(*map(_read, values))
    made = object.__new__(found)
    for key, value in values:
        object.__setattr__(made, key, _read(value))
    return made


def _text(structure: Any) -> Any:
    """A tree structure of JAX in the terms of JSON."""
    return _written(jax.tree.unflatten(structure, [_Leaf()] * structure.num_leaves))


# --- What a program is made from -------------------------------------------------------------


@functools.cache
def _source() -> str | None:
    """A digest of this package's source and of the versions that matter; `None` where the files may
    differ from those that this process runs."""
    files = source()
    versions = [f"{name} {importlib.metadata.version(name)}" for name in _TRACED]
    made = "\n".join([str(files), platform.python_version(), *versions])
    return None if files is None else hashlib.sha256(made.encode()).hexdigest()


class _Abstract(NamedTuple):
    """Shape and type of an array, known when a program is traced."""

    shape: tuple[int, ...]
    dtype: str
    weak: bool

    def struct(self) -> jax.ShapeDtypeStruct:
        return jax.ShapeDtypeStruct(self.shape, self.dtype, weak_type=self.weak)


def abstract(leaf: Any) -> _Abstract:
    value = jax.typeof(leaf)
    if getattr(value, "vma", None) or not value.sharding.mesh.empty:
        raise UnknownError("a part of an array that is spread over devices")
    return _Abstract(value.shape, value.dtype.name, bool(value.weak_type))


# --- The folder ------------------------------------------------------------------------------


class Program(NamedTuple):
    """A program from leaves to leaves, exported or compiled, and the structure of its result."""

    run: Any
    results: Any


@dataclasses.dataclass(frozen=True)
class Store:
    """The programs in a folder."""

    folder: Path

    def place(
        self, what: tuple[Any, ...], structure: Any, leaves: list[_Abstract], kind: str = "program"
    ) -> Path | None:
        """The file of a program, existing or not; `None` for a program that is not kept."""
        code = _source()
        if code is None or jax.default_backend() != "cpu" or jax.config.jax_default_device:  # pyright: ignore
            return None
        known = traced_settings()
        if known is None:
            return None
        settings = [*known, os.environ.get("XLA_FLAGS", "")]
        made = json.dumps([code, settings, _written(what), _text(structure), leaves])
        return self.folder / f"{hashlib.sha256(made.encode()).hexdigest()}.{kind}"

    def load(self, place: Path) -> Program | None:
        """The traced program kept there, if the file is complete."""
        from jax import export

        found = self.read(place)
        if found is None:
            return None
        try:
            exported = export.deserialize(bytearray(found[1]))
            if b"lapack" not in found[1]:
                # To call a program "of a CPU" JAX prepares LAPACK by an import of SciPy, which
                # takes as long as all the rest.
                checks = (*exported.disabled_safety_checks, export.DisabledSafetyCheck.platform())
                exported = dataclasses.replace(
                    exported, platforms=("host",), disabled_safety_checks=checks
                )
        except Exception:
            # Another version of JAX may read and call programs differently: trace anew.
            return None
        return Program(exported, found[0])

    def save(self, place: Path, program: Program) -> None:
        """Keep a traced program."""
        self.write(place, program.results, program.run.serialize())

    def read(self, place: Path) -> tuple[Any, bytes] | None:
        """The structure of the results and the program."""
        try:
            content = place.read_bytes()
            os.utime(place)
        except OSError:
            return None
        digest, _, rest = content.partition(b"\n")
        if hashlib.sha256(rest).hexdigest().encode() != digest:
            return None
        results, _, program = rest.partition(b"\n")
        return jax.tree.structure(_read(json.loads(results))), program

    def write(self, place: Path, results: Any, program: bytes) -> None:
        """Write a program by renaming a file, as other processes may read it at any time."""
        rest = json.dumps(_text(results)).encode() + b"\n" + program
        content = hashlib.sha256(rest).hexdigest().encode() + b"\n" + rest
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._make_room(len(content))
            handle, name = tempfile.mkstemp(dir=self.folder)
            with os.fdopen(handle, "wb") as file:
                file.write(content)
            os.replace(name, place)
        except OSError:
            return

    def _make_room(self, size: int) -> None:
        files = [(file.stat(), file) for file in self.folder.iterdir()]
        total = size + sum(state.st_size for state, _ in files)
        for state, file in sorted(files, key=lambda pair: pair[0].st_mtime):
            if total <= _BOUND:
                return
            file.unlink(missing_ok=True)
            total -= state.st_size


# --- Where ----------------------------------------------------------------------------------


def cache_programs(folder: str | os.PathLike | None = None) -> Path | None:
    """Keep programs in a folder, so that a program is traced and compiled once for all processes
    that run it: `fj.cache_programs()`, right after the imports.

    Programs that compile for longer than `jax_persistent_cache_min_compile_time_secs`, by default a
    second, are kept. On a CPU simulations are kept too, traced and, where they are run by
    themselves, compiled, up to 256 MiB. They are found again by this package's source, all versions
    and settings, and the scene's parts. Kept programs are run without a check, so a folder must be
    as trustworthy as a program. Simulations of a scene with classes or functions from elsewhere are
    traced anew in each process, and all simulations where this package's files have changed since
    the process began. A replacement of this package's functions in a running process is not
    noticed. The folder may be deleted at any time.

    **Arguments:**

    - `folder`: by default JAX's own setting (`JAX_COMPILATION_CACHE_DIR`), or else a folder in the
      user's folder for caches, with a name of its own for each kind of processor: a program
      compiled for one may not run on another.

    Returns the folder; `None` where JAX's cache is switched off
    (`JAX_ENABLE_COMPILATION_CACHE=false`), or where no folder is given and the user's own cannot be
    written.

    Raises `OSError` where a folder that is given cannot be made.

    >>> folder = fj.cache_programs()
    """
    settings: Any = jax.config
    if not settings.jax_enable_compilation_cache:
        return None
    configured = settings.jax_compilation_cache_dir
    given = configured if folder is None else folder
    found = Path(given) if given else _users_caches() / "fencejax" / processor()
    try:
        found.mkdir(parents=True, exist_ok=True)
    except OSError:
        if given:
            raise
        return None
    if str(found) != configured:
        jax.config.update("jax_compilation_cache_dir", str(found))
        # If JAX has compiled before, it has noted that there is no cache.
        compilation_cache.reset_cache()
    keep_programs(found / "traced")
    return found


def _users_caches() -> Path:
    """The user's folder for files that programs can make again."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def processor() -> str:
    """A name for this kind of processor: folders of users are shared by machines of many kinds."""
    known = [platform.machine(), platform.processor()]
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    known += dict.fromkeys(line for line in lines if line.startswith(("flags", "Features")))
    digest = hashlib.sha256("\n".join(known).encode()).hexdigest()
    return f"{platform.machine() or 'cpu'}-{digest[:12]}"


_store: Store | None = None


def keep_programs(folder: Path | None) -> None:
    """Keep traced programs in a folder from now on, or none."""
    global _store
    try:
        import flatbuffers  # noqa: F401  # `jax.export` needs it.
    except ImportError:
        folder = None
    _store = None if folder is None else Store(folder)


def keeping() -> Store | None:
    """The store that programs are kept in, if any."""
    return _store


def _made(function: Callable[[Any], Any], structure: Any, leaves: list[_Abstract]) -> Program:
    from jax import export

    results = []

    def flat(*leaves):
        found, shape = jax.tree.flatten(function(jax.tree.unflatten(structure, leaves)))
        results.append(shape)
        return found

    exported = export.export(jax.jit(flat))(*(leaf.struct() for leaf in leaves))
    return Program(exported, results[0])


def kept(function: Callable[[Any], Any], *what: Any) -> Callable[[Any], Any]:
    """`function`, a map of pytrees, as one operation. With a known argument, linearisation takes it
    as a whole instead of operation by operation as with `jax.jit`. It is read from the folder of
    `keep_programs` if it is there.

    `what` distinguishes it from all other programs of this package's source, by values, strings and
    fields of this package's classes. It is not differentiated.
    """

    def run(argument):
        if _store is None:
            return function(argument)
        leaves, structure = jax.tree.flatten(argument)
        known = []
        try:
            known = [abstract(leaf) for leaf in leaves]
            place = _store.place(what, structure, known)
        except UnknownError:
            place = None
        if place is None:
            return function(argument)
        program = _store.load(place)
        if program is None:
            program = _made(function, structure, known)
            _store.save(place, program)
        # Every process, the one that makes it too, calls the same program, so that it compiles
        # once.
        return jax.tree.unflatten(program.results, program.run.call(*leaves))

    whole = jax.custom_batching.custom_vmap(run)

    @whole.def_vmap
    def _(size, in_batched, argument):
        (batched,) = in_batched
        axes = jax.tree.map(lambda b: 0 if b else None, batched)
        lanes = jax.vmap(function, in_axes=(axes,), axis_size=size)
        marks = tuple(jax.tree.leaves(batched))
        if keeping():
            lanes = kept(lanes, *what, "lanes", size, marks)
        result = lanes(argument)
        return result, jax.tree.map(lambda _: True, result)

    return whole
