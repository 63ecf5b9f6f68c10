"""A design problem with its Jacobian, compiled, that computes lanes in doubt again, finer."""

import copy
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .. import _check
from .._xla import without_loops
from ..lanes import each_lane
from ..results import NUMERICAL, Status, climb, refined
from .lagrangian import Vector

Problem = Callable[..., tuple[Array, Array, Array]]
"""z (n,), and data where there are any -> objectives (k,), margins (m,), statuses of any shape."""

# What a problem returns, for messages.
_RETURNED = "results (objectives, margins, statuses of the lanes, such as jnp.zeros(1, int))"
_Five = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
_DOUBTS = np.array(sorted(NUMERICAL))


class Numbers(NamedTuple):
    """The values of a problem at a point, on the host: objectives (k,), margins (m,), their
    Jacobians (k, n) and (m, n), how often each `Status` occurred, and the rung of the fidelities at
    which each lane was computed (a `Program` counts as one lane)."""

    objectives: Vector
    margins: Vector
    objective_rows: np.ndarray
    margin_rows: np.ndarray
    statuses: np.ndarray
    rungs: np.ndarray

    @property
    def status(self) -> int:
        """The largest status that occurred."""
        return int(np.max(np.flatnonzero(self.statuses), initial=0))

    @property
    def physical(self) -> int:
        """The largest status that occurred and is not numerical, but a property of the design."""
        found = np.setdiff1d(np.flatnonzero(self.statuses), _DOUBTS)
        return int(np.max(found, initial=0))


class Program:
    """A problem with its Jacobian, compiled once for all runs that use it.

    The problem is a function of z (n,) and of further arguments, the *data*: any pytrees of
    numbers that are constant in a run, such as the bound of a limit. They are arguments of the
    compiled program, so that new values do not compile it again.

    With `fidelities`, each finer than the one before, the problem takes a fidelity, too:

        def problem(z, fidelity):
            result = fj.simulate(scene(z), fidelity=fidelity, history=False)
            return result.peak_force, limit.margin(result, scene(z)), result.status

        fj.minimize(fj.Program(problem, fj.Fidelity.fast().ladder()), start)

    Where a status is numerical (`Status.numerical`), value and Jacobian are computed again at the
    next fidelity. Those of the last fidelity are used in any case, and the record has the status.

    `compiler_options` are those of `jax.jit` for the program of one point: with
    `{"xla_backend_optimization_level": 0}` it compiles faster and runs slower, which pays off for
    some tens of calls.

    >>> program = fj.Program(lambda z, bound: (z**2, z - bound, jnp.zeros(1, int)))
    >>> [fj.minimize(program, [0.9], data=(bound,)).point.round(3) for bound in (0.5, 0.6)]
    [array([0.5]), array([0.6])]
    """

    def __init__(
        self,
        problem: Problem,
        fidelities: Sequence[Any] | None = None,
        *,
        compiler_options: Mapping[str, Any] | None = None,
    ):
        ladder: Sequence[dict[str, Any]] = [{}]
        if fidelities is not None:
            ladder = [{"fidelity": fidelity} for fidelity in fidelities]
        self._rungs = len(ladder)

        def at(chosen):
            def everything(z, *data):
                objectives, margins, status = _check.sequence(
                    "problem(z)", problem(z, *data, **chosen), _RETURNED, 3
                )
                numbers = (jnp.atleast_1d(objectives), jnp.atleast_1d(margins))
                return numbers, (numbers, _counted(status))

            return jax.jacfwd(everything, has_aux=True)

        options = None if compiler_options is None else dict(compiler_options)
        self._each = [jax.jit(at(chosen), compiler_options=options) for chosen in ladder]
        self._many = _of_each(at(ladder[0]))

    def __call__(
        self, point: Vector, *data: Any, least: np.ndarray | None = None
    ) -> Numbers:
        """The numbers at a point, from the rung `least` (1,) on, by default the first."""
        first = 0 if least is None else int(least[0])
        found = _hosted(self._each[first](jnp.asarray(point), *data))
        return self._settled(found, point, data, first, first)

    def trace(self, point: Vector, *data: Any) -> None:
        """Trace and lower the program for points and data like these, so that a later call only
        compiles it. Programs are traced one at a time, but several can compile at once."""
        self._each[0].lower(jnp.asarray(point), *data)

    def many(
        self, points: np.ndarray, *data: Any, least: Sequence[np.ndarray | None] | None = None
    ) -> list[Numbers]:
        """The numbers at several points (w, n), in one call; every leaf of the data has a first
        axis of length w. Another w compiles again. `least`: the first rung of each point."""
        together = _hosted(self._many(jnp.asarray(points), *data))
        settled = []
        for i, one in enumerate(least or [None] * len(points)):
            first = 0 if one is None else int(one[0])
            own = jax.tree.map(lambda leaf, i=i: leaf[i], data)
            objectives, margins, by_objective, by_margin, counts = (part[i] for part in together)
            found = (objectives, margins, by_objective, by_margin, counts)
            settled.append(self._settled(found, points[i], own, 0, first))
        return settled

    def _settled(
        self, found: _Five, point: Vector, data: tuple[Any, ...], rung: int, least: int
    ) -> Numbers:
        """The numbers of the first rung, from `least` on, that are not in doubt; `found` are those
        of `rung`."""

        def compute(rung):
            return _hosted(self._each[rung](jnp.asarray(point), *data))

        def doubted(found):
            return bool(np.any(found[4][_DOUBTS]))

        found, rung = climb(compute, doubted, self._rungs, found, rung=rung, least=least)
        return Numbers(*found, np.array([rung]))


