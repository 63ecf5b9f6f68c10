"""Identities of computations whose numbers are kept on the disk: this package's source, and the
values, classes and functions that a computation is made of.

A function or a class of the user's is identified by its code and by everything outside that the
code uses: defaults, enclosed values, and the global names that it reads. One of Python's own, of
this package or of an installed library is identified by its name, of a library with its version.
"""

import copyreg
import dataclasses
import dis
import functools
import hashlib
import importlib.metadata
import json
import math
import sys
import time
import types
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import jax
import numpy as np

STARTED = time.time()
_PACKAGE = Path(__file__).parent
_LARGE = 256
"""Number of elements above which an array is identified by a digest."""
_GLOBALS = "LOAD_GLOBAL", "LOAD_NAME"
_GENERATED = "__init__", "__repr__", "__eq__", "__hash__", "__setattr__", "__delattr__"
"""Methods that a dataclass gets from its fields."""


class UnknownError(ValueError):
    """A value that cannot be identified by names, fields and code."""


# --- This package ----------------------------------------------------------------------------


@functools.cache
def source() -> str | None:
    """A digest of this package's source; `None` where there are no files, and where the files may
    differ from those that this process runs."""
    digest = hashlib.sha256()
    files = sorted(_PACKAGE.rglob("*.py"))
    for file in files:
        state = file.stat()
        if max(state.st_mtime, state.st_ctime) >= STARTED:
            return None
        digest.update(f"{file.relative_to(_PACKAGE)} {state.st_size}\n".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest() if files else None


def edition() -> str:
    """This package's version with a digest of its source, such as `"0.1.0, source 1f0c9a7be205"`:
    numbers of two editions may differ. Files that have changed since this process began count as an
    edition of their own, as it is not known which code the process runs."""
    version = importlib.metadata.version("fencejax")
    digest = source()
    if digest is not None:
        return f"{version}, source {digest[:12]}"
    changed = any(_PACKAGE.rglob("*.py"))
    return f"{version}, source changed after {STARTED:.6f}" if changed else version


# --- Values ----------------------------------------------------------------------------------


def description(value: Any) -> Any:
    """A value in the terms of JSON: arrays as lists of numbers, long ones by a digest, dataclasses
    and named tuples by their fields, pytrees by their nodes, functions and classes by name or code.

    Raises `UnknownError` for a value of no such kind, as a lock or an open file.
    """
    return _Describer().describe(value)


def text(value: Any) -> str:
    """`description` as text."""
    return json.dumps(description(value))


class _Describer:
    """The path through a value. A value that contains itself, as a function that calls itself, is
    described by how far up the path it is."""

    def __init__(self):
        self._path: list[Any] = []

    def describe(self, value: Any) -> Any:
        if value is None or type(value) in (bool, int, str):
            return value
        if isinstance(value, float):
            # JSON has no NaN and no infinity.
            return float(value) if math.isfinite(value) else str(float(value))
        if isinstance(value, (np.ndarray, np.generic, jax.Array)):
            return _numbers(value)
        if isinstance(value, (bytes, complex, type(...))):
            return {"class": type(value).__name__, "value": repr(value)}
        if isinstance(value, types.ModuleType):
            return {"module": value.__name__}
        for up, outer in enumerate(reversed(self._path)):
            if outer is value:
                return {"again": up}
        self._path.append(value)
        try:
            return self._by_kind(value)
        finally:
            self._path.pop()

    def _by_kind(self, value: Any) -> Any:
        if isinstance(value, Mapping):
            if all(isinstance(key, str) for key in value):
                return {key: self.describe(part) for key, part in value.items()}
            pairs = [[self.describe(key), self.describe(part)] for key, part in value.items()]
            return {"pairs": pairs}
        if isinstance(value, (set, frozenset)):
            return {"set": sorted(text(part) for part in value)}
        if type(value) in (tuple, list):
            return [self.describe(part) for part in value]
        if isinstance(value, type):
            return self._class(value)
        if isinstance(value, jax.tree_util.PyTreeDef):
            return self._structure(value)
        if isinstance(value, types.CodeType):
            return self._code(value)
        if isinstance(value, types.FunctionType):
            return self._function(value)
        if dataclasses.is_dataclass(value):
            return self._fields(value, [field.name for field in dataclasses.fields(value)])
        if isinstance(value, tuple) and hasattr(value, "_fields"):
            return self._fields(value, getattr(value, "_fields"))  # noqa: B009
        return self._other(value)

    def _fields(self, value: Any, names) -> dict[str, Any]:
        present = [name for name in names if hasattr(value, name)]
        there = {name: self.describe(getattr(value, name)) for name in present}
        return {"class": self.describe(type(value)), **there}

    def _structure(self, structure: Any) -> Any:
        node = structure.node_data()
        if node is None:
            return "*" if structure.num_leaves else None
        kind, static = node
        children = map(self._structure, structure.children())
        return [self.describe(kind), self.describe(static), *children]

    def _other(self, value: Any) -> Any:
        """A value that wraps a function, as a compiled one does, that has a name, or that can be
        copied."""
        inner = getattr(value, "__wrapped__", None)
        if inner is not None:
            return {"class": self.describe(type(value)), "of": self.describe(inner)}
        if isinstance(value, types.MethodType):
            return {"method": self.describe(value.__func__), "of": self.describe(value.__self__)}
        if isinstance(value, property):
            return [self.describe(part) for part in (value.fget, value.fset, value.fdel)]
        if isinstance(value, (classmethod, staticmethod)):
            return {"class": type(value).__name__, "of": self.describe(value.__func__)}
        try:
            reduced = copyreg.dispatch_table.get(type(value))
            copied = value.__reduce_ex__(4) if reduced is None else reduced(value)
        except Exception as error:
            name = f"{type(value).__module__}.{type(value).__qualname__}"
            raise UnknownError(f"an object of {name}") from error
        if isinstance(copied, str):
            return {"name": f"{getattr(value, '__module__', None)}.{copied}"}
        made, arguments, *more = copied
        # A subclass of a list or a dictionary gives its elements by iterators.
        parts = arguments, *(list(part) if isinstance(part, Iterator) else part for part in more)
        return {"made": self.describe(made), "of": [self.describe(part) for part in parts]}

    # --- Code

    def _class(self, kind: type) -> Any:
        name = _name(kind)
        if _is_library(kind):
            return name
        parts: dict[str, Any] = {"bases": list(kind.__bases__)}
        for key, part in vars(kind).items():
            code = getattr(part, "__code__", None)
            made = code is not None and code.co_filename == "<string>"
            if made and key in _GENERATED and dataclasses.is_dataclass(kind):
                continue
            if key.startswith("__") and key.endswith("__") and not callable(part):
                continue
            if not isinstance(part, (types.MemberDescriptorType, types.GetSetDescriptorType)):
                parts[key] = part
        parts.pop("_abc_impl", None)
        return {"name": name, "code": self._digest(dict(sorted(parts.items())))}

    def _function(self, function: types.FunctionType) -> Any:
        name = _name(function)
        if _is_library(function) and "<" not in name:
            return name
        code, there = function.__code__, function.__globals__
        enclosed = [_content(cell) for cell in function.__closure__ or ()]
        read = {key: there[key] for key in _globals_of(code) if key in there}
        if _is_library(function):
            # The globals of a library's function belong to the library's version.
            read = {}
        attributes = _names_of(code)
        read = {key: _read_of(part, attributes) for key, part in read.items()}
        taken = [function.__defaults__, function.__kwdefaults__, enclosed, read]
        return {"name": name, "code": self._digest([code, *taken])}

    def _digest(self, parts: Any) -> str:
        return hashlib.sha256(json.dumps(self.describe(parts)).encode()).hexdigest()[:32]

    def _code(self, code: types.CodeType) -> Any:
        names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
        counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
        bytecode = code.co_code.hex(), code.co_exceptiontable.hex()
        return [code.co_name, *bytecode, *counts, *(self.describe(part) for part in names),
                self.describe(code.co_consts)]  # fmt: skip


def _numbers(value: Any) -> Any:
    """An array: its numbers, if they are few, and its type, if it is not the default one."""
    array = np.asarray(value)
    if array.dtype == object:
        raise UnknownError("an array of objects")
    if array.size <= _LARGE and array.size and array.dtype.kind in "fiub":
        values = array.tolist()
        if array.dtype.kind != "f" or np.all(np.isfinite(array)):
            usual = array.dtype == jax.numpy.result_type(float)
            return values if usual else {"dtype": str(array.dtype), "values": values}
    content = hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()
    return {"dtype": str(array.dtype), "shape": list(array.shape), "values": content}


def _name(thing: Any) -> str:
    top = str(thing.__module__).partition(".")[0]
    found = f"{thing.__module__}.{thing.__qualname__}"
    if top == __package__ or top in sys.stdlib_module_names or not _is_library(thing):
        return found
    version = getattr(sys.modules.get(top), "__version__", None)
    return found if version is None else f"{found} {version}"


def _is_library(thing: Any) -> bool:
    """Whether a module, or the module of a thing, is Python's own, this package's, or installed."""
    name = thing.__name__ if isinstance(thing, types.ModuleType) else thing.__module__
    top = str(name).partition(".")[0]
    if top == __package__ or top in sys.stdlib_module_names and top != "__main__":
        return True
    file = getattr(sys.modules.get(top), "__file__", None)
    return file is not None and bool({"site-packages", "dist-packages"} & {*Path(file).parts})


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:
        return None


def _codes(code: types.CodeType) -> list[types.CodeType]:
    """A function's code and that of those within it."""
    inner = (part for part in code.co_consts if isinstance(part, types.CodeType))
    return [code, *(each for part in inner for each in _codes(part))]


def _globals_of(code: types.CodeType) -> list[str]:
    """The global names that a function reads, sorted."""
    found = {
        line.argval
        for each in _codes(code)
        for line in dis.get_instructions(each)
        if line.opname in _GLOBALS
    }
    return sorted(found)


def _names_of(code: types.CodeType) -> list[str]:
    """The names of all globals and attributes that a function reads, sorted."""
    return sorted({name for each in _codes(code) for name in each.co_names})


def _read_of(part: Any, names: list[str], depth: int = 3) -> Any:
    """The part of a global that a function reads: of the user's own module, the names it may
    read."""
    if not isinstance(part, types.ModuleType) or _is_library(part) or not depth:
        return part
    found = {name: getattr(part, name) for name in names if hasattr(part, name)}
    return {name: _read_of(each, names, depth - 1) for name, each in found.items()}


def refused(what: str, describe: Callable[[], Any]) -> Any:
    """The result of `describe`; a value that cannot be identified is refused by a message on the
    argument `what`."""
    try:
        return describe()
    except UnknownError as error:
        raise ValueError(
            f"Argument `{what}` must be made of values, classes and functions that can be told "
            f"from others of the same name, but holds {error}. Write it as a function of plain "
            "values, so that kept numbers are found again by what made them."
        ) from error
