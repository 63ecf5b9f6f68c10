"""The optimiser on problems with known optima and multipliers, and its algebra."""

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

from fencejax.design import (
    Evaluation,
    Multipliers,
    Program,
    Stop,
    augmented,
    minimize,
    onto_simplex,
)

_METHODS = {
    "sqp": "sqp",
    "adam": optax.adam(optax.cosine_decay_schedule(0.05, 300)),
    "lbfgs": optax.lbfgs(0.1, linesearch=None),
    "momentum": optax.sgd(0.02, momentum=0.5),
}


def _circle(z):
    # min x^2 + y^2, x + y >= 1: (1/2, 1/2), multiplier 1.
    return z @ z, z[0] + z[1] - 1, 0


def _banana(z):
    # Rosenbrock's function in the disc x^2 + y^2 <= 3/2: the optimum and the multiplier follow
    # from the conditions, solved by Newton to 1e-12.
    return 100 * (z[1] - z[0] ** 2) ** 2 + (1 - z[0]) ** 2, 1.5 - z @ z, 0


def _worst_of_three(z):
    # Charalambous and Conn's CB2: max of three, 1.9522245 at (1.1390377, 0.8995600).
    x, y = z
    three = jnp.stack([x**2 + y**4, (2 - x) ** 2 + (2 - y) ** 2, 2 * jnp.exp(y - x)])
    return three, jnp.zeros(0), 0


def _impossible(z):
    return z @ z, jnp.stack([z[0] - 1, -z[0] - 1]), 0


def test_linear_limit():
    settings = dict(scale=1.0, bounded=False, tolerance=1e-5, feasibility=1e-6)
    found = minimize(_circle, [2.0, 0.0], **settings)
    assert found.converged
    assert found.feasible
    # The error of the optimum is of the order of the tolerances.
    np.testing.assert_allclose(found.point, [0.5, 0.5], atol=1e-5)
    np.testing.assert_allclose(found.multipliers, [1.0], atol=3e-5)
    assert found.objective == pytest.approx(0.5, abs=1e-5)
    assert len(found.history) <= 40
    assert found.history[-1].kkt <= 1e-5


def test_curved_limit():
    def conditions(u):
        z, multiplier = u[:2], u[2]
        slope = jax.grad(lambda z: _banana(z)[0] - multiplier * _banana(z)[1])(z)
        return jnp.append(slope, _banana(z)[1])

    exact = jnp.array([0.9, 0.8, 0.04])
    for _ in range(20):
        exact = exact - jnp.linalg.solve(jax.jacfwd(conditions)(exact), conditions(exact))
    settings = dict(scale=1.0, bounded=False, tolerance=1e-5, feasibility=1e-6)
    found = minimize(_banana, [-1.0, 1.0], **settings)
    assert found.converged
    np.testing.assert_allclose(found.point, exact[:2], atol=1e-4)
    np.testing.assert_allclose(found.multipliers, exact[2:], rtol=2e-3)


def test_worst_case_is_exact():
    found = minimize(_worst_of_three, [1.0, -0.1], scale=1.0, bounded=False, tolerance=1e-5)
    assert found.converged
    assert found.objective == pytest.approx(1.9522245, abs=2e-5)
    np.testing.assert_allclose(found.point, [1.1390377, 0.8995600], atol=2e-4)
    # The gradients of the two active ones balance: w_1 (2x, 4y^3) = w_2 (2 (2 - x), 2 (2 - y)).
    x, y = 1.1390377, 0.8995600
    share = 2 * x / (2 * (2 - x))
    np.testing.assert_allclose(found.weights, [1 / (1 + share), share / (1 + share), 0], atol=1e-3)
    assert share == pytest.approx(4 * y**3 / (2 * (2 - y)), rel=1e-5)


def test_scale_changes_the_multipliers_only():
    plain = minimize(_circle, [2.0, 0.0], scale=1.0, bounded=False, tolerance=1e-5)
    scaled = minimize(_circle, [2.0, 0.0], bounded=False, tolerance=1e-5)
    assert scaled.scale == pytest.approx(4.0)
    np.testing.assert_allclose(scaled.point, plain.point, atol=1e-4)
    np.testing.assert_allclose(4 * scaled.multipliers, plain.multipliers, atol=1e-3)