class LaneProgram:
    """A problem over many lanes (parcels, impacts) with its Jacobian, each lane at the fidelity
    that it needs.

    It is the composition of two functions:

    - `read`: z (n,), lanes, fidelity -> numbers (a pytree) and statuses, each leaf with the lanes
      as its first axis: the results of a simulation of every lane;
    - `combine`: z, numbers, statuses, lanes, further data -> objectives (k,), margins (m,).

    Only the lanes with a numerical status are computed again at the next of the `fidelities`
    (`refined`). The chain rule composes their derivatives with those of `combine`. As a `Program`
    it is called with a point and the data. The first of the data are the lanes: a pytree whose
    leaves have the lanes as their first axis.

    With `ahead` the first call compiles the programs of the finer fidelities, too, for lanes one by
    one, in a thread beside that of the first fidelity. It pays off where most searches need them,
    as those over whole sorts do.

    >>> def read(z, masses, fidelity):
    ...     return masses * z, jnp.zeros(masses.shape, int)
    >>> program = fj.LaneProgram(read, lambda z, forces, *_: (forces, z - 0.5), (0,))
    >>> round(fj.minimize(program, [0.9], data=(jnp.array([1.0, 3.0]),)).objective, 3)
    1.5
    """

    def __init__(
        self,
        read: Callable[[Array, Any, Any], tuple[Any, Array]],
        combine: Callable[..., tuple[Array, Array]],
        fidelities: Sequence[Any],
        *,
        ahead: bool = False,
    ):
        self._rungs = len(fidelities)

        def at(fidelity):
            def values(z, lanes):
                numbers, statuses = read(z, lanes, fidelity)
                return numbers, (numbers, jnp.asarray(statuses, dtype=int))

            def both(z, lanes):
                rows, (numbers, statuses) = jax.jacfwd(values, has_aux=True)(z, lanes)
                return (numbers, rows), statuses

            return both

        self._each = [jax.jit(at(fidelity)) for fidelity in fidelities]
        self._many = _of_each(at(fidelities[0]))
        self._whole = _composed(combine)
        self._ahead = range(1, self._rungs if ahead else 1)
        self._coming: dict[int, Future[Any]] = {}

    def combining(self, combine: Callable[..., tuple[Array, Array]]) -> "LaneProgram":
        """A program with other objectives and margins of the same numbers, with the same compiled
        simulations."""
        other = copy.copy(self)
        other._whole = _composed(combine)
        return other

    def __call__(
        self, point: Vector, *data: Any, least: np.ndarray | None = None
    ) -> Numbers:
        """The numbers at a point, each lane from its rung `least` on, by default the first."""
        return self._settled(jnp.asarray(point), data, None, least)

    def many(
        self, points: np.ndarray, *data: Any, least: Sequence[np.ndarray | None] | None = None
    ) -> list[Numbers]:
        """As `Program.many`."""
        together = jax.device_get(self._many(jnp.asarray(points), data[0]))
        settled = []
        for i, one in enumerate(least or [None] * len(points)):
            own, known = jax.tree.map(lambda leaf, i=i: leaf[i], (data, together))
            settled.append(self._settled(jnp.asarray(points[i]), own, known, one))
        return settled

    def _settled(
        self, point: Array, data: tuple[Any, ...], known: Any, least: np.ndarray | None
    ) -> Numbers:
        """The numbers, each lane at its rung; `known`: those of the first rung, if computed."""
        if self._ahead and not self._coming:
            if known is None:
                # Programs are traced one at a time, and compiled in parallel: this one first.
                self._each[0].lower(point, data[0])
            # In place: programs with other objectives share them.
            self._coming.update(self._finer(point, data[0]))

        def compute(rung, lanes):
            if rung == 0 and known is not None:
                return known
            if rung in self._coming:
                self._coming[rung].result()
            return self._each[rung](point, lanes)

        (numbers, rows), statuses, rungs = refined(compute, data[0], self._rungs, least)
        found = _hosted(self._whole(point, numbers, rows, statuses, *data))
        return Numbers(*found, rungs)

    def _finer(self, point: Array, lanes: Any) -> dict[int, Future[Any]]:
        """Calls of the finer fidelities' programs for one lane, which compile them, in a thread."""
        one = jax.tree.map(lambda leaf: np.asarray(leaf)[:1], lanes)
        pool = ThreadPoolExecutor(max_workers=1)
        coming = {rung: pool.submit(self._each[rung], point, one) for rung in self._ahead}
        pool.shutdown(wait=False)
        return coming


