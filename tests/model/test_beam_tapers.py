"""The beam of stepped and of traced tapers against the plain ones, and derivatives in the taper."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from model.beam_tables import EPS, assert_near, compiled_tables, numpy_tables, round_off

from fencejax import (
    ConstantStrength,
    PowerTaper,
    ProfileTaper,
    SteppedTaper,
    Uniform,
)
from fencejax.model import beam

# --- Stepped tapers -----------------------------------------------------------------------------


def test_a_stepped_uniform_profile_is_uniform():
    stepped, plain = SteppedTaper(Uniform(), 3), Uniform()
    ours, theirs = (beam.matrices(taper, 6) for taper in (stepped, plain))
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(a, b)


def test_stepped_profile_has_the_closed_form_element_matrices():
    # Thickness g frozen in an element: its mass is g times, its stiffness g^3 times that of a
    # uniform one; where the steps are the elements the deflection of the tip under a force there
    # is sum of the elements' own, integral (1 - x)^2 / g_e^3 dx, exact at the nodes.
    n = 20
    edges = np.arange(n + 1) / n
    g = np.sqrt(1 - (np.arange(n) + 0.5) / n)
    tables = beam.tables(SteppedTaper(ConstantStrength(), n), n, 2 * n)
    tip = np.sum(((1 - edges[:-1]) ** 3 - (1 - edges[1:]) ** 3) / (3 * g**3))
    ours = np.sum(tables.deflection[-1] ** 2 / tables.eigenvalues)
    np.testing.assert_allclose(ours, tip, rtol=1e-9)
    np.testing.assert_allclose(tables.mass[0], g.mean(), rtol=1e-14)


def test_steps_tend_to_the_smooth_profile_at_second_order():
    # The midpoint rule in g and g^3; near the tip, where g is a square root, it is off by a power
    # 1.5 of the step in the mass of the last element, which moves f_1 by order 2 or a little less.
    exact = beam.tables(ConstantStrength(), 64, 1).eigenvalues[0]
    errors = [
        abs(beam.tables(SteppedTaper(ConstantStrength(), n), 64, 1).eigenvalues[0] / exact - 1)
        for n in (8, 16, 32)
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all((orders > 1.3) & (orders < 2.2)), (errors, orders)


# --- Traced tapers ------------------------------------------------------------------------------


def assert_same_tables(ours, theirs, allowed):
    # The coefficients of the residuals are sums of sixteen products each, by up to 3 and -2.
    for name, a, b in zip(theirs._fields, ours, theirs, strict=True):
        larger = 16 if name.startswith("residual") else 1
        assert_near(a, b, larger * allowed * np.max(np.abs(b)), name)


@pytest.mark.parametrize(
    ("traced", "plain"),
    [
        (PowerTaper(0.5), ConstantStrength()),
        (PowerTaper(0), Uniform()),
        (ProfileTaper(np.ones(5)), Uniform()),
    ],
    ids=["power 1/2", "power 0", "profile of ones"],
)
def test_traced_tapers_reproduce_the_plain_ones(traced, plain):
    # The same matrices and another eigen-solver: round-off only, eps lambda_max / lambda_1 for
    # the eigenvalues; the vectors' is that over the relative gap, about 1 here.
    elements, modes = 8, 4
    ours = compiled_tables(traced, elements, modes)
    theirs = beam.tables(plain, elements, modes)
    assert_same_tables(ours, theirs, round_off(numpy_tables(plain, elements, 2 * elements)))


def perturbation(profile, change, elements, modes):
    """d lambda = phi^T (dK - lambda dM) phi in NumPy, for profiles that move with a parameter:
    the matrices' derivative by central differences, whose error is that of the step squared."""
    tables = numpy_tables(profile(0.0), elements, modes)
    full = np.stack([tables.deflection, tables.slope], 1).reshape(2 * elements + 2, modes)
    (m1, k1), (m0, k0) = (beam.matrices(profile(s * change), elements) for s in (1, -1))
    dm, dk = (m1 - m0) / (2 * change), (k1 - k0) / (2 * change)
    return np.einsum("im,ij,jm->m", full, dk, full) - tables.eigenvalues * np.einsum(
        "im,ij,jm->m", full, dm, full
    )


def test_derivative_of_eigenvalues_in_the_exponent():
    # Error of the reference: change^2 times third derivatives over first, below 100 (ln xi)^2;
    # change = 1e-5 leaves 1e-8, and round-off of the matrices eps / change = 2e-11.
    elements, modes = 8, 4
    exact = perturbation(
        lambda d: lambda x, tip: tip ** (0.4 + d), 1e-5, elements, modes
    )
    ours = jax.jacfwd(lambda p: compiled_tables(PowerTaper(p), elements, modes).eigenvalues)(0.4)
    np.testing.assert_allclose(ours, exact, rtol=1e-7)


def test_derivative_of_eigenvalues_in_the_profile():
    # The matrices are polynomials of third degree in the ratios: central differences are in error
    # by change^2 of the cubic term alone, 1e-10 here.
    elements, modes = 8, 3
    ratios = np.array([1.0, 0.8, 0.5])
    stations = np.linspace(0, 1, 3)
    ours = jax.jacfwd(lambda r: compiled_tables(ProfileTaper(r), elements, modes).eigenvalues)(
        jnp.asarray(ratios)
    )
    for k in range(3):
        unit = np.eye(3)[k]
        exact = perturbation(
            lambda d, unit=unit: lambda x, tip: np.interp(x, stations, ratios + d * unit),
            1e-5, elements, modes,
        )
        np.testing.assert_allclose(ours[:, k], exact, rtol=1e-7, atol=1e-7 * np.max(np.abs(ours)))


def test_derivative_of_every_table_in_the_exponent():
    # Against central differences of the NumPy tables. Truncation change^2 (ln xi)^2 ~ 1e-7 at
    # change = 1e-4 and round-off of the tables (5e-11 relative) / change = 5e-7.
    elements, modes, change = 8, 3, 1e-4
    high, low = (
        numpy_tables(lambda x, tip, p=p: tip**p, elements, modes)
        for p in (0.4 + change, 0.4 - change)
    )
    ours = jax.jacfwd(lambda p: compiled_tables(PowerTaper(p), elements, modes))(0.4)
    for name, a, b, slope in zip(high._fields, high, low, ours, strict=True):
        exact = (a - b) / (2 * change)
        assert_near(slope, exact, 3e-6 * np.max(np.abs(exact)) + 1e-9, name)


def test_profile_taper_interpolates_linearly():
    # g = 1 - x / 2 from three stations on the line: the same function, round-off only.
    ours = ProfileTaper(np.array([1.0, 0.75, 0.5]))(np.linspace(0, 1, 7), None)
    np.testing.assert_allclose(ours, 1 - np.linspace(0, 1, 7) / 2, rtol=4 * EPS)


def test_a_rigid_fence_has_no_modes_and_keeps_its_mass():
    tables = beam.tables(ConstantStrength(), 20, 0)
    assert tables.eigenvalues.shape == (0,)
    assert tables.deflection.shape == (21, 0)
    np.testing.assert_allclose(tables.mass[0], 2 / 3, rtol=50 * EPS)
