"""The methods on the collection's problems, each with first derivatives alone.

The package's own sees a worst case as such; the others have t as a further variable, min t with t
>= F_i(x), and start with the least t that is allowed. All are set to go on far beyond what is asked
for. A point that is evaluated counts once, whatever is asked of it.
"""

import dataclasses
import time
import warnings
from collections.abc import Callable

import numpy as np
from scipy import optimize

from fencejax.design import Numbers as DesignNumbers, Program, minimize
from fencejax.results import Status

from .collection import Known, Numbers

# The tolerance set for a method, far beyond what is asked for.
_END = 1e-12
# Processor time of a run at most [s]: trust-constr needs minutes for a thousand constraints, and
# MMA may go on without evaluating anything.
_SECONDS = 2.0


class SpentError(Exception):
    """The budget is spent."""


@dataclasses.dataclass
class Count:
    """Evaluates a problem, counts its distinct points, and stops at the budget.

    `trail` holds the worst case and the largest violation of every point.
    """

    known: Known
    budget: int
    trail: list[tuple[float, float]] = dataclasses.field(default_factory=list)
    _found: dict[bytes, Numbers] = dataclasses.field(default_factory=dict)
    _last: float = dataclasses.field(default_factory=lambda: time.process_time() + _SECONDS)

    def __call__(self, x: np.ndarray) -> Numbers:
        x = np.array(x, dtype=float)
        key = x.tobytes()
        if key not in self._found:
            if len(self.trail) >= self.budget or time.process_time() > self._last:
                raise SpentError
            found = self._found[key] = self.known.numbers(x)
            outside = np.concatenate([-found.limits, self.known.lower - x, x - self.known.upper])
            self.trail.append((float(np.max(found.objectives)), float(np.max(outside, initial=0))))
        return self._found[key]

    def solved_after(self, optimum: float, within: float) -> float:
        """The number of evaluations after which a point was known whose value and violation are
        off by at most `within`, relative to values above 1; infinite where none is."""
        highest = optimum + within * max(1.0, abs(optimum))
        there = [value <= highest and missing <= within for value, missing in self.trail]
        return 1.0 + there.index(True) if any(there) else np.inf


Method = Callable[[Count], None]
"""Runs until it ends or the budget does."""


class _Counted(Program):
    """The problem as `minimize` takes it: in shares of the bounds where all are finite, otherwise
    free with the bounds as limits."""

    def __init__(self, count: Count):
        known = count.known
        self.bounded = bool(np.all(np.isfinite(known.upper - known.lower)))
        size = known.start.size
        self._count = count
        self._base = known.lower if self.bounded else np.zeros(size)
        self._span = known.upper - known.lower if self.bounded else np.ones(size)
        low = np.isfinite(known.lower) & (not self.bounded)
        high = np.isfinite(known.upper) & (not self.bounded)
        self._sides = np.vstack([np.eye(size)[low], -np.eye(size)[high]])
        self._ends = np.concatenate([known.lower[low], -known.upper[high]])
        self.start = (known.start - self._base) / self._span

    def __call__(self, point, *data, least=None) -> DesignNumbers:
        x = self._base + self._span * point
        found = self._count(x)
        return DesignNumbers(
            found.objectives,
            np.concatenate([found.limits, self._sides @ x - self._ends]),
            found.objective_rows * self._span,
            np.vstack([found.limit_rows, self._sides]) * self._span,
            np.zeros(len(Status), dtype=int),
            np.zeros(1, dtype=int),
        )


def _ours(count: Count) -> None:
    program = _Counted(count)
    minimize(
        program, program.start, bounded=program.bounded, tolerance=1e-10, feasibility=1e-9,
        budget=count.budget,
    )  # fmt: skip


class _Epigraph:
    """min t with t >= F_i(x) and c(x) >= 0 in (x, t), for methods that know of no worst case; of
    one objective it is min F(x)."""

    def __init__(self, count: Count):
        known = count.known
        self._count, self.raised = count, known.top is not None
        top = [float(np.max(count(known.start).objectives))] if self.raised else []
        edge = [np.inf] if self.raised else []
        self.start = np.concatenate([known.start, top])
        self.lower = np.concatenate([known.lower, np.negative(edge)])
        self.upper = np.concatenate([known.upper, edge])
        self.limits = self.limit_values(self.start).size

    def _at(self, x: np.ndarray) -> Numbers:
        return self._count(x[:-1] if self.raised else x)

    def value(self, x: np.ndarray) -> float:
        return float(x[-1]) if self.raised else float(self._at(x).objectives[0])

    def slope(self, x: np.ndarray) -> np.ndarray:
        if self.raised:
            return np.append(np.zeros(x.size - 1), 1.0)
        return self._at(x).objective_rows[0].copy()

    def limit_values(self, x: np.ndarray) -> np.ndarray:
        found = self._at(x)
        above = x[-1] - found.objectives if self.raised else np.zeros(0)
        return np.concatenate([above, found.limits])

    def limit_slopes(self, x: np.ndarray) -> np.ndarray:
        found = self._at(x)
        if not self.raised:
            return found.limit_rows.copy()
        one, none = np.ones((len(found.objectives), 1)), np.zeros((len(found.limits), 1))
        return np.block([[-found.objective_rows, one], [found.limit_rows, none]])


