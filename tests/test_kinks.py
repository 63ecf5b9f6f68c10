"""Steps over kinks: one number that is the largest of several, which it does not tell apart."""

import jax.numpy as jnp
import numpy as np
import pytest

from fencejax.optimizer import minimize


def _valley(z):
    # 10 |y - x^2| + (1 - x)^2: the smallest, 0, at (1, 1), along a kinked, bent valley.
    return 10 * jnp.abs(z[1] - z[0] ** 2) + (1 - z[0]) ** 2, jnp.zeros(0), 0


def _limited(z):
    # x + y under 1 - |x - y| - (x + y + 1)^2 / 4 >= 0: the smallest, -3, at (-3/2, -3/2), on the
    # kink of the limit.
    margin = 1 - jnp.abs(z[0] - z[1]) - (z[0] + z[1] + 1) ** 2 / 4
    return z[0] + z[1], jnp.atleast_1d(margin), 0


@pytest.mark.parametrize("start", [[-1.0, 1.5], [2.0, -1.0], [0.0, 0.3]])
def test_kinked_valley_is_followed_to_its_end(start):
    found = minimize(_valley, start, method="sqp", scale=1.0, tolerance=1e-4, budget=250)
    # Steps that know one side of the kink alone end between 0.4 and 4.6. Along the valley a step's
    # gain falls below the tolerance where |1 - x| is some hundredths.
    assert found.objective < 0.03**2
    np.testing.assert_allclose(found.point, [1, 1], atol=0.1)


def test_limit_with_a_kink():
    found = minimize(
        _limited, [0.0, 0.5], method="sqp", scale=1.0, tolerance=1e-4, feasibility=1e-6
    )
    assert found.feasible
    # On the kink no side's slope balances; both together do.
    assert found.converged
    assert max(found.residual[:2]) <= 1e-4
    assert found.objective == pytest.approx(-3.0, abs=1e-4)


@pytest.mark.parametrize("start", [[1.0, -0.1], [3.0, 2.0], [-1.0, 2.0]])
def test_largest_of_three_as_one_number(start):
    # Charalambous and Conn's CB2, 1.9522245 (see test_optimizer), which of the three unknown.
    def hidden(z):
        x, y = z
        rows = jnp.stack([x**2 + y**4, (2 - x) ** 2 + (2 - y) ** 2, 2 * jnp.exp(y - x)])
        return jnp.max(rows), jnp.zeros(0), 0

    found = minimize(hidden, start, method="sqp", scale=1.0, tolerance=1e-3)
    assert found.converged
    assert found.objective == pytest.approx(1.9522245, abs=1e-3)
    np.testing.assert_allclose(found.weights, [1.0])


def test_wall_does_not_end_the_run_at_once():
    # x^2 + y^2 where x + y < 1 cannot be evaluated: 1/2 at (1/2, 1/2), on the wall. Steps that are
    # only shortened end where they first meet the wall, at 1.
    def walled(z):
        return z @ z, jnp.ones(1), jnp.where(z[0] + z[1] < 1, 6, 0)

    for start in ([2.0, 1.0], [1.0, 4.0]):
        found = minimize(walled, start, method="sqp", scale=1.0)
        assert not found.converged
        assert found.objective < 0.7