def _composed(combine: Callable[..., tuple[Array, Array]]):
    """Objectives and margins with their Jacobian in z, from the lanes' numbers and Jacobians."""

    def whole(z, numbers, rows, statuses, lanes, *data):
        def of(z, numbers):
            pair = combine(z, numbers, statuses, lanes, *data)
            return tuple(jnp.atleast_1d(part) for part in pair)

        def along(unit, change):
            return jax.jvp(of, (z, numbers), (unit, change))[1]

        columns = jax.vmap(along, in_axes=(0, -1), out_axes=-1)
        slopes = columns(jnp.eye(z.size, dtype=z.dtype), rows)
        return slopes, (of(z, numbers), _counted(statuses))

    return jax.jit(whole, compiler_options=without_loops())


def _of_each(function):
    """The function mapped over a first axis of points and data."""

    def many(*arguments):
        return each_lane(lambda own: function(*own), arguments)

    return jax.jit(many)


def _counted(status) -> Array:
    """How often each status occurs."""
    codes = jnp.ravel(jnp.asarray(status, dtype=int))
    return jnp.sum(codes[:, None] == jnp.arange(len(Status))[None], axis=0)


def _hosted(found) -> _Five:
    rows, (numbers, counts) = jax.device_get(found)
    objectives, margins, by_objective, by_margin = (
        np.asarray(part, dtype=float) for part in (*numbers, *rows)
    )
    return objectives, margins, by_objective, by_margin, np.asarray(counts)
