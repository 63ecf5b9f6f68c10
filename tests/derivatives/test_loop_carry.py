"""The carry of a loop with all its tangents: the same numbers, and one pass of each kind."""

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import Primitive
from jax.interpreters import ad, mlir
from passes import PASSES, counted

from fencejax.derivatives import complete

GIVEN = jnp.asarray(0.7)


# The sine as an operation that notes how often it is differentiated.
SINE = Primitive("noted_sine")
SINE.def_impl(jnp.sin)
SINE.def_abstract_eval(lambda x: x)
mlir.register_lowering(SINE, mlir.lower_fun(jnp.sin, multiple_results=False))


def _differentiate(primals, tangents):
    PASSES.append(1)
    return SINE.bind(*primals), jnp.cos(primals[0]) * tangents[0]


ad.primitive_jvps[SINE] = _differentiate


def body(inner, carry, given):
    """A chain: what moves reaches one number more with each trip. The last number never moves, and
    the one before it counts."""
    a, b, c, d, count, still = carry
    return (inner(given * a), b + a, c + b, d + c, count + 1, jax.lax.stop_gradient(d) + still)


def looped(inner, start, given):
    carry = tuple(jnp.asarray(each) for each in (0.3, 0.1, 0.2, 0.4, 0.0, 0.0))

    def trip(carry, given):
        return body(inner, carry, given)

    return jax.lax.fori_loop(0, 5, lambda _, y: trip(y, given), start(carry, trip, given))


def begun(carry, trip, given):
    return carry


def passes_of(transformed):
    """How often the body is gone through with a complete carry, and with the carry as it is; the
    same operations give the same numbers."""
    found = []
    for start in (complete, begun):
        PASSES.clear()
        found.append((transformed(start), len(PASSES)))
    (ours, passes), (plain, more) = found
    jax.tree.map(np.testing.assert_array_equal, ours, plain)
    return passes, more


def test_a_derivative_takes_one_pass():
    passes, more = passes_of(
        lambda start: jax.jvp(lambda g: looped(SINE.bind, start, g), (GIVEN,), (1.0,))
    )
    assert passes == 1
    assert more > 3


def test_what_does_not_move_has_no_tangent():
    program = jax.make_jaxpr(
        lambda given: jax.jvp(lambda g: looped(jnp.sin, complete, g), (given,), (1.0,))
    )(GIVEN)
    (loop,) = (e for e in program.jaxpr.eqns if e.primitive.name in ("while", "scan"))
    # Six numbers, the tangents of the first four, and the trip counter.
    assert len(loop.outvars) == 11


def test_a_batch_takes_one_pass():
    lanes = GIVEN + jnp.arange(3.0)
    passes, more = passes_of(lambda start: jax.vmap(lambda g: looped(counted, start, g))(lanes))
    assert passes == 1
    assert more > 1


def test_derivatives_of_batches_and_the_other_way_round():
    lanes = GIVEN + jnp.arange(3.0)

    def last(start):
        return lambda given: sum(looped(jnp.sin, start, given)[:4])

    for transformed in (
        lambda f: jax.vmap(jax.grad(lambda x: f(x), argnums=0))(lanes),
        lambda f: jax.jacfwd(jax.vmap(f))(lanes),
        lambda f: jax.jit(jax.vmap(lambda t: jax.jvp(f, (GIVEN,), (t,))[1]))(lanes),
    ):
        # Round-off: the operations are the same, their order after fusion need not be.
        np.testing.assert_allclose(
            transformed(last(complete)), transformed(last(begun)), rtol=1e-14
        )


def test_nothing_is_added_where_nothing_is_transformed():
    plain = jax.jit(lambda given: looped(jnp.sin, begun, given)).lower(GIVEN).compile()
    ours = jax.jit(lambda given: looped(jnp.sin, complete, given)).lower(GIVEN).compile()
    assert ours.cost_analysis()["flops"] == plain.cost_analysis()["flops"]
