"""The size of the compiled programs and the time to make them, compared with the record.

    python tests/gate.py             # compares; fails where something grew by more than 15 %
    python tests/gate.py --record    # writes gate.json anew
    python tests/gate.py "sort"      # only the programs whose name holds the word

The counts are exact, and the same on every machine with the same versions of JAX (with others, only
operations, trips and calls are compared):

- operations: JAX's, in the program as traced, inner programs included;
- steps, evaluations: of a value at the numbers of `START`, the trips of the program's loops and of
  the loops within these (`loop_trips.py`): Newton's method evaluates a step's equations. What a
  value costs is these times the size of a trip;
- bytes: the length of the program's StableHLO text, which XLA is given;
- instructions: XLA's, after its optimisations;
- calls: matrix products and calls of libraries that are left, each a kernel of its own. Loops run
  as one kernel (`fencejax.tune_compiler`) unless they hold such calls: a gradient once took six
  times as long for some;
- flops and memory [bytes]: arithmetic and memory traffic by XLA's own count, where a loop's body
  counts once.

For a gradient their ratios to those of its value are on record too: eight columns should cost no
more next to a value at one setting than at another. No wall time is asserted. The time to trace,
lower and compile is processor time, over that of a plain program of JAX in the same process: it
fails above 15 % and three standard errors, which come from the scatter of the plain program's own
times. A program above the limit is measured twice more, and the median is used.
"""

import argparse
import functools
import gc
import json
import os
import re
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

if __name__ == "__main__":
    # What is counted does not depend on it, and compiling takes half as long.
    os.environ.setdefault("XLA_FLAGS", "--xla_backend_optimization_level=0")

import jax
import jax.numpy as jnp
import jaxlib
from jax.extend.core import Jaxpr
from loop_trips import loop_trips

import fencejax as fj

FILE = Path(__file__).parent / "gate.json"
ALLOWED = 0.15
TIME = "compile time"
ALL = "all programs"
OVER = " over the value's"
_RATIOS = "operations", "instructions", "flops", "memory"
_TRIES = 3
_TRIPS = "steps", "evaluations"
_OF_ANY_VERSION = "operations", "calls", *_TRIPS


def equations(program: Jaxpr) -> Iterator[Any]:
    """Every operation of a traced program, those of inner programs included."""
    for equation in program.eqns:
        yield equation
        inner = jax.tree.leaves(
            equation.params, is_leaf=lambda x: hasattr(x, "eqns") or hasattr(x, "jaxpr")
        )
        for parameter in inner:
            parameter = getattr(parameter, "jaxpr", parameter)
            if hasattr(parameter, "eqns"):
                yield from equations(parameter)


# --- The programs ----------------------------------------------------------------------------

# h_1 [m], E [Pa], rho [kg/m^3], zeta [1], z [m], l_s [m], l_p [m], m_p [kg].
START = (0.045, 3.0e9, 1130.0, 0.05, 0.132, 0.45, 0.75, 15.0)


class Program(NamedTuple):
    """A scene of a fence and a parcel, at a fidelity, and the fields of its result."""

    scene: Callable[..., fj.Scene | fj.NormalScene]
    fidelity: fj.Fidelity = fj.Fidelity.standard()
    only: str | None = "peak_force"
    parts: Callable[[], dict[str, Any]] = dict

    def value(self, x):
        """The result in eight design variables, as `START`."""
        fence = fj.Fence(x[5], x[6], x[4], x[0], fj.Material(*x[1:4]), **self.parts())
        scene = self.scene(fence=fence, parcel=fj.Parcel(mass=x[7]))
        result = fj.simulate(scene, fidelity=self.fidelity, only=self.only)
        return result if self.only is None else getattr(result, self.only)


_impact = functools.partial(fj.scenes.oblique_impact, duration=0.13)
_COVERED = dict(pad=fj.Pad, shaft=lambda: fj.Shaft(slip_torque=600.0))
PROGRAMS = {
    "normal impact": Program(fj.scenes.normal_impact),
    "impact": Program(_impact),
    "impact, coarse": Program(_impact, fj.Fidelity.coarse()),
    "impact, reference": Program(_impact, fj.Fidelity.reference()),
    "impact, all results": Program(_impact, only=None),
    "cover, shaft and clutch": Program(
        _impact, parts=lambda: {name: make() for name, make in _COVERED.items()}
    ),
    "whole sort": Program(fj.scenes.whole_sort),
}


