"""Whether a Hessian holds over a distance."""

import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj


def test_of_a_cubic_it_is_the_third_derivative():
    # Over a reach r the central difference of the slope is off by r^2 f'''' / 6 = 4 r^2, in a
    # quartic x^4, beside a curvature of 12 x^2.
    found = fj.curvature(lambda x: x[0] ** 4 + x[0] * x[1], [1.0, 2.0], [0.2, 0.1])
    np.testing.assert_allclose(found.hessian, [[12, 1], [1, 0]], atol=1e-12)
    assert found.unsteadiness[0] == pytest.approx(4 * 0.2**2 / 12, rel=1e-9)
    assert found.unsteadiness[1] == pytest.approx(0.0, abs=1e-9)
    assert np.all(found.holds)


@pytest.mark.parametrize("place", [-0.09, 0.001, 0.09])
def test_a_kink_within_reach_is_found(place):
    # The slope jumps by 2 somewhere between -0.1 and 0.1: by 10 a unit, where the Hessian says 0.
    found = fj.curvature(
        lambda x: x[0] ** 2 / 2 + jnp.maximum(x[1] - place, place - x[1]), np.zeros(2), 0.1
    )
    assert found.unsteadiness == pytest.approx([0.0, 10.0])
    np.testing.assert_array_equal(found.holds, [True, False])
    assert "does not hold" in repr(found)
    further = fj.curvature(
        lambda x: x[0] ** 2 / 2 + jnp.abs(x[1] - place), np.zeros(2), abs(place) / 2
    )
    assert np.all(further.holds)


def test_a_straight_function_has_a_curvature_of_none():
    found = fj.curvature(lambda x: 1e3 * x[0] - 3 * x[1], [0.3, 0.1], 0.01)
    assert np.all(found.holds)


def test_what_cannot_be_is_refused():
    with pytest.raises(ValueError, match="`reach` must be above 0"):
        fj.curvature(jnp.sum, [1.0], 0.0)
    with pytest.raises(ValueError, match="`reach` must be one number or one each"):
        fj.curvature(jnp.sum, [1.0, 2.0], [1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="`function` must be finite"):
        fj.curvature(lambda x: jnp.sqrt(x[0]), [0.0], 0.1)


def test_a_kinked_limit_says_so():
    # Broken where w > 3, and less beyond v = 0.3: no curvature, but a kink near the point (0, 3).
    scatter = {"v": lambda u: u, "w": lambda u: u}
    kinked = fj.failure_probability(
        lambda p: 3 + jnp.maximum(0, 2 * (p["v"] - 0.3)) - p["w"], scatter
    )
    assert not kinked.holds
    assert "a kink is near" in str(kinked)
    smooth = fj.failure_probability(lambda p: 3 + 0.05 * p["v"] ** 2 - p["w"], scatter)
    assert smooth.holds
    assert "kink" not in str(smooth)
