"""The finite elements of the flexible link against closed forms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from model.beam_tables import EPS, assert_near, round_off
from numpy.polynomial import polynomial
from reference import beam as dimensional

from fencejax import (
    ConstantStrength,
    Fence,
    Fidelity,
    Material,
    Uniform,
)
from fencejax.model import FlexibleLink, beam

# cos(beta) cosh(beta) = -1: the uniform cantilever.
BETA = np.array([1.8751040687119611, 4.694091132974175, 7.854757438237613])


# --- Uniform cantilever -------------------------------------------------------------------------


@pytest.mark.parametrize("elements", [5, 10, 20])
def test_uniform_eigenvalues_and_the_constant_of_their_error(elements):
    # Cubic Hermite elements with the consistent mass: (lambda_h - lambda) / lambda
    # = (beta h)^4 / 720 + O((beta h)^6). The next term is below 0.15 (beta h)^2 of it.
    tables = beam.tables(Uniform(), elements, 2 * elements)
    error = tables.eigenvalues[:3] / BETA**4 - 1
    leading = (BETA / elements) ** 4 / 720
    allowed = 0.15 * (BETA / elements) ** 2 * leading + round_off(tables, np.arange(3), 1)
    assert np.all(np.abs(error - leading) < allowed)


def cantilever_mode(index, x):
    """phi of the uniform cantilever with unit integral of phi^2, positive at the tip, and its first
    two derivatives."""
    b = BETA[index]
    s = (np.cosh(b) + np.cos(b)) / (np.sinh(b) + np.sin(b))
    sign = (-1) ** index
    value = np.cosh(b * x) - np.cos(b * x) - s * (np.sinh(b * x) - np.sin(b * x))
    slope = np.sinh(b * x) + np.sin(b * x) - s * (np.cosh(b * x) - np.cos(b * x))
    bend = np.cosh(b * x) + np.cos(b * x) - s * (np.sinh(b * x) + np.sin(b * x))
    return sign * value, sign * b * slope, sign * b**2 * bend


def test_uniform_shapes_moments_and_swing():
    # Values at the nodes of the cubic Hermite element converge with h^4, moments from the balance
    # of the inertia forces with them; (beta h)^4 / 100 bounds the relative error of each, measured
    # on its own largest value.
    elements = 20
    tables = beam.tables(Uniform(), elements, 3)
    x = np.arange(elements + 1) / elements
    for i, b in enumerate(BETA):
        allowed = (b / elements) ** 4 / 100
        value, slope, bend = cantilever_mode(i, x)
        assert_near(tables.deflection[:, i], value, allowed * 2)
        assert_near(tables.slope[:, i], slope, allowed * 2 * b)
        assert_near(tables.moment[:, i], bend[:-1], allowed * 2 * b**2)
        # integral of phi = 2 s / beta and of x phi = 2 / beta^2, with the sign of the tip.
        s = (np.cosh(b) + np.cos(b)) / (np.sinh(b) + np.sin(b))
        sign = (-1) ** i
        np.testing.assert_allclose(tables.swing_root[i], sign * 2 * s / b, rtol=allowed)
        np.testing.assert_allclose(tables.swing_tip[i], sign * 2 / b**2, rtol=allowed)


def at_nodes(table):
    """Values and derivatives in x / l_p at all nodes, of an element-wise polynomial (n, 7)."""
    powers = np.arange(table.shape[1])
    value = np.append(table[:, 0], table[-1].sum())
    slope = np.append(table[:, 1], (powers * table[-1]).sum())
    return value, slope * len(table)


def test_uniform_static_compliance_is_exact_at_the_nodes():
    # A force at a node bends a uniform beam into cubics: C(x, x) = x^3 / 3 and its derivative x^2
    # are exact. Modes kept and residual together must give them, with any number of modes;
    # round-off: eps times the condition number of K.
    elements = 8
    _, stiffness = beam.matrices(Uniform(), elements)
    allowed = EPS * np.linalg.cond(stiffness[2:, 2:])
    x = np.arange(elements + 1) / elements
    for modes in (1, 3, 2 * elements):
        tables = beam.tables(Uniform(), elements, modes)
        by_modes = (tables.deflection**2 / tables.eigenvalues).sum(1)
        turned = (2 * tables.deflection * tables.slope / tables.eigenvalues).sum(1)
        residual, slope = at_nodes(tables.residual)
        assert_near(by_modes + residual, x**3 / 3, allowed)
        assert_near(turned + slope, x**2, allowed)
    # With one mode the residual is what a person would check it for: far above that round-off.
    assert np.max(beam.tables(Uniform(), elements, 1).residual[:, 0]) > 1e4 * allowed


# --- Constant strength --------------------------------------------------------------------------


def taper_series(eigenvalue, terms=60):
    """Coefficients in xi = 1 - x / l_p of the two solutions with a free tip of
    (xi^(3/2) w'')'' = lambda xi^(1/2) w: f0 = 1 + ..., f1 = xi + ..., with
    a_k = lambda a_(k-3) / (k (k - 1) (k - 1/2) (k - 3/2))."""
    solutions = []
    for first in (0, 1):
        a = np.zeros(terms)
        a[first] = 1.0
        for k in range(3, terms):
            a[k] = eigenvalue * a[k - 3] / (k * (k - 1) * (k - 0.5) * (k - 1.5))
            if k == first:
                a[k] = 1.0
        solutions.append(a)
    return solutions


def clamped_root(eigenvalue):
    """f0 f1' - f0' f1 at xi = 1: zero where the root is clamped."""
    f0, f1 = taper_series(eigenvalue)
    k = np.arange(len(f0))
    return f0.sum() * (k * f1).sum() - (k * f0).sum() * f1.sum()


def taper_eigenvalues(count):
    """The first zeros of `clamped_root`, by bisection."""
    found, low = [], 0.0
    step = 2.0
    while len(found) < count:
        if clamped_root(low) * clamped_root(low + step) < 0:
            a, b = low, low + step
            for _ in range(60):
                middle = 0.5 * (a + b)
                a, b = (middle, b) if clamped_root(a) * clamped_root(middle) > 0 else (a, middle)
            found.append(0.5 * (a + b))
        low += step
    return np.array(found)


def taper_mode(eigenvalue):
    """Coefficients in xi of the clamped mode, with unit integral of xi^(1/2) w^2, positive tip."""
    f0, f1 = taper_series(eigenvalue)
    w = f0 - f0.sum() / f1.sum() * f1
    square = polynomial.polymul(w, w)
    norm = np.sum(square / (np.arange(len(square)) + 1.5))
    return w / np.sqrt(norm)


def test_constant_strength_eigenvalues_converge_with_order_4():
    # The modes are analytic in xi, so the order is that of the element, h^4. Between n and 2 n the
    # observed order is 4 up to the next term, of relative size (k h)^2 < 0.1 for the third mode.
    exact = taper_eigenvalues(3)
    coarse, fine = (
        beam.tables(ConstantStrength(), n, 2 * n).eigenvalues[:3] / exact - 1 for n in (10, 20)
    )
    assert np.all(fine > 0)  # Rayleigh: from above
    order = np.log2(coarse / fine)
    assert_near(order, 4.0, 0.15)
    # (k h)^4 / 720 with k^4 = lambda g / g^3 at the thinner half (g^2 = 1/2).
    assert np.all(fine < exact * 2 / 20**4 / 720 * 3)


def test_constant_strength_shapes_moments_and_swing():
    # As for the uniform beam, with lambda for beta^4: deflection and moment are in error by less
    # than lambda h^4 / 100, measured on their largest values. At the last elements the weight
    # xi^(3/2) vanishes and the problem is free of scale: there the slope's error is that of its
    # interpolant, w'''' h^3 < lambda h^3 / 100.
    elements, modes = 20, 3
    tables = beam.tables(ConstantStrength(), elements, modes)
    xi = 1 - np.arange(elements + 1) / elements
    exact = taper_eigenvalues(modes)
    for i in range(modes):
        w = taper_mode(exact[i])
        k = np.arange(len(w))
        value = polynomial.polyval(xi, w)
        slope = -polynomial.polyval(xi, polynomial.polyder(w))  # d/dx = -d/dxi
        moment = xi**1.5 * polynomial.polyval(xi, polynomial.polyder(w, 2))
        allowed = exact[i] / elements**4 / 100
        for ours, theirs, factor in (
            (tables.deflection[:, i], value, 1),
            (tables.slope[:, i], slope, elements),
            (tables.moment[:, i], moment[:-1], 1),
        ):
            assert_near(ours, theirs, factor * allowed * np.max(np.abs(theirs)))
        # integral of xi^(1/2) w, and with x = 1 - xi beside it.
        translation = np.sum(w / (k + 1.5))
        rotation = translation - np.sum(w / (k + 2.5))
        assert_near(tables.swing_root[i], translation, allowed)
        assert_near(tables.swing_tip[i], rotation, allowed)


def test_constant_strength_mass_integrals():
    # Integrals of sqrt(1 - x) x^k, k = 0, 1, 2: 2/3, 4/15, 16/105, exact by the quadrature.
    tables = beam.tables(ConstantStrength(), 7, 2)
    np.testing.assert_allclose(tables.mass, [2 / 3, 4 / 15, 16 / 105], rtol=50 * EPS)
    x = np.arange(7) / 7
    np.testing.assert_allclose(tables.relative_thickness, np.sqrt(1 - x), rtol=4 * EPS)


def test_constant_strength_compliance_at_the_tip():
    # Under a tip force P: w'' = P l / (E I_1) xi^(-1/2), w(tip) = 2/3 P l^3 / (E I_1). The FE value
    # is low by the energy of the best approximation of xi^(-1/2), with weight xi^(3/2), by straight
    # lines in each element: each integral scales exactly with h^(3/2), so the order is 3/2, up to
    # the clamped end's share, O(h^4).
    errors = []
    for n in (8, 16, 32):
        _, stiffness = beam.matrices(ConstantStrength(), n)
        force = np.zeros(2 * n)
        force[-2] = 1.0
        errors.append(2 / 3 - np.linalg.solve(stiffness[2:, 2:], force)[-2])
    errors = np.array(errors)
    assert np.all(errors > 0)
    order = np.log2(errors[:-1] / errors[1:])
    assert_near(order, 1.5, 0.01)


def test_constant_strength_compliance_inside():
    # A force at a node a < 1: w'' = f = (a - x) xi^(-3/2) is smooth on [0, a], so the FE value is
    # low by the energy of f less its best straight line in each element,
    # h^4 / 720 integral of xi^(3/2) f''^2, up to O(h) of that; a = 1/2.
    a = 0.5

    def f_second(x):  # ((a - x) xi^(-3/2))'' = -3 xi^(-5/2) + 15/4 (a - x) xi^(-7/2)
        return -3 * (1 - x) ** -2.5 + 3.75 * (a - x) * (1 - x) ** -3.5

    nodes, weights = np.polynomial.legendre.leggauss(20)
    x = a * (1 + nodes) / 2
    energy = np.sum(a / 2 * weights * (1 - x) ** 1.5 * f_second(x) ** 2)
    # integral of (a - x)^2 (1 - x)^(-3/2)
    exact = np.sum(a / 2 * weights * (a - x) ** 2 * (1 - x) ** -1.5)
    for n in (10, 20):
        tables = beam.tables(ConstantStrength(), n, 2)
        ours = (tables.deflection**2 / tables.eigenvalues).sum(1) + at_nodes(tables.residual)[0]
        leading = energy / n**4 / 720
        np.testing.assert_allclose(exact - ours[n // 2], leading, rtol=2 / n)


# --- Similarity ---------------------------------------------------------------------------------

FENCE = dict(rigid_length=0.3, flexible_length=0.8, width=0.12, thickness=0.05)
MATERIAL = dict(youngs_modulus=2.2e9, density=980.0, damping_ratio=0.07)


def make_link(fence=FENCE, material=MATERIAL, modes=4, **fidelity):
    made = Fence(**fence, material=Material(**material))
    return FlexibleLink(made, Fidelity(modes=modes, **fidelity))


def test_scaled_tables_are_the_dimensional_eigenpairs():
    # omega^2 ~ E h_1^2 / (rho l_p^4), shapes ~ (rho z h_1 l_p)^(-1/2), against an eigen-solve of
    # the dimensional matrices. Round-off: eps times lambda_40 / lambda_1 = 1.4e7 for 20 elements.
    allowed = 10 * EPS * 1.4e7
    link = make_link()
    modes = dimensional.clamped_modes(
        FENCE["rigid_length"], FENCE["flexible_length"], FENCE["width"], FENCE["thickness"],
        *MATERIAL.values(), elements=20, count=4,
    )
    np.testing.assert_allclose(link.eigenvalues, modes.frequency**2, rtol=allowed)
    np.testing.assert_allclose(np.array(link.damping), modes.damping, rtol=allowed)
    shape = np.array(link.deflection).T / np.sqrt(link.mass_scale)
    assert_near(shape, modes.displacement, allowed * np.max(shape))
    slope = np.array(link.slope).T / np.sqrt(link.mass_scale) / link.length
    assert_near(slope, modes.slope, allowed * np.max(slope))
    swing = np.array(link.swing) * np.sqrt(link.mass_scale)
    np.testing.assert_allclose(swing, modes.participation, rtol=allowed * 10)


def test_eigenvalues_follow_the_exact_exponents():
    # d log omega_i^2 / d log p = 2, 1, -1, -4, 0, 0 for h_1, E, rho, l_p, z, l_s: exact, so only
    # round-off of a few products is allowed.
    names = ("thickness", "youngs_modulus", "density", "flexible_length", "width", "rigid_length")
    numbers = {**FENCE, **MATERIAL}

    def log_eigenvalues(logs):
        values = {**numbers, **dict(zip(names, map(jnp.exp, logs), strict=True))}
        fence = {name: values[name] for name in FENCE}
        return jnp.log(make_link(fence, {name: values[name] for name in MATERIAL}).eigenvalues)

    logs = tuple(jnp.log(numbers[name]) for name in names)
    exponents = jax.jit(jax.jacrev(log_eigenvalues))(logs)
    for found, exact in zip(exponents, (2.0, 1.0, -1.0, -4.0, 0.0, 0.0), strict=True):
        assert_near(found, np.full(4, exact), 50 * EPS)
