"""Compile, run and time the programs of the ladder."""

import concurrent.futures
import dataclasses
import functools
import time
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import fencejax as fj

from .cases import VARIABLES, Family, outcome
from .errors import Outcome


def value_program(family: Family, fidelity: fj.Fidelity):
    """Numbers of shape (lanes, 11) -> values (lanes, 3) [SI] and statuses (lanes,)."""

    def one(row):
        return outcome(family, fidelity, row, jnp.ones(len(VARIABLES)))

    return functools.partial(fj.each_lane, one)


def gradient_program(family: Family, fidelity: fj.Fidelity):
    """Numbers of shape (lanes, 11) -> values (lanes, 3) [SI], d Q / d ln p (lanes, 3, 8) and
    statuses (lanes,): value and gradient in one program."""

    def one(row):
        def along(factors):
            values, status = outcome(family, fidelity, row, factors)
            return values, (values, status)

        slopes, (values, status) = jax.jacfwd(along, has_aux=True)(jnp.ones(len(VARIABLES)))
        return values, slopes, status

    return functools.partial(fj.each_lane, one)


@dataclasses.dataclass(frozen=True)
class Times:
    """Run time [s] over repeats: the median, and the 10 and 90 % quantiles."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, run: Callable[[], Any], repeats: int, longest: float = 4.0) -> "Times":
        """Time `run`, once for nothing and then up to `repeats` times, or until `longest` [s]."""
        jax.block_until_ready(run())
        taken: list[float] = []
        while len(taken) < repeats and (len(taken) < 3 or sum(taken) < longest):
            begin = time.perf_counter()
            jax.block_until_ready(run())
            taken.append(time.perf_counter() - begin)
        low, median, high = np.quantile(taken, (0.1, 0.5, 0.9))
        return cls(float(median), float(low), float(high))

    def per(self, lanes: int) -> "Times":
        """The same for one of so many lanes."""
        return Times(self.median / lanes, self.low / lanes, self.high / lanes)


@dataclasses.dataclass(frozen=True, eq=False)
class Run:
    """One program's outcome; seconds to trace and compile it beside others, bytes of its
    intermediate arrays, and the program itself where it is to be timed."""

    outcome: Outcome
    compiling: float
    memory: int | None
    timed: Callable[[], Any] | None


def compiled(make, family: Family, fidelity: fj.Fidelity):
    """A program and its argument, with the seconds [s] to trace and compile it."""
    numbers = jnp.asarray(family.numbers)
    begin = time.perf_counter()
    program = jax.jit(make(family, fidelity)).lower(numbers).compile()
    return program, numbers, time.perf_counter() - begin


def memory(program) -> int | None:
    """Bytes of a compiled program's intermediate arrays; `None` where the backend does not say."""
    analysis = program.memory_analysis()
    return None if analysis is None else int(analysis.temp_size_in_bytes)


def run(family: Family, fidelity: fj.Fidelity, *, gradient: bool, keep: bool) -> Run:
    """Compile and run a fidelity over a family; with `keep` it can be timed after."""
    make = gradient_program if gradient else value_program
    program, numbers, seconds = compiled(make, family, fidelity)
    found = jax.device_get(program(numbers))
    values, slopes = found[0], None
    if gradient:
        slopes = found[1] / values[:, :, None]
    timed = (lambda: program(numbers)) if keep else None
    return Run(Outcome(values, slopes, found[-1]), seconds, memory(program), timed)


class Bench:
    """Runs programs in a few threads, each (family, fidelity, lanes) only once, and prints its
    progress.

    The result of a program that fails is `None`, with its error in `failures`.
    """

    def __init__(self, threads: int, say: Callable[[str], None]):
        self._pool = concurrent.futures.ThreadPoolExecutor(max_workers=threads)
        self._say, self._begin = say, time.perf_counter()
        self._runs: dict[Any, tuple[concurrent.futures.Future, str]] = {}
        self._reported: set = set()
        self.failures: dict[str, str] = {}

    def ask(self, family: Family, fidelity: fj.Fidelity, label: str, *, gradient=True, keep=False):
        """Queue a program; its key for `result`."""
        key = (family.kind, family.duration, len(family.numbers), fidelity, gradient)
        if key not in self._runs:
            future = self._pool.submit(run, family, fidelity, gradient=gradient, keep=keep)
            self._runs[key] = (future, label)
        return key

    def call(self, key, function: Callable[[], Any], label: str):
        """Queue a function of no arguments; its key for `result`."""
        self._runs[key] = (self._pool.submit(function), label)
        return key

    def wait(self) -> None:
        """Wait for all queued runs and print a line for each."""
        pending = {future: (key, label) for key, (future, label) in self._runs.items()
                   if key not in self._reported}  # fmt: skip
        total, done, begin = len(pending), 0, time.perf_counter()
        for future in concurrent.futures.as_completed(pending):
            key, label = pending[future]
            self._reported.add(key)
            done += 1
            now = time.perf_counter()
            left = (now - begin) / done * (total - done)
            error = future.exception()
            note = "" if error is None else f"  FAILED: {str(error).splitlines()[0][:80]}"
            if error is not None:
                self.failures[label] = str(error)
            self._say(
                f"  {now - self._begin:6.1f} s  {done:3d} of {total}, {left:5.0f} s left  "
                f"{label}{note}"
            )

    def result(self, key) -> Any:
        """The `Run` of a program or the value of a function; `None` where it failed."""
        future, _ = self._runs[key]
        return None if future.exception() is not None else future.result()

    def close(self) -> None:
        """Let the threads go."""
        self._pool.shutdown(wait=False, cancel_futures=True)
