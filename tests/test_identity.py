"""The identity of kept computations: functions of one name by their code, the package by its
source, the same in every process."""

import enum
import functools
import os
import subprocess
import sys
import threading
import types

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax import _identity as identity


def made(code, name="made", **known):
    """What a module of a user's calls `name`."""
    space = {"__name__": "users_own", "eqx": eqx, "fj": fj, "partial": functools.partial, **known}
    exec(compile(code, "users_own.py", "exec"), space)
    return space[name]


def module(code):
    """A module of a user's."""
    found = types.ModuleType("users_helpers")
    exec(code, found.__dict__)
    return found


PAIRS = {
    "constant": ("def made(s): return 2 * s", "def made(s): return 3 * s"),
    "operation": ("made = lambda s: s + s", "made = lambda s: s * s"),
    "attribute": ("made = lambda s: s.x", "made = lambda s: s.y"),
    "default": ("def made(s, n=1): return n", "def made(s, n=2): return n"),
    "keyword": ("def made(s, *, n=1): return n", "def made(s, *, n=2): return n"),
    "inner": (
        "def made(s): return map(lambda x: x + 1, s)", "def made(s): return map(lambda x: x + 2, s)"
    ),
    "partial": ("made = partial(pow, 2)", "made = partial(pow, 3)"),
    "argument of a partial": ("made = partial(lambda s: s, 2)", "made = partial(lambda s: -s, 2)"),
    "method": (
        "class made:\n    def f(self): return 1", "class made:\n    def f(self): return 2",
    ),
    "property": (
        "class made:\n    f = property(lambda s: 1)", "class made:\n    f = property(lambda s: 2)",
    ),
    "attribute of a class": ("class made:\n    n = 1", "class made:\n    n = 2"),
    "base": (
        "class Base:\n    n = 1\nclass made(Base): pass",
        "class Base:\n    n = 2\nclass made(Base): pass",
    ),
    "drive": (
        "class Own(fj.HarmonicDrive):\n    def f(self): return 1\nmade = Own()",
        "class Own(fj.HarmonicDrive):\n    def f(self): return 2\nmade = Own()",
    ),
    "static field": (
        "class Own(eqx.Module):\n    n: int = eqx.field(static=True)\nmade = Own(1)",
        "class Own(eqx.Module):\n    n: int = eqx.field(static=True)\nmade = Own(2)",
    ),
}  # fmt: skip


@pytest.mark.parametrize("pair", PAIRS.values(), ids=PAIRS)
def test_what_has_one_name_and_other_code_is_distinguished(pair):
    one, other = (identity.text(made(code)) for code in pair)
    assert one == identity.text(made(pair[0]))
    assert one != other


@pytest.mark.parametrize("wrap", [jax.jit, jax.custom_jvp, functools.lru_cache])
def test_functions_within_others_are_distinguished(wrap):
    one, other = (identity.text(wrap(made(code))) for code in PAIRS["operation"])
    assert one == identity.text(wrap(made(PAIRS["operation"][0])))
    assert one != other


def test_what_a_function_reads_from_outside_counts():
    def scaled(factor):
        return lambda s: factor * s

    assert identity.text(scaled(2.0)) == identity.text(scaled(2.0))
    assert identity.text(scaled(2.0)) != identity.text(scaled(3.0))
    assert identity.text(scaled(np.arange(1e3))) != identity.text(scaled(np.arange(1e3) + 1e-9))
    # A global number, a global function's code, and what it reads of a module of the user's.
    reads = "n = {n}\ndef helper(s): return {n} * s\ndef made(s): return {read}"
    for read in ("n * s", "helper(s)", "[helper(x) for x in s]"):
        one, same, other = (identity.text(made(reads.format(n=n, read=read))) for n in (1, 1, 2))
        assert one == same
        assert one != other
    # What it does not read may change.
    assert len({identity.text(made(reads.format(n=n, read="s"))) for n in (1, 2)}) == 1
    code = "def helper(s): return {}\nunread = {}"
    helpers = [module(code.format(*pair)) for pair in ((1, 0), (1, 1), (2, 1))]
    one, same, other = (
        identity.text(made("made = lambda s: helpers.helper(s)", helpers=each)) for each in helpers
    )
    assert one == same
    assert one != other


