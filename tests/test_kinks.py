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
    found = minimize(_valley, start, method="sqp", scale=1.0, tolerance=1e-4, budget=150)
    # Steps that know one side of the kink alone end between 0.4 and 4.6. What the tolerance on a
    # step's gain leaves along a valley of length 2 is some hundredths: |1 - x| < 0.25.
    assert found.objective < 0.25**2
    np.testing.assert_allclose(found.point, [1, 1], atol=0.5)


def test_limit_with_a_kink():
    found = minimize(
        _limited, [0.0, 0.5], method="sqp", scale=1.0, tolerance=1e-4, feasibility=1e-6
    )
    assert found.feasible
    assert found.objective == pytest.approx(-3.0, abs=1e-3)
