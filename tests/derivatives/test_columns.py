"""Derivatives along several directions, operation by operation: those of JAX's own rules."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gate import equations

from fencejax.derivatives import pushed

X, Y = jnp.array([[0.3, 1.7], [0.9, 0.6]]), jnp.array([[0.8, -0.4], [0.9, 2.0]])
RIGHT = jnp.array([0.5, -1.5])


@jax.custom_jvp
def doubled(x):
    return 2 * x


@doubled.defjvp
def _(primals, tangents):
    return doubled(*primals), 3 * tangents[0]


def loop(x, y, right):
    """A loop whose numbers come to move one after another, and that counts."""

    def trip(carry):
        count, a, b, c = carry
        return count + 1, jnp.sin(a) * right, b + a, c + b

    return jax.lax.while_loop(
        lambda carry: carry[0] < 4, trip, (0, x[0], jnp.zeros(2), jnp.ones(2))
    )[1:]


FUNCTIONS = {
    "arithmetic": lambda x, y, r: (x + y, x - y, -x, x * y, x / y, 2.0 * x, x / 3.0, 3.0 / x),
    "same direction": lambda x, y, r: (x + 2.0 * x, x * x, x - 0.5 * x, jnp.sin(x) - x / x),
    "number by number": lambda x, y, r: (
        jnp.exp(x), jnp.sqrt(x), jnp.abs(y), x**1.5, x**3, jnp.arctan2(x, y), jnp.tanh(x * y),
    ),
    "extremes": lambda x, y, r: (
        jnp.maximum(x, y), jnp.minimum(x, y), jnp.maximum(y, 0.0), jnp.minimum(x, x),
    ),
    "choices": lambda x, y, r: (
        jnp.where(x > 0.5, x, y), jnp.where(y[0, 0] > 0, 2.0 * x, 3.0 * x),
        jnp.where(y > 0, x, 0.0),
    ),
    "places": lambda x, y, r: (
        x[0], x[:, 1:], x.reshape(4), x.T, jnp.concatenate([x, jnp.ones((1, 2))]),
        jnp.stack([x, y]), jax.lax.dynamic_index_in_dim(x, 1), r[:, None] * x, r[None] + x[:, :1],
    ),
    "sums": lambda x, y, r: (jnp.sum(x), jnp.sum(x * y, 0), x @ y, jnp.cumsum(x), jnp.sort(x)),
    "constants": lambda x, y, r: (
        jax.lax.stop_gradient(x) * y, jnp.floor(x), jnp.ones(2), x * jnp.sign(y), r,
    ),
    "a rule of its own": lambda x, y, r: (doubled(x[0] * r), jax.jit(doubled)(y)),
    "loop": loop,
    "counted loop": lambda x, y, r: jax.lax.fori_loop(0, 3, lambda i, c: c * x + y, y),
    "rows": lambda x, y, r: jax.lax.scan(
        lambda c, row: ((c[0] * row[0] + y[0], c[1] + 1), (c[0] * row[1], row[0], c[1])),
        (x[1], jnp.zeros(())), (x, y),
    ),
    "rows backwards": lambda x, y, r: jax.lax.scan(
        lambda c, row: (c * row, jnp.sin(row)), y[0], x, reverse=True, unroll=2
    ),
    "loop with rows": lambda x, y, r: jax.lax.scan(
        lambda c, _: (c * x, jnp.floor(c) + y), y, None, length=3
    ),
    "branch": lambda x, y, r: jax.lax.cond(
        x[0, 0] > 0, lambda a, b: (a * b, b), lambda a, b: (a, a), x, y
    ),
    "branches": lambda x, y, r: jax.lax.switch(
        jnp.int32(2 * x[0, 0]) + 2, [jnp.sin, jnp.cos, jnp.exp], x
    ),
}  # fmt: skip


def ours(function, moved, size=3):
    """Results and derivatives of `function`(X, Y, RIGHT) in the arguments numbered `moved`, along
    random directions, and those by JAX."""
    given = [X, Y, RIGHT]
    rng = np.random.default_rng(0)
    every = [jnp.asarray(rng.normal(size=(size, *each.shape))) for each in given]
    program, shapes = jax.make_jaxpr(function, return_shape=True)(*given)
    dots = [dot if i in moved else None for i, dot in enumerate(every)]
    outs, found = pushed(program.jaxpr, program.consts, given, dots)
    zeros = [jnp.zeros((size, *out.shape)) for out in outs]
    found = [zero if dot is None else dot for zero, dot in zip(zeros, found, strict=True)]

    def along(*direction):
        full = [dot if i in moved else 0 * dot for i, dot in enumerate(direction)]
        return jax.jvp(lambda *x: jax.tree.leaves(function(*x)), tuple(given), tuple(full))

    return (outs, found), jax.vmap(along, out_axes=(None, 0))(*every)


@pytest.mark.parametrize("moved", [(0,), (1,), (0, 1), (0, 1, 2)], ids=str)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_same_as_by_jax(name, moved):
    (outs, found), (values, derivatives) = ours(FUNCTIONS[name], moved)
    for mine, theirs in zip([*outs, *found], [*values, *derivatives], strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-13, atol=1e-13)


def test_nothing_moves():
    program = jax.make_jaxpr(lambda x: (jnp.sin(x), x))(X)
    outs, found = pushed(program.jaxpr, program.consts, [X], [None])
    assert found == [None, None]
    np.testing.assert_array_equal(outs[0], jnp.sin(X))


def test_a_lost_derivative_stays_behind_a_choice():
    """Where the other case counts, what is not finite in one is not seen."""
    (_, found), _ = ours(lambda x, y, r: jnp.where(x > 0.7, jnp.sqrt(x - 0.9), x), (0,))
    assert np.all(np.isfinite(np.asarray(found[0])[:, X <= 0.7]))


LOOPS = {
    "while": lambda trip, begin: jax.lax.while_loop(lambda carry: carry[0] > 0.5, trip, begin),
    "scan": lambda trip, begin: jax.lax.scan(lambda c, _: (trip(c), None), begin, length=3)[0],
}


@pytest.mark.parametrize("kind", LOOPS)
def test_body_of_a_loop_is_made_once(kind):
    """For all directions, and with them for all lanes of a batch."""
    passes = []

    def chain(x):
        def trip(carry):
            a, b, c = carry
            passes.append(1)
            return jnp.sin(a), b + a, c + b

        return LOOPS[kind](trip, (x, 0.0, 0.0))

    program = jax.make_jaxpr(chain)(0.9)
    traced = len(passes)
    columns = jax.make_jaxpr(lambda dot: pushed(program.jaxpr, program.consts, [0.9], [dot]))(
        jnp.ones(3)
    )
    assert len(passes) == traced
    sines = [e for e in equations(columns.jaxpr) if e.primitive.name == "sin"]
    assert len(sines) == 1


def test_a_chain_costs_one_product_with_the_directions():
    program = jax.make_jaxpr(lambda x: jnp.exp(3.0 * jnp.sin(-x)) ** 2)(0.3)
    columns = jax.make_jaxpr(lambda dot: pushed(program.jaxpr, program.consts, [0.3], [dot])[1])(
        jnp.ones(5)
    )
    wide = [e for e in equations(columns.jaxpr) if e.outvars[0].aval.shape == (5,)]
    assert sum(e.primitive.name == "mul" for e in wide) == 1


@pytest.mark.parametrize("kind", LOOPS)
def test_what_nothing_needs_has_no_derivative(kind):
    """Neither outside a loop nor in one."""

    def both(x):
        def trip(carry):
            left, a, peak = carry
            return left - 1, a * x, jnp.maximum(peak, jnp.cos(a))

        _, a, peak = LOOPS[kind](trip, (5.0, x, x))
        return a, jnp.where(peak + jnp.exp(x) > 1, 1.0, 0.0)

    program = jax.make_jaxpr(both)(0.9)
    columns = jax.make_jaxpr(lambda dot: pushed(program.jaxpr, program.consts, [0.9], [dot])[1])(
        jnp.ones(5)
    )
    names = {e.primitive.name for e in equations(columns.jaxpr)}
    assert "sin" not in names
    loop = next(e for e in columns.jaxpr.eqns if e.primitive.name == kind)
    assert sum(v.aval.shape == (5,) for v in loop.outvars) == 1