def test_functions_that_call_themselves_and_each_other_end():
    code = "def made(n): return n and other(n - {})\ndef other(n): return made(n)"
    one, same, other = (identity.text(made(code.format(n))) for n in (1, 1, 2))
    assert one == same
    assert one != other


def test_where_a_function_stands_and_is_shared_does_not_count():
    code = "def made(s): return 2 * s"
    assert identity.text(made(code)) == identity.text(made("\n\n# A note.\n" + code))
    function, again = made(code), made(code)
    assert identity.text([function, function]) == identity.text([function, again])


class Kind(enum.Enum):
    ONE = 1
    TWO = 2


def test_values_are_distinguished():
    values = [
        None, True, 1, 1.0, -0.0, 0.0, "1", b"1", 1j, (1, 2), {"a": 1}, {1: "a"}, {"a": 2}, {1, 2},
        np.ones(2), np.ones(2, np.float32), np.ones(2, int), np.ones((2, 1)), np.ones(300),
        np.zeros(300), np.zeros((0, 2)), float("inf"), np.array([1.0, np.nan]),
        np.array([2.0, np.nan]), Kind.ONE, Kind.TWO, print, len, jnp.sin, np.sin, np.cos, range(3),
        range(4), fj.Fidelity.fast(), fj.Fidelity.fast(modes=3), fj.Parcel(), fj.Belt, fj.Parcel,
        jax.tree.structure((1, 2)), jax.tree.structure((1, None)), jax.tree.structure({"a": 1}),
        jax.tree.structure({"b": 1}), jax.tree.structure(fj.Parcel()),
    ]  # fmt: skip
    assert len({identity.text(value) for value in values}) == len(values)
    # A number is the same as it is in a scene.
    assert identity.text(0.5) == identity.text(np.float64(0.5)) == identity.text(jnp.asarray(0.5))


def test_what_cannot_be_identified_is_refused():
    lock = threading.Lock()
    for value in (lock, lambda: lock, np.array([lock])):
        with pytest.raises(identity.UnknownError):
            identity.description(value)
    with pytest.raises(ValueError, match="`measures` must be made of .* but holds an obj"):
        identity.refused("measures", lambda: identity.description(lock))


SCRIPT = """
import functools, jax.numpy as jnp, fencejax as fj
from fencejax import _identity as identity
from fencejax.design import OBJECTIVES, shock

LEVELS = {"low", "middle", "high"}

class Own(fj.HarmonicDrive):
    def motion(self, time):
        return super().motion(2 * time) if "low" in LEVELS else None

measures = [*fj.results.MEASURES.values(), *shock.damage_boundary(60.0, 2.0).measures]
parts = [Own(), fj.Fence(), measures, OBJECTIVES, functools.partial(jnp.sin), fj.Sorter().machine]
print(identity.edition(), identity.text(parts))
"""


def test_every_process_tells_the_same():
    found = {
        subprocess.run(
            [sys.executable, "-c", SCRIPT], check=True, capture_output=True, text=True,
            env=os.environ | {"PYTHONHASHSEED": seed},
        ).stdout
        for seed in ("1", "2")
    }  # fmt: skip
    assert len(found) == 1
    assert ", source " in found.pop()


def test_the_edition_is_of_the_source(monkeypatch, tmp_path):
    def edition():
        identity.source.cache_clear()
        return identity.edition()

    try:
        monkeypatch.setattr(identity, "_PACKAGE", tmp_path)
        version = edition()
        assert "source" not in version
        (tmp_path / "one.py").write_text("x = 1\n")
        # Written after this process began: it is not known whether it runs it.
        assert edition().startswith(f"{version}, source changed after ")
        monkeypatch.setattr(identity, "STARTED", 1e12)
        first = edition()
        (tmp_path / "one.py").write_text("x = 2\n")
        second = edition()
    finally:
        identity.source.cache_clear()
    assert first != second
    assert first.startswith(f"{version}, source ")
