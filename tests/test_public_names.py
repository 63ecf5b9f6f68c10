"""The public names of fencejax with their signatures, as recorded in `public_names.txt`.

    python tests/test_public_names.py --record

writes the file anew. A change of it belongs into the commit that makes the change: it is what
users see of it.
"""

import difflib
import enum
import inspect
import re
import sys
import types
from collections.abc import Iterator
from pathlib import Path

import fencejax as fj

FILE = Path(__file__).with_name("public_names.txt")
COMMAND = "python tests/test_public_names.py --record"


def signature(value) -> str:
    """The arguments of a callable, without annotations: names, kinds and defaults."""
    try:
        found = inspect.signature(value)
    except (TypeError, ValueError):
        return "(...)"
    plain = [p.replace(annotation=p.empty) for p in found.parameters.values()]
    text = str(found.replace(parameters=plain, return_annotation=found.empty))
    return re.sub(r" at 0x[0-9a-f]+", "", text)


def members(kind: type) -> Iterator[str]:
    """The public methods, properties and fields of a class, inherited ones included."""
    fields = set()
    for base in kind.__mro__:
        if base.__module__.split(".")[0] == "fencejax":
            fields |= inspect.get_annotations(base).keys()
    own = {
        name
        for base in kind.__mro__
        if base.__module__.split(".")[0] == "fencejax"
        for name in vars(base)
    }
    for name in sorted(own | fields):
        if name.startswith("_"):
            continue
        value = inspect.getattr_static(kind, name, None)
        if isinstance(value, (classmethod, staticmethod)):
            yield f".{name}{signature(getattr(kind, name))}"
        elif inspect.isfunction(value):
            yield f".{name}{signature(value)}"
        else:
            yield f".{name}"


def described(name: str, value) -> list[str]:
    """The lines of one name: of a function its signature, of a class also its members, of a
    table its keys."""
    if isinstance(value, type) and issubclass(value, enum.Enum):
        return [f"{name}: {', '.join(f'{m.name} = {m.value}' for m in value)}"]
    if isinstance(value, type):
        # The instances of an abstract class are made by its subclasses.
        made = "" if inspect.isabstract(value) else signature(value)
        return [f"{name}{made}", *(f"{name}{member}" for member in members(value))]
    if callable(value):
        return [f"{name}{signature(value)}"]
    if isinstance(value, dict):
        return [f"{name}: {', '.join(value)}"]
    return [f"{name}: {type(value).__name__}"]


# Rooms for those who extend the package; what a user calls of them is in `fj` itself.
ROOMS = {"design", "integrators", "model", "parts", "results", "study"}


def public_names() -> list[str]:
    """Every name of `fj.__all__`; of a module also what it defines or exports."""
    lines = []
    for name in sorted(fj.__all__):
        value = getattr(fj, name)
        if not isinstance(value, types.ModuleType):
            lines += described(name, value)
        elif name in ROOMS:
            lines.append(f"{name}: room")
        else:
            for key, inner in sorted(vars(value).items()):
                home = getattr(inner, "__module__", None) or ""
                if not key.startswith("_") and home.startswith(value.__name__):
                    lines += described(f"{name}.{key}", inner)
    return lines


def test_public_names_are_as_recorded():
    known, found = FILE.read_text().splitlines(), public_names()
    difference = list(difflib.unified_diff(known, found, "recorded", "found", lineterm="", n=0))
    assert not difference, "\n".join([f"If this is meant: {COMMAND}", *difference])


def test_dir_shows_public_names_alone():
    assert set(dir(fj)) == {*fj.__all__, "__version__"}
    assert len(set(fj.__all__)) == len(fj.__all__)


def test_signatures_and_members_are_described():
    class Shape:
        """As `described` sees a class of the package."""

        __module__ = "fencejax.made"
        size: float
        sides: int

        def __init__(self, size: float = 1.0, *, sides=4):
            pass

        def area(self, unit: str) -> float:
            return 0.0

        @property
        def edge(self):
            return 0.0

    assert described("Shape", Shape) == [
        "Shape(size=1.0, *, sides=4)", "Shape.area(self, unit)", "Shape.edge", "Shape.sides",
        "Shape.size",
    ]  # fmt: skip
    assert described("f", lambda x, /, *y, z=None, **w: 0) == ["f(x, /, *y, z=None, **w)"]
    assert described("TABLE", {"a": 1, "b": 2}) == ["TABLE: a, b"]


if __name__ == "__main__":
    if sys.argv[1:] == ["--record"]:
        FILE.write_text("\n".join(public_names()) + "\n")
    else:
        print("\n".join(public_names()))