def _plain(x):
    """Twenty-four oscillators in a ring over a hundred steps, spelled out number by number, and the
    gradient in eight of their numbers: the plain program."""

    def energy(x):
        def step(state, _):
            q, v = list(state[:24]), list(state[24:])
            for i in range(24):
                stretch = q[i] - q[i - 1]
                force = x[i % 8] * jnp.sin(stretch) + jnp.where(stretch > 0, stretch**3, 0.0)
                v[i] = v[i] - 0.01 * (force + q[i] / jnp.sqrt(1 + v[i] * v[i]))
                v[i - 1] = v[i - 1] + 0.01 * force
            q = [a + 0.01 * b for a, b in zip(q, v, strict=True)]
            return (*q, *v), None

        begin = tuple(x[i % 8] / (1 + i) for i in range(48))
        end = jax.lax.scan(step, begin, None, length=100)[0]
        return sum(p * p for p in end)

    columns = jax.vmap(lambda dot: jax.jvp(energy, (x,), (dot,))[1])
    return energy(x), columns(jnp.eye(8))


def compiled(function: Callable[..., Any]) -> tuple[Any, Any, Any, float]:
    """The program of a function of eight numbers as it is traced, lowered and compiled, none of it
    known from before, and the processor time [s] of all three."""
    jax.clear_caches()
    gc.collect()
    # A function of its own: what has been traced of another is not found again.
    given = jnp.asarray(START)
    begin = time.process_time()
    traced = jax.jit(lambda x: function(x)).trace(given)
    lowered = traced.lower()
    program = lowered.compile()
    return traced, lowered, program, time.process_time() - begin


def counts(traced, lowered, program) -> dict[str, float]:
    """The counts of a program; see the top of this file."""
    text, analysis = program.as_text(), program.cost_analysis()
    return {
        "operations": sum(1 for _ in equations(traced.jaxpr.jaxpr)),
        "bytes": len(lowered.as_text()),
        "instructions": text.count(" = "),
        "calls": len(re.findall(r" (?:dot|convolution|custom-call|sort|fft)\(", text)),
        "flops": int(analysis["flops"]),
        "memory": int(analysis["bytes accessed"]),
    }


class Clock:
    """Processor times of programs, in those of the plain program."""

    def __init__(self):
        compiled(_plain)  # What is loaded and set up once.
        self.plain: list[float] = [compiled(_plain)[-1]]

    def time(self, function: Callable[..., Any]) -> tuple[dict[str, float], float]:
        """Counts and relative time of a program, between two plain ones."""
        *stages, seconds = compiled(function)
        self.plain.append(compiled(_plain)[-1])
        return counts(*stages), 2 * seconds / sum(self.plain[-2:])

    def error(self) -> float:
        """Standard error of a relative time [1], from the differences of one plain time to the
        next.

        A normal deviate's median size is 0.6745 of its standard deviation, and a difference of two
        has sqrt(2) of that of one. A relative time has one program's in the numerator and the mean
        of two in the denominator: sqrt(1 + 1 / 2) of that of one.
        """
        steps = [2 * abs(a - b) / (a + b) for a, b in zip(self.plain, self.plain[1:], strict=False)]
        return statistics.median(steps) / 0.6745 / 2**0.5 * 1.5**0.5


def trips_of(function: Callable[..., Any]) -> dict[str, int]:
    """The trips of a value's loops; see the top of this file."""
    return dict(zip(_TRIPS, loop_trips(function, jnp.asarray(START)), strict=True))


def functions(names: list[str]) -> dict[str, Callable[..., Any]]:
    """The values and gradients of programs, by `program: value`."""
    found = {}
    for name in names:
        value, only = PROGRAMS[name].value, PROGRAMS[name].only
        found[f"{name}: value"] = value
        if only is not None:
            found[f"{name}: gradient"] = jax.value_and_grad(value)
    return found


class Measured(NamedTuple):
    """Counts and relative times by program, and the standard errors of the times [1]."""

    programs: dict[str, dict[str, float]]
    errors: dict[str, float]


def measure(names: list[str], tries: int, doubted: Callable[[Measured], list[str]]) -> Measured:
    """Programs measured once, and those that are `doubted` as often as there are tries, where the
    median counts."""
    clock, given = Clock(), functions(names)
    counted, times = {}, {name: [] for name in given}
    trips = {name: trips_of(given[name]) for name in given if name.endswith(": value")}
    pending = list(given)
    found = Measured({}, {})
    for _ in range(tries):
        for name in pending:
            numbers, seconds = clock.time(given[name])
            counted[name] = numbers | trips.get(name, {})
            times[name].append(seconds)
        found = gathered(counted, times, clock.error())
        pending = [name for name in doubted(found) if name in given]
    return found


