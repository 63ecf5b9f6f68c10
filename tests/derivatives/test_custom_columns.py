"""Functions that bring their own derivative along several directions at once."""

import jax
import jax.numpy as jnp
import numpy as np

from fencejax.derivatives import by_columns, custom_columns, pushed

FACTOR = 3.0


def product(x, y):
    return {"product": x**2 * y, "same": y}


def tripled(arguments, results, dots):
    """FACTOR times the derivatives, which tells them from those of JAX's own rules."""
    (x, y), (of_x, of_y) = arguments, dots
    parts = ((2 * x * y, of_x), (x**2, of_y))
    total = sum(factor * dot for factor, dot in parts if dot is not None)
    return [FACTOR * total, None if of_y is None else FACTOR * of_y]


def marked(x, y):
    """x^2 y + y of the function that brings its derivative."""
    found = custom_columns(product, tripled)(x, y)
    return found["product"] + found["same"]


X, Y = jnp.asarray(0.7), jnp.asarray(-1.3)
EXACT = np.array([2 * 0.7 * -1.3, 0.7**2 + 1])
EPS = np.finfo(float).eps


def near(ours, exact):
    np.testing.assert_allclose(ours, exact, rtol=8 * EPS)


def test_columns_are_those_of_its_rule():
    traced = jax.make_jaxpr(marked)(X, Y)
    unit = jnp.eye(2)
    for dots, exact in (((unit[0], unit[1]), EXACT), ((unit[0], None), EXACT * [1, 0]),
                        ((None, unit[1]), EXACT * [0, 1])):  # fmt: skip
        outs, found = pushed(traced.jaxpr, traced.consts, [X, Y], dots)
        near(outs[0], 0.7**2 * -1.3 - 1.3)
        near(found[0], FACTOR * exact)


def test_other_transformations_take_the_function_itself():
    near(jax.grad(marked, (0, 1))(X, Y), EXACT)
    near(jax.jacfwd(marked, 1)(X, Y), EXACT[1])
    near(jax.jit(jax.jacrev(marked))(X, Y), EXACT[0])
    near(jax.hessian(marked)(X, Y), 2 * -1.3)
    lanes = jnp.asarray([0.7, 1.0])
    near(jax.vmap(marked, (0, None))(lanes, Y), lanes**2 * Y + Y)
    near(jax.vmap(jax.grad(marked), (0, None))(lanes, Y), 2 * lanes * Y)


def test_its_columns_are_differentiated_again():
    # The rule's own derivative: FACTOR times d^2/dx^2, and in lanes.
    def of_x(x):
        return marked(x, Y)

    def slope(x):
        return jax.grad(by_columns(of_x))(x)

    near(jax.jit(slope)(X), FACTOR * EXACT[0])
    near(jax.grad(slope)(X), FACTOR * 2 * -1.3)
    near(jax.vmap(jax.grad(slope))(jnp.asarray([0.7, 2.0])), FACTOR * 2 * -1.3)
