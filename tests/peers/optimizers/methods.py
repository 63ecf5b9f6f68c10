"""The methods: what each of them does with a task, from a start, on a ledger.

The package's own see the worst case and the limits as they are, by its SQP and by optax' Adam on
its augmented Lagrangian. So does SciPy's SLSQP, given
the largest force as an extra unknown t with t >= F_i. The others see one number,

    worst case + rho * sum of violations          (`exact`), or
    worst case + rho * sum of squared violations  (`squares`, with rho raised from 10 to 1e5),

and those without derivatives the first of the two. Every one works within the bounds of the
shares. A method with several settings is run with all of them, and the best one counts.

Numbers that a simulation itself calls unreliable count for no design. SLSQP, which has no notion of
them, is run as if they were good, and (`walled`) with a wall there, as L-BFGS-B always is.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import optax
from scipy import optimize

from fencejax.design import minimize

from .ledger import Ledger, SpentError
from .tasks import Task

Method = Callable[[Task, Ledger, np.ndarray, int], None]


def _ours(method: str | optax.GradientTransformation) -> Method:
    def run(task, ledger, start, seed):
        minimize(
            task.slopes,
            start,
            method=method,
            tolerance=1e-4,
            feasibility=1e-4,
            budget=max(1, int(ledger.budget / task.price)),
            progress=lambda r: ledger.add(task.price, r.objective, r.violation),
        )

    return run


def _penalised(ledger: Ledger, share, rho: float, power: int):
    """Merit and gradient in the shares."""
    found = ledger.rows(share)
    top, missing = int(np.argmax(found.objectives)), np.maximum(-found.margins, 0.0)
    # A wall of ten times the first force, at which a line search turns round.
    wall = 10.0 * ledger.task.failed(found)
    value = found.objectives[top] + rho * np.sum(missing**power) + wall
    pull = rho * power * missing ** (power - 1) * (missing > 0)
    return float(value), found.objective_rows[top] - found.margin_rows.T @ pull


def _adam(rate: float, rho: float) -> Method:
    def run(task, ledger, start, seed):
        adam = optax.adam(rate)
        z = jnp.asarray(start)
        with jax.numpy_dtype_promotion("standard"):
            state, update = adam.init(z), jax.jit(adam.update)
            while True:
                _, slope = _penalised(ledger, np.asarray(z), rho, 1)
                step, state = update(jnp.asarray(slope), state)
                z = jnp.clip(z + step, 0.0, 1.0)

    return run


def _lbfgsb(power: int) -> Method:
    def run(task, ledger, start, seed):
        at = start
        for rho in (1.0, 10.0, 100.0) if power == 1 else (10.0, 1e2, 1e3, 1e4, 1e5):
            at = optimize.minimize(
                lambda s, rho=rho: _penalised(ledger, s, rho, power),
                at,
                jac=True,
                method="L-BFGS-B",
                bounds=[(0.0, 1.0)] * task.size,
                options=dict(maxiter=1000, ftol=1e-10, gtol=1e-8),
            ).x

    return run


def _slsqp(walled: bool) -> Method:
    def run(task, ledger, start, seed):
        first = ledger.rows(start)
        unit = np.append(np.zeros(task.size), 1.0)

        def limit_margins(x):
            found = ledger.rows(x[:-1])
            # A wall of ten times the first force, at which a line search turns round.
            wall = 10.0 * (walled and task.failed(found))
            return np.concatenate([x[-1] - found.objectives - wall, found.margins])

        def slopes(x):
            found = ledger.rows(x[:-1])
            forces = np.hstack([-found.objective_rows, np.ones((found.objectives.size, 1))])
            limits = np.hstack([found.margin_rows, np.zeros((found.margins.size, 1))])
            return np.vstack([forces, limits])

        at = np.append(start, np.max(first.objectives))
        # It often ends where it is not done: once more from there, as long as that helps.
        for _ in range(5):
            found = optimize.minimize(
                lambda x: x[-1],
                at,
                jac=lambda x: unit,
                method="SLSQP",
                bounds=[(0.0, 1.0)] * task.size + [(0.0, 10.0)],
                constraints=dict(type="ineq", fun=limit_margins, jac=slopes),
                options=dict(maxiter=500, ftol=1e-8),
            )
            if np.max(np.abs(found.x - at)) < 1e-6:
                return
            at = found.x

    return run


def _plain(ledger: Ledger, share, rho: float = 10.0) -> float:
    worst, margins = ledger.value(np.clip(share, 0.0, 1.0))
    return worst + rho * float(np.sum(np.maximum(-margins, 0.0)))


def _nelder_mead(task, ledger, start, seed):
    at, bounds = start, [(0.0, 1.0)] * task.size
    known = -1
    # A simplex of a tenth of the range; a new one when it has shrunk to nothing, while that helps.
    while ledger.points > known:
        known = ledger.points
        moved = np.vstack([at, at + 0.1 * np.where(at > 0.5, -1, 1) * np.eye(task.size)])
        at = optimize.minimize(
            lambda s: _plain(ledger, s),
            at,
            method="Nelder-Mead",
            bounds=bounds,
            options=dict(
                adaptive=True, initial_simplex=moved, maxfev=10**6, maxiter=10**6, xatol=1e-6,
                fatol=1e-7,
            ),
        ).x  # fmt: skip


def _evolution(size: int) -> Method:
    def run(task, ledger, start, seed):
        optimize.differential_evolution(
            lambda s: _plain(ledger, s),
            [(0.0, 1.0)] * task.size,
            x0=start,
            popsize=size,
            maxiter=10**6,
            tol=0.0,
            polish=False,
            rng=seed,
        )

    return run


METHODS: dict[str, dict[str, Method]] = {
    "SQP (fencejax)": {"": _ours("sqp")},
    "Adam, augmented Lagrangian (fencejax)": {
        f"rate {rate}": _ours(optax.adam(rate)) for rate in (0.005, 0.025)
    },
    "SLSQP (SciPy)": {"": _slsqp(False), "walled": _slsqp(True)},
    "L-BFGS-B, penalties (SciPy)": {"exact": _lbfgsb(1), "squares": _lbfgsb(2)},
    "Adam, penalties (optax)": {
        f"rate {rate}, rho {rho}": _adam(rate, rho) for rate, rho in ((0.005, 3.0), (0.025, 3.0))
    },
    "differential evolution (SciPy)": {f"{n} n members": _evolution(n) for n in (3,)},
    "Nelder-Mead, penalties (SciPy)": {"": _nelder_mead},
}
OURS = "SQP (fencejax)"
WITHOUT = ("differential evolution (SciPy)", "Nelder-Mead, penalties (SciPy)")
"""The method that all are measured by, and those without derivatives."""


def run(method: Method, task: Task, start: np.ndarray, seed: int, budget: float) -> Ledger:
    """A run to the end of the method or of the budget [simulation-equivalents]."""
    ledger = Ledger(task, budget)
    try:
        method(task, ledger, start, seed)
    except SpentError:
        pass
    return ledger