def test_bound_is_an_optimum():
    def falling(share):
        return -share[0] + (share[1] - 0.3) ** 2, jnp.ones(1), 0

    for method in _METHODS.values():
        found = minimize(falling, [0.7, 0.6], scale=1.0, method=method, budget=400)
        assert found.converged
        assert found.point[0] == pytest.approx(1.0, abs=1e-3)
        assert found.point[1] == pytest.approx(0.3, abs=1e-3)
        assert all(0 <= np.min(r.point) <= np.max(r.point) <= 1 for r in found.history)


@pytest.mark.parametrize("method", ["sqp", "momentum"])
def test_no_feasible_design(method):
    found = minimize(
        _impossible, [3.0, 1.0], scale=1.0, bounded=False, method=_METHODS[method], budget=300
    )
    assert found.stop is Stop.INFEASIBLE
    assert not found.converged
    assert not found.feasible
    # x >= 1 and x <= -1: the least largest violation is 1, at x = 0.
    assert found.residual.violation == pytest.approx(1.0, abs=1e-2)
    assert min(record.violation for record in found.history) == found.residual.violation


def test_infeasible_start_is_no_obstacle():
    found = minimize(_circle, [-3.0, -1.0], scale=1.0, bounded=False)
    assert found.converged
    np.testing.assert_allclose(found.point, [0.5, 0.5], atol=1e-3)


@pytest.mark.parametrize("problem", [Program(_banana), Program(_impossible)])
@pytest.mark.parametrize("method", _METHODS)
def test_budget_is_kept(method, problem):
    found = minimize(
        problem, [-1.0, 1.5], scale=1.0, bounded=False, method=_METHODS[method], budget=3
    )
    assert found.stop is Stop.BUDGET
    assert not found.converged
    assert len(found.history) == 3
    assert found.feasible == (found.residual.violation <= 1e-4)


@pytest.mark.parametrize("method", _METHODS)
def test_any_optimiser_of_optax_finds_the_optimum(method):
    found = minimize(
        _circle, [1.0, 0.3], scale=1.0, bounded=False, method=_METHODS[method], budget=400
    )
    assert found.converged
    # The tolerance is 1e-3, of slopes that grow with 2 |z|.
    np.testing.assert_allclose(found.point, [0.5, 0.5], atol=1e-3)
    np.testing.assert_allclose(found.multipliers, [1.0], atol=1e-2)


def test_transformation_that_asks_for_a_function_is_refused():
    with pytest.raises(ValueError, match="gradient and the value alone"):
        minimize(_circle, [1.0, 1.0], bounded=False, method=optax.lbfgs())


def test_a_point_that_comes_again_with_other_multipliers_is_no_circle():
    """L-BFGS without a line search goes from bound to bound until the multiplier is right; the
    least z_0 + 0.5 z_1 with z_0 + z_1 >= 1 is at (0, 1)."""
    found = minimize(
        lambda z: (z[0] + 0.5 * z[1] + 1, jnp.atleast_1d(z[0] + z[1] - 1), 0), [0.5, 0.6],
        method=optax.lbfgs(linesearch=None), budget=300,
    )
    assert len(found.history) > 5
    assert found.stop is not Stop.STAGNATED
    np.testing.assert_allclose(found.point, [0.0, 1.0], atol=1e-2)


def test_points_that_come_again_end_the_run():
    # Steps that go there and back: the fourth point is the second again, with its multipliers.
    def turning(updates, state, params=None, **extra):
        return jax.tree.map(lambda g: state * jnp.ones_like(g), updates), -state

    there_and_back = optax.GradientTransformation(lambda params: jnp.asarray(0.25), turning)
    found = minimize(
        lambda z: (z @ z + 1, jnp.ones(1), 0), [0.25, 0.5], method=there_and_back, budget=50
    )
    assert len(found.history) == 3
    assert found.stop is Stop.STAGNATED
    np.testing.assert_allclose(found.point, [0.25, 0.5])