def _scipy_slsqp(count: Count) -> None:
    task = _Epigraph(count)
    at = task.start
    # It may end where it is not done: again from there, as long as that moves it.
    for _ in range(10):
        found = optimize.minimize(
            task.value, at, jac=task.slope, method="SLSQP",
            bounds=optimize.Bounds(task.lower, task.upper),
            constraints=dict(type="ineq", fun=task.limit_values, jac=task.limit_slopes),
            options=dict(maxiter=count.budget, ftol=_END),
        )  # fmt: skip
        if not np.all(np.isfinite(found.x)) or np.max(np.abs(found.x - at)) < 1e-9:
            return
        at = found.x


def _trust_constr(count: Count) -> None:
    task = _Epigraph(count)
    limits = optimize.NonlinearConstraint(
        task.limit_values, 0.0, np.inf, jac=task.limit_slopes, hess=optimize.BFGS()
    )
    # A line has no curvature for BFGS to find.
    linear = dict(hess=lambda x: np.zeros((x.size, x.size))) if task.raised else {}
    optimize.minimize(
        task.value, task.start, jac=task.slope, method="trust-constr",
        bounds=optimize.Bounds(task.lower, task.upper), constraints=[limits],
        options=dict(maxiter=count.budget, gtol=1e-10, xtol=_END, barrier_tol=1e-10), **linear,
    )  # fmt: skip


def _ipopt(count: Count) -> None:
    import cyipopt

    task = _Epigraph(count)

    class Callbacks:
        objective = staticmethod(task.value)
        gradient = staticmethod(task.slope)
        constraints = staticmethod(task.limit_values)

        @staticmethod
        def jacobian(x):
            return task.limit_slopes(x).ravel()

        @staticmethod
        def intermediate(*_):
            return len(count.trail) < count.budget

    solver = cyipopt.Problem(
        task.start.size, task.limits, Callbacks(), task.lower, task.upper,
        np.zeros(task.limits), np.full(task.limits, np.inf),
    )  # fmt: skip
    for name, value in dict(
        print_level=0, sb="yes", hessian_approximation="limited-memory", tol=1e-10,
        acceptable_iter=0, max_iter=count.budget, bound_relax_factor=0.0,
    ).items():  # fmt: skip
        solver.add_option(name, value)
    solver.solve(task.start)


def _nlopt(algorithm: str) -> Method:
    def run(count: Count) -> None:
        import nlopt

        task = _Epigraph(count)

        def value(x, slope):
            if slope.size:
                slope[:] = task.slope(x)
            return task.value(x)

        def missing(found, x, rows):
            if rows.size:
                rows[:] = -task.limit_slopes(x)
            found[:] = -task.limit_values(x)

        solver = nlopt.opt(getattr(nlopt, algorithm), task.start.size)
        solver.set_min_objective(value)
        solver.add_inequality_mconstraint(missing, np.full(task.limits, 1e-9))
        solver.set_lower_bounds(task.lower)
        solver.set_upper_bounds(task.upper)
        solver.set_xtol_rel(_END)
        solver.set_maxeval(10 * count.budget)
        solver.set_maxtime(_SECONDS)
        solver.optimize(task.start)

    return run


METHODS: dict[str, Method] = {
    "SQP (fencejax)": _ours,
    "SLSQP (SciPy)": _scipy_slsqp,
    "trust-constr (SciPy)": _trust_constr,
    "IPOPT (cyipopt)": _ipopt,
    "SLSQP (NLopt)": _nlopt("LD_SLSQP"),
    "MMA (NLopt)": _nlopt("LD_MMA"),
    "CCSA (NLopt)": _nlopt("LD_CCSAQ"),
}
OURS = "SQP (fencejax)"


def run(name: str, known: Known, budget: int) -> Count:
    """A method's run on a problem, to its own end or the budget's. What it makes of numbers that
    are not finite is its own affair."""
    count = Count(known, budget)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            METHODS[name](count)
        except SpentError:
            pass
        except Exception:
            # A method that gives up, in whatever way, has found what it has found.
            if name == OURS:
                raise
    return count