def gathered(
    counted: dict[str, dict[str, float]], times: dict[str, list[float]], error: float
) -> Measured:
    """Counts, their ratios, medians of the relative times and the sum of these, with errors, where
    a relative time's is `error` [1]."""
    programs, errors = {}, {}
    for name, numbers in counted.items():
        over = {}
        if name.endswith(": gradient"):
            value = counted[name.replace(": gradient", ": value")]
            over = {key + OVER: numbers[key] / value[key] for key in _RATIOS}
        programs[name] = {**numbers, **over, TIME: statistics.median(times[name])}
        errors[name] = error
    if len(programs) > 2:
        shares = [values[TIME] for values in programs.values()]
        programs[ALL] = {TIME: sum(shares)}
        errors[ALL] = error * sum(t * t for t in shares) ** 0.5 / sum(shares)
    return Measured(programs, errors)


# --- The judgement ---------------------------------------------------------------------------


class Growth(NamedTuple):
    """A count that is above the record by more than is allowed."""

    program: str
    key: str
    text: str


def grown(
    found: Measured, known: dict[str, dict[str, float]], keys: tuple[str, ...] | None = None
) -> list[Growth]:
    """What of all `keys`, or of some, is above the record, or not on it."""
    rows = []
    for program, values in found.programs.items():
        for key, value in values.items():
            if (key == TIME and program != ALL) or (keys is not None and key not in keys):
                continue
            old = known.get(program, {}).get(key)
            if old is None:
                rows.append(Growth(program, key, f"{program}: {key} is not on record"))
                continue
            allowed = ALLOWED + (3 * found.errors[program] if key == TIME else 0.0)
            if value > old * (1 + allowed):
                share = f" ({value / old - 1:+.0%}, allowed {allowed:+.0%})" if old else ""
                text = f"{program}: {key} grew from {old:,.6g} to {value:,.6g}{share}"
                rows.append(Growth(program, key, text))
    return rows


def slow(found: Measured, known: dict[str, dict[str, float]]) -> list[str]:
    """Programs whose time is to be measured again: all of them where their sum is above the
    record."""
    above = any(row.key == TIME for row in grown(found, known))
    return list(found.programs) if above else []


def versions() -> dict[str, str]:
    """What counts beside the source."""
    return {"jax": jax.__version__, "jaxlib": jaxlib.__version__}


def recorded() -> dict[str, Any]:
    """The record: versions and programs."""
    return json.loads(FILE.read_text())


def main(arguments: list[str]) -> int:
    """Measure, and compare with the record or write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("words", nargs="*", help="only programs whose names hold these words")
    parser.add_argument("--record", action="store_true", help="write the record anew")
    given = parser.parse_args(arguments)
    fj.tune_compiler()
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_enable_compilation_cache", False)
    names = [name for name in PROGRAMS if all(word in name for word in given.words)]
    if given.record:
        found = measure(names, _TRIES, lambda found: list(found.programs)).programs
        known = recorded()["programs"] if given.words else {}
        FILE.write_text(_written({**known, **found}))
        return 0
    record = recorded()
    known = record["programs"]
    found = measure(names, _TRIES, lambda found: slow(found, known))
    for program, values in found.programs.items():
        print(f"{program}: {_shown(values, known.get(program, {}))}")
    same = versions() == record["versions"]
    bad = grown(found, known, None if same else _OF_ANY_VERSION)
    for row in bad:
        print(f"GROWN {row.text}")
    if not same:
        kinds = ", ".join(_OF_ANY_VERSION)
        print(f"The record is of {record['versions']}, this is {versions()}: {kinds} are judged.")
    if bad:
        print("What is meant to grow is put on record by python tests/gate.py --record.")
    return min(len(bad), 1)


def _shown(values: dict[str, float], known: dict[str, float]) -> str:
    """The time, and what else is not as on record."""
    changed = (
        f"{key} {value:,.6g} (on record {known.get(key, float('nan')):,.6g})"
        for key, value in values.items()
        if key == TIME or f"{value:.4g}" != f"{known.get(key, 0.0):.4g}"
    )
    return ", ".join(changed)


def _written(programs: dict[str, dict[str, float]]) -> str:
    """The record as text: counts as they are, ratios and times to four digits."""
    rounded = {
        program: {k: v if isinstance(v, int) else float(f"{v:.4g}") for k, v in values.items()}
        for program, values in programs.items()
    }
    return json.dumps({"versions": versions(), "programs": rounded}, indent=1) + "\n"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
