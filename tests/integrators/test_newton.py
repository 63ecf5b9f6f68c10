"""Newton's method and elimination for a few unknowns."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fencejax.derivatives import pushed
from fencejax.integrators import eliminate, solve

EPS = np.finfo(float).eps


@pytest.mark.parametrize("size", [1, 2, 3, 4, 6])
def test_elimination_solves_diagonally_dominant_systems(size):
    # Elimination without pivots is stable for diagonally dominant matrices: growth at most 2,
    # condition below 10 here, so some tens of eps. Ten systems at once, elementwise.
    rng = np.random.default_rng(size)
    matrix = rng.uniform(-1, 1, (10, size, size)) + 2 * size * np.eye(size)
    right = rng.uniform(-1, 1, (10, size))
    rows = [[jnp.asarray(matrix[:, i, j]) for j in range(size)] for i in range(size)]
    ours = eliminate(rows, tuple(jnp.asarray(right[:, i]) for i in range(size)))
    exact = np.linalg.solve(matrix, right[..., None])[..., 0]
    np.testing.assert_allclose(np.array(ours).T, exact, rtol=0, atol=20 * size * EPS)


def test_elimination_leaves_its_arguments_alone():
    rows = [[jnp.asarray(2.0), jnp.asarray(1.0)], [jnp.asarray(1.0), jnp.asarray(3.0)]]
    kept = [list(row) for row in rows]
    eliminate(rows, (jnp.asarray(1.0), jnp.asarray(2.0)))
    assert [[float(x) for x in row] for row in rows] == [[float(x) for x in row] for row in kept]


# --- Newton -------------------------------------------------------------------------------------

TOLERATED = 1e-13


def full_step(given, extra, change, last):
    del given, extra, last
    return jnp.ones_like(change[0])


def square_root(given, x):
    """x^2 = a: root sqrt(a), extra 3 x + a."""
    (root,) = x
    residual = root**2 - given
    return (residual,), [[2 * root]], jnp.abs(residual) / TOLERATED, 3 * root + given


def circle_and_line(given, x):
    """x^2 + y^2 = r^2, y = s x: root r (1, s) / sqrt(1 + s^2), extra x y."""
    (r, s), (a, b) = given, x
    residual = (a**2 + b**2 - r**2, b - s * a)
    size = jnp.maximum(jnp.abs(residual[0]), jnp.abs(residual[1])) / TOLERATED
    one = jnp.ones_like(a)
    return residual, [[2 * a, 2 * b], [-s, one]], size, a * b


@jax.jit
def root_of(a):
    (root,), extra = solve(square_root, full_step, a, (jnp.ones_like(a),), jnp.asarray(12.0))
    return root, extra


@jax.jit
def crossing(r, s):
    guess = (jnp.ones_like(r), jnp.ones_like(r))
    return solve(circle_and_line, full_step, (r, s), guess, jnp.asarray(12.0))


def test_scalar_root_and_its_derivative():
    # d sqrt(a) / da = 1 / (2 sqrt(a)), of the extra 3 / (2 sqrt(a)) + 1. The root is within
    # TOLERATED / (2 sqrt(a)), the derivative within that relative to the root.
    a = 2.7
    exact = (np.sqrt(a), 3 * np.sqrt(a) + a)
    slopes = (0.5 / np.sqrt(a), 1.5 / np.sqrt(a) + 1)
    np.testing.assert_allclose(root_of(a), exact, rtol=2 * TOLERATED)
    values, forward = jax.jvp(root_of, (a,), (1.0,))
    np.testing.assert_allclose(values, exact, rtol=2 * TOLERATED)
    np.testing.assert_allclose(forward, slopes, rtol=2 * TOLERATED)
    for k in range(2):
        backward = jax.grad(lambda a, k=k: root_of(a)[k])(a)
        np.testing.assert_allclose(backward, slopes[k], rtol=2 * TOLERATED)


def test_two_unknowns_and_their_derivatives():
    r, s = 1.7, 0.6
    norm = np.sqrt(1 + s**2)
    (x, y), product = crossing(r, s)
    exact = np.array([r / norm, r * s / norm, r**2 * s / norm**2])
    np.testing.assert_allclose((x, y, product), exact, rtol=4 * TOLERATED)
    # d/dr and d/ds of (x, y, x y).
    by_r = [1 / norm, s / norm, 2 * r * s / norm**2]
    by_s = [-r * s / norm**3, r / norm**3, r**2 * (1 - s**2) / norm**4]

    def flat(r, s):
        (x, y), product = crossing(r, s)
        return jnp.stack([x, y, product])

    for mode in (jax.jacfwd, jax.jacrev):
        ours = mode(flat, (0, 1))(r, s)
        np.testing.assert_allclose(ours[0], by_r, rtol=10 * TOLERATED)
        np.testing.assert_allclose(ours[1], by_s, rtol=10 * TOLERATED)


@pytest.mark.parametrize("moved", [(0,), (1,), (0, 1)])
def test_all_directions_at_once(moved):
    """By one pass of columns the same as along each direction, in lanes as well."""

    def flat(r, s):
        (x, y), product = crossing(r, s)
        return jnp.stack([x, y, product])

    def columns(r, s):
        traced, unit = jax.make_jaxpr(flat)(r, s), jnp.eye(len(moved))
        dots = [unit[moved.index(i)] if i in moved else None for i in range(2)]
        return pushed(traced.jaxpr, traced.consts, [r, s], dots)[1][0]

    def each(r, s):
        return jnp.stack(jax.jacfwd(flat, moved)(r, s))

    r, s = jnp.asarray([1.0, 1.7, 2.0]), jnp.asarray(0.6)
    np.testing.assert_allclose(columns(r[1], s), each(r[1], s), rtol=1e-13)
    lanes = jax.vmap(columns, (0, None))(r, s)
    np.testing.assert_allclose(lanes, jax.vmap(each, (0, None))(r, s), rtol=1e-13)


def test_the_derivative_does_not_pass_through_the_guess():
    # The root does not depend on where it was looked for.
    def root(guess):
        return solve(square_root, full_step, jnp.asarray(2.0), (guess,), jnp.asarray(12.0))[0][0]

    value, slope = jax.value_and_grad(root)(jnp.asarray(1.3))
    np.testing.assert_allclose(value, np.sqrt(2), rtol=2 * TOLERATED)
    assert float(slope) == 0.0


@pytest.mark.parametrize("most", [1, 2, 3])
def test_no_more_steps_than_allowed(most):
    # x -> x - (x^2 - a) / (2 x), so many times and no more.
    a = x = 2.7
    for _ in range(most):
        x = x - (x**2 - a) / (2 * x)
    ours = solve(
        square_root, full_step, jnp.asarray(a), (jnp.asarray(a),), jnp.asarray(float(most))
    )
    np.testing.assert_allclose(ours[0][0], x, rtol=4 * EPS)
    np.testing.assert_allclose(ours[1], 3 * x + a, rtol=4 * EPS)


def test_steps_are_shortened_as_asked():
    # One half step from x = a.
    def half(given, extra, change, last):
        return 0.5 * full_step(given, extra, change, last)

    a = 2.7
    ours = solve(square_root, half, jnp.asarray(a), (jnp.asarray(a),), jnp.asarray(1.0))
    np.testing.assert_allclose(ours[0][0], a - 0.5 * (a**2 - a) / (2 * a), rtol=4 * EPS)


def test_lanes_of_a_batch_keep_their_own_roots():
    # All lanes go on until the last is done: each is still the root of its own equation.
    a = jnp.array([0.2, 1.0, 2.7, 9.0])
    roots, _ = jax.vmap(root_of)(a)
    np.testing.assert_allclose(roots, np.sqrt(a), rtol=4 * TOLERATED)
    slopes = jax.vmap(jax.grad(lambda a: root_of(a)[0]))(a)
    np.testing.assert_allclose(slopes, 0.5 / np.sqrt(a), rtol=4 * TOLERATED)


def test_an_approximate_matrix_still_finds_the_root():
    # With the matrix 10 % off, the error shrinks by about ten a step: 12 steps leave 1e-12.
    def off(given, x):
        residual, matrix, size, extra = square_root(given, x)
        return residual, [[1.1 * matrix[0][0]]], size, extra

    root = solve(off, full_step, jnp.asarray(2.7), (jnp.asarray(1.6),), jnp.asarray(12.0))[0][0]
    np.testing.assert_allclose(root, np.sqrt(2.7), rtol=1e-11)
