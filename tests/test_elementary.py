"""Cosine, sine and arc tangent as arithmetic, compared with the C library's."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import erf

from fencejax._elementary import arctan, cos_sin, gaussian_mean

# Two units in the last place: half of one by rounding the polynomial's value, as much by the rest
# of the angle, and what the product with the polynomial adds.
ULPS = 2


def off(found, true):
    """The largest error in units of the last place of the true value."""
    return np.max(np.abs(np.asarray(found) - true) / np.spacing(np.abs(true)))


@pytest.mark.parametrize("largest", [0.5, 3.0, 100.0, 1e5])
def test_cosine_and_sine_to_the_last_places(largest):
    angle = np.random.default_rng(0).uniform(-largest, largest, 100_000)
    cosine, sine = cos_sin(jnp.asarray(angle))
    assert off(cosine, np.cos(angle)) <= ULPS
    assert off(sine, np.sin(angle)) <= ULPS


def test_at_every_quarter_turn():
    # Where the reduced angle is 0 and all signs change; sine and cosine of a full turn and back.
    angle = np.arange(-9, 10) * (np.pi / 2)
    cosine, sine = cos_sin(jnp.asarray(angle))
    np.testing.assert_allclose(cosine, np.cos(angle), rtol=0, atol=4e-16)
    np.testing.assert_allclose(sine, np.sin(angle), rtol=0, atol=4e-16)


def test_arc_tangent_to_the_last_places():
    rng = np.random.default_rng(0)
    x = np.concatenate([rng.uniform(-3, 3, 50_000), np.exp(rng.uniform(-30, 30, 50_000))])
    assert off(arctan(jnp.asarray(x)), np.arctan(x)) <= ULPS
    ends = arctan(jnp.array([0.0, jnp.inf, -jnp.inf]))
    np.testing.assert_array_equal(ends, [0.0, np.pi / 2, -np.pi / 2])


def test_derivatives_are_those_of_the_functions():
    for angle in (-2.0, 0.3, 4.0):
        for order, true in ((1, np.cos(angle)), (2, -np.sin(angle)), (3, -np.cos(angle))):
            found = lambda x: cos_sin(x)[1]  # noqa: E731
            for _ in range(order):
                found = jax.grad(found)
            np.testing.assert_allclose(found(angle), true, rtol=1e-14)
        np.testing.assert_allclose(jax.grad(arctan)(angle), 1 / (1 + angle**2), rtol=1e-15)


def test_mean_of_a_gaussian():
    # The series below 0.1 leaves out 2e-13.
    z = np.concatenate([[0.0], np.geomspace(1e-6, 1e6, 5001)])
    mean, rate = gaussian_mean(jnp.asarray(z))
    some = np.where(z > 0, z, 1.0)
    true = np.where(z > 0, np.sqrt(np.pi) / 2 * erf(z) / some, 1.0)
    np.testing.assert_allclose(mean, true, rtol=0, atol=1e-12)
    # The derivative over z: by its own quotient, whose roundings are divided by z^2.
    far = z > 1e-2
    quotient = (np.exp(-z * z) - true) / some**2
    np.testing.assert_allclose(rate[far], quotient[far], rtol=0, atol=2e-10)
    assert rate[0] == -2 / 3


def test_derivatives_of_the_mean_of_a_gaussian():
    for z in (1e-3, 0.05, 0.0999, 0.1001, 0.7, 3.0):
        mean, rate = gaussian_mean(jnp.asarray(z))
        first = jax.grad(lambda z: gaussian_mean(z)[0])(z)
        np.testing.assert_allclose(first, z * rate, rtol=1e-14)
        # z mean' = exp(-z^2) - mean, differentiated once more.
        second = jax.grad(jax.grad(lambda z: gaussian_mean(z)[0]))(z)
        np.testing.assert_allclose(second, -2 * np.exp(-z * z) - 2 * rate, atol=1e-8)


def test_what_is_no_number_stays_none():
    every = (*cos_sin(jnp.array([jnp.nan, jnp.inf])), arctan(jnp.array([jnp.nan])))
    assert all(np.all(np.isnan(each)) for each in every)


def test_single_precision_is_the_compilers():
    angle = jnp.linspace(-10, 10, 101, dtype=jnp.float32)
    cosine, sine = cos_sin(angle)
    assert cosine.dtype == sine.dtype == arctan(angle).dtype == jnp.float32
    np.testing.assert_allclose(cosine, np.cos(np.asarray(angle, float)), atol=1e-6)


def test_lanes_are_not_handed_to_the_c_library():
    # What XLA makes of a batch holds neither of its own operations for them.
    text = jax.jit(lambda x: (cos_sin(x), arctan(x))).lower(jnp.ones(64)).as_text()
    for name in ("cosine", "sine", "atan2"):
        assert f"stablehlo.{name}" not in text
