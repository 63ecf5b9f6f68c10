"""Equal operations of a traced program made one, and unread ones left out: the same numbers."""

from collections import Counter

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gate import equations
from jax.extend.core import jaxpr_as_fun

from fencejax.derivatives import shared

X = jnp.array([0.3, 0.9])


def traced(function, *given):
    """A program, with what is the same made one, and how often it has each operation."""
    plain = jax.make_jaxpr(function)(*given)
    program = shared(plain)
    for ours, theirs in zip(
        jaxpr_as_fun(program)(*given), jaxpr_as_fun(plain)(*given), strict=True
    ):
        np.testing.assert_array_equal(ours, theirs)
    return program, Counter(e.primitive.name for e in equations(program.jaxpr))


def twice(x):
    return jnp.sin(x) * jnp.exp(x) + jnp.sin(x) * jnp.exp(x)


FUNCTIONS = {
    "plain": twice,
    "called": jax.jit(twice),
    "branch": lambda x: jax.lax.cond(x[0] > 0, twice, lambda x: x, x),
    "while": lambda x: jax.lax.while_loop(lambda c: c[0] < 2, lambda c: 1 + twice(c), x),
    "scan": lambda x: jax.lax.scan(lambda c, _: (twice(c), None), x, length=3)[0],
    "copies": lambda x: jnp.sin(jnp.array(x)) * jnp.exp(x) + jnp.sin(x) * jnp.exp(jnp.copy(x)),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_equal_operations_are_one(name):
    _, count = traced(FUNCTIONS[name], X)
    assert (count["sin"], count["exp"], count["mul"], count["copy"]) == (1, 1, 1, 0)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_derivatives_are_the_same(name):
    program, _ = traced(FUNCTIONS[name], X)
    ours = jax.jvp(lambda x: jaxpr_as_fun(program)(x)[0], (X,), (X,))
    theirs = jax.jvp(FUNCTIONS[name], (X,), (X,))
    np.testing.assert_allclose(ours, theirs, rtol=1e-15)


def unread(x):
    jnp.tan(x)
    return jnp.exp(x)


@pytest.mark.parametrize(
    "function",
    [
        unread,
        lambda x: jax.lax.cond(x[0] > 0, unread, lambda x: x, x),
        lambda x: jax.lax.while_loop(lambda c: c[0] < 2, lambda c: 1 + unread(c), x),
    ],
)
def test_what_nothing_reads_is_left_out(function):
    _, count = traced(function, X)
    assert (count["tan"], count["exp"]) == (0, 1)


def test_what_differs_stays_apart():
    def function(x):
        return (
            jnp.sum(jnp.stack([x, x]), 0), jnp.sum(jnp.stack([x, x]), 1), x / 0.0, x / -0.0,
            x.astype(jnp.float32), x.astype(jnp.int32), x - x[::-1], x[::-1] - x,
        )  # fmt: skip

    _, count = traced(function, X)
    assert (count["reduce_sum"], count["div"], count["sub"]) == (2, 2, 2)
    assert (count["convert_element_type"], count["rev"]) == (2, 1)


def test_no_derivative_comes_back():
    """What holds one back is an operation like any other."""
    program, _ = traced(lambda x: jax.lax.stop_gradient(x) * x, X)
    slope = jax.grad(lambda x: jnp.sum(jaxpr_as_fun(program)(x)[0]))(X)
    np.testing.assert_array_equal(slope, X)


def test_effects_are_not_merged():
    printed = []

    def function(x):
        for _ in range(2):
            jax.debug.callback(printed.append, x)
        return x

    program = shared(jax.make_jaxpr(function)(X))
    jaxpr_as_fun(program)(X)
    jax.effects_barrier()
    assert len(printed) == 2


def test_a_program_called_twice_is_written_once():
    inner = jax.jit(twice)
    program, _ = traced(lambda x: inner(x) + inner(2.0 * x), X)
    calls = [e.params["jaxpr"] for e in program.jaxpr.eqns if "jaxpr" in e.params]
    assert len(calls) == 2
    assert calls[0] is calls[1]