def test_failed_evaluations_shorten_the_step_and_are_recorded():
    # ln x with a wall at 0: the first steps towards the optimum x = 1/10 go past it.
    def walled(z):
        x = z[0]
        return -jnp.log(x) + 10 * x, jnp.ones(1), jnp.where(x < 0.05, 6, 0)

    seen = []
    found = minimize(walled, [0.2], scale=1.0, bounded=False, progress=seen.append)
    assert found.converged
    assert found.point[0] == pytest.approx(0.1, abs=1e-3)
    failed = [record for record in found.history if record.failed]
    assert failed
    assert all(record.point[0] < 0.05 and record.violation == np.inf for record in failed)
    assert [record.evaluation for record in seen] == [r.evaluation for r in found.history]


def test_failed_start_is_reported():
    found = minimize(lambda z: (jnp.log(z[0]), jnp.ones(1), 0), [-1.0], bounded=False)
    assert found.stop is Stop.FAILED_START
    assert not found.feasible
    assert len(found.history) == 1


def test_gradient_of_the_augmented_lagrangian():
    # Against central differences of its value, with objectives and margins active and not.
    rng = np.random.default_rng(0)
    rows, more = rng.normal(size=(3, 2)), rng.normal(size=(4, 2))
    multipliers = Multipliers(np.array([0.2, 0.5, 0.3]), np.array([0.4, 0.0, 0.1, 0.3]))

    def at(z):
        objectives = rows @ z + np.array([0.1, 0.0, -0.05]) + z @ z
        bent = rows + 2 * z
        return Evaluation(z, objectives, more @ z + 0.05, bent, more, 0, False)

    z, step = np.array([0.1, -0.2]), 1e-6
    _, gradient = augmented(at(z), multipliers, 4.0)
    for axis, unit in enumerate(np.eye(2)):
        ahead, behind = (augmented(at(z + s * step * unit), multipliers, 4.0)[0] for s in (1, -1))
        # Round-off 1e-16 / 1e-6 and the next order 1e-12.
        assert gradient[axis] == pytest.approx((ahead - behind) / (2 * step), abs=1e-8)


def test_projection_onto_the_simplex():
    point = np.array([0.9, 0.6, -0.4, 0.55])
    nearest = onto_simplex(point)
    assert nearest.sum() == pytest.approx(1.0, abs=1e-15)
    assert nearest.min() >= 0
    # Nearest: what was taken away is the same for all that stay above 0, and no less elsewhere.
    taken = point - nearest
    kept = nearest > 0
    assert np.ptp(taken[kept]) < 1e-15
    assert np.all(taken[~kept] <= taken[kept].max())


@pytest.mark.parametrize(
    ("settings", "error", "message"),
    [
        (dict(method="newton"), ValueError, "`method` must be \"sqp\" or an optax"),
        (dict(start=[0.5, 1.5]), ValueError, "`start` must hold shares in"),
        (dict(tolerance=0.0), ValueError, "`tolerance`"),
        (dict(budget=0), ValueError, "`budget`"),
        (dict(scale=-1.0), ValueError, "`scale`"),
    ],
)
def test_refusals(settings, error, message):
    with pytest.raises(error, match=message):
        minimize(**{"problem": _circle, "start": [1.0, 1.0], **settings})


def test_a_bound_is_met_exactly():
    """A design next to a step by rounding alone does not count."""

    def problem(z):
        return (z[0] + 0.1) ** 2 - z[1] + (z[2] - 0.5) ** 2, jnp.ones(1), 0

    optimum = minimize(problem, [0.3, 0.7, 0.6])
    assert optimum.converged
    assert optimum.point[0] == 0.0
    assert optimum.point[1] == 1.0
    # The tolerance is 1e-3, of slopes that grow with 2 |z - 0.5|.
    assert optimum.point[2] == pytest.approx(0.5, abs=1e-3)
