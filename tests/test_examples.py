"""Every public name has an example in its docstring, and every example gives what it shows.

Examples take `fj`, `jax`, `jnp` and `np` for granted, and write into a folder that they share.
Those that need a scene computed take the rigid wall or the oblique impact as they are by default,
so that few programs are compiled.
"""

import doctest
import inspect
import types
from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from api_reference import readable
from jaxtyping import ArrayLike

import fencejax as fj

GIVEN = {"fj": fj, "jax": jax, "jnp": jnp, "np": np}
# Rooms for those who extend the package: one example each, as what a user calls is in `fj` itself.
ROOMS = {"design", "integrators", "model", "parts", "results", "sorter", "study"}


def is_described(value) -> bool:
    """Whether a docstring of its own belongs to it: not to a value, such as a `Quantity`."""
    return isinstance(value, type | types.ModuleType) or inspect.isfunction(inspect.unwrap(value))


def public() -> Iterator[tuple[str, object]]:
    """Every public module, class and function: of `fj`, and of its modules that are no rooms."""
    yield "fencejax", fj
    for name in fj.__all__:
        value = getattr(fj, name)
        yield name, value
        if isinstance(value, types.ModuleType) and name not in ROOMS:
            for key, inner in vars(value).items():
                home = getattr(inner, "__module__", None) or ""
                if not key.startswith("_") and home.startswith(value.__name__):
                    yield f"{name}.{key}", inner


DESCRIBED = {name: value for name, value in public() if is_described(value)}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("examples")


@pytest.mark.parametrize("name", DESCRIBED)
def test_example_gives_what_it_shows(name, folder, monkeypatch):
    monkeypatch.chdir(folder)
    text = inspect.unwrap(DESCRIBED[name]).__doc__ or ""
    assert ">>>" in text, f"`{name}` needs an example in its docstring"
    example = doctest.DocTestParser().get_doctest(text, dict(GIVEN), name, None, 0)
    said: list[str] = []
    runner = doctest.DocTestRunner(verbose=False)
    runner.run(example, out=said.append)
    assert not runner.failures, "".join(said)


def test_tables_are_shown_by_their_module():
    """A table has no docstring of its own: `LIMITS` and `OBJECTIVES`."""
    tables = [name for name in fj.__all__ if isinstance(getattr(fj, name), dict)]
    assert tables
    assert [name for name in tables if f">>> fj.{name}[" not in (fj.objectives.__doc__ or "")] == []


@pytest.mark.parametrize(
    ("annotation", "short"),
    [
        (ArrayLike, "ArrayLike"),
        (ArrayLike | None, "ArrayLike | None"),
        (tuple[jax.Array, fj.Fence], "tuple[Array, Fence]"),
        (fj.Fence, "Fence"),
    ],
)
def test_reference_writes_types_as_the_source_does(annotation, short):
    assert readable(inspect.formatannotation(annotation)) == short
