"""Derivatives by one batch of tangents: the same as plain ones, under every transformation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gate import equations

import fencejax as fj
from fencejax.derivatives import by_columns

EPS = np.finfo(float).eps
A, B = jnp.asarray(0.7), jnp.array([0.3, -1.1, 0.8, 2.0, 0.1, -0.4, 0.9])


def plain(inputs):
    """A map of pytrees with a loop, whose derivatives are all different."""
    a, b = inputs["a"], inputs["b"]

    def turn(_, carry):
        return jnp.sin(carry + a * b)

    end = jax.lax.fori_loop(0, 5, turn, b)
    return {"sum": jnp.sum(end**2), "end": end, "product": a * end[2]}


wrapped = by_columns(plain)


def inputs(a=A, b=B):
    return {"a": a, "b": b}


def assert_equal(ours, theirs):
    # Round-off of sums of a few products.
    jax.tree.map(
        lambda x, y: np.testing.assert_allclose(x, y, rtol=50 * EPS, atol=50 * EPS), ours, theirs
    )


def test_value_is_the_functions():
    assert_equal(wrapped(inputs()), plain(inputs()))
    assert_equal(jax.jit(wrapped)(inputs()), plain(inputs()))


def test_forward_derivative():
    direction = {"a": jnp.asarray(0.4), "b": jnp.linspace(-1.0, 1.0, 7)}
    ours = jax.jvp(wrapped, (inputs(),), (direction,))
    assert_equal(ours, jax.jvp(plain, (inputs(),), (direction,)))


def test_reverse_derivative():
    # Of a weighted sum of every output, so that no output's columns can be mixed up.
    def scalar(function):
        def weighted(x):
            out = function(x)
            weights = jnp.arange(1.0, 8.0)
            return 0.3 * out["sum"] + jnp.dot(weights, out["end"]) - 2 * out["product"]

        return weighted

    theirs = jax.grad(lambda x: scalar(unrolled)(x))(inputs())
    assert_equal(jax.grad(scalar(wrapped))(inputs()), theirs)
    assert_equal(jax.jit(jax.grad(scalar(wrapped)))(inputs()), theirs)


def unrolled(inputs):
    """`plain` written out, so that plain reverse mode differentiates it."""
    a, b = inputs["a"], inputs["b"]
    end = b
    for _ in range(5):
        end = jnp.sin(end + a * b)
    return {"sum": jnp.sum(end**2), "end": end, "product": a * end[2]}


def test_jacobians_both_ways():
    theirs = jax.jacrev(unrolled)(inputs())
    assert_equal(jax.jacrev(wrapped)(inputs()), theirs)
    assert_equal(jax.jacfwd(wrapped)(inputs()), theirs)


def test_batches():
    several = {"a": jnp.array([0.2, 0.7, 1.5]), "b": jnp.stack([B, 2 * B, B - 1])}
    assert_equal(jax.vmap(wrapped)(several), jax.vmap(plain)(several))

    def total(function):
        return lambda x: function(x)["sum"]

    ours = jax.jit(jax.vmap(jax.grad(total(wrapped))))(several)
    assert_equal(ours, jax.vmap(jax.grad(total(unrolled)))(several))
    # One input alone in a batch, the other shared.
    over_a = jax.vmap(lambda a: jax.grad(lambda a: wrapped(inputs(a))["sum"])(a))(several["a"])
    exact = jax.vmap(lambda a: jax.grad(lambda a: unrolled(inputs(a))["sum"])(a))(several["a"])
    assert_equal(over_a, exact)


def shapes(function, *arguments):
    """Every shape in the program of `function`, inner programs included."""
    return {
        tuple(getattr(variable.aval, "shape", ()))
        for equation in equations(jax.make_jaxpr(function)(*arguments).jaxpr)
        for variable in (*equation.invars, *equation.outvars)
    }


def test_inputs_at_rest_cost_no_columns():
    # One column for `a` alone, seven for `b` alone, eight for both: the tangents of `end` have
    # the shape (columns, 7).
    by_a = shapes(jax.grad(lambda a: wrapped(inputs(a))["sum"]), A)
    by_b = shapes(jax.grad(lambda b: wrapped(inputs(b=b))["sum"]), B)
    by_both = shapes(jax.grad(lambda x: wrapped(x)["sum"]), inputs())
    assert (1, 7) in by_a
    assert (7, 7) in by_b
    assert (8, 7) in by_both
    assert {(7, 7), (8, 7)}.isdisjoint(by_a)
    assert (8, 7) not in by_b


def test_an_input_that_is_differentiated_but_not_used_gets_zeros():
    gradient = jax.grad(lambda x: by_columns(lambda y: y["a"] ** 2)(x))(inputs())
    assert_equal(gradient, {"a": 2 * A, "b": jnp.zeros(7)})


def test_constants_in_a_derivative_make_no_columns():
    # Everything that goes in is cut off from what is differentiated.
    def cut(a):
        return wrapped(jax.lax.stop_gradient(inputs(a, a * B)))["sum"] + a

    assert {(1, 7), (7, 7), (8, 7)}.isdisjoint(shapes(jax.grad(cut), A))
    assert float(jax.grad(cut)(A)) == 1.0


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_type_of_the_inputs_is_kept(dtype):
    x = {"a": A.astype(dtype), "b": B.astype(dtype)}
    gradient = jax.grad(lambda x: wrapped(x)["sum"])(x)
    assert {leaf.dtype for leaf in jax.tree.leaves(gradient)} == {jnp.dtype(dtype)}
    assert wrapped(x)["end"].dtype == dtype


def test_memory_of_the_reverse_mode_grows_slower_than_the_steps():
    # Checkpoints: as the square root of the number of steps, where the trajectory would grow in
    # step with it.
    fidelity = fj.Fidelity(
        modes=1, static_correction=False, geometry="small", step=2e-4, gradient="reverse"
    )

    def memory(duration):
        def peak(thickness):
            scene = fj.scenes.normal_impact(fence=fj.Fence(thickness=thickness), duration=duration)
            return fj.simulate(scene, fidelity=fidelity, only=["peak_force"]).peak_force

        program = jax.jit(jax.grad(peak)).lower(0.045).compile()
        return program.memory_analysis().temp_size_in_bytes

    many, more = (memory(duration) for duration in (0.08, 0.32))
    assert more < 3 * many


def test_a_judge_sees_value_and_columns():
    """Here it takes out the derivatives of what has one that is not finite, lane by lane."""
    def judge(value, columns, at):
        fine = jnp.all(jnp.isfinite(columns["root"]))
        said = value | {"fine": fine.astype(float)}
        return said, jax.tree.map(lambda c: jnp.where(fine, c, 0.0), columns)

    def roots(x):
        return {"root": jnp.sqrt(x), "fine": jnp.ones(())}

    judged = by_columns(roots, judge)
    at = jnp.array([4.0, 0.0])
    slope = jax.vmap(jax.grad(lambda x: judged(x)["root"]))(at)
    fine = jax.vmap(lambda x: jax.jvp(judged, (x,), (jnp.ones(()),))[0]["fine"])(at)
    np.testing.assert_allclose(slope, [0.25, 0.0])
    np.testing.assert_array_equal(fine, [1.0, 0.0])
    # Without a derivative it is not asked.
    np.testing.assert_array_equal(jax.vmap(judged)(at)["fine"], [1.0, 1.0])


def test_second_derivatives():
    def total(function):
        return lambda x: function(x)["sum"] + 0.3 * function(x)["product"]

    theirs = jax.hessian(total(unrolled))(inputs())
    assert_equal(jax.hessian(total(wrapped))(inputs()), theirs)
    assert_equal(jax.jacrev(jax.grad(total(wrapped)))(inputs()), theirs)
    assert_equal(jax.jit(jax.jacfwd(jax.jacfwd(total(wrapped))))(inputs()), theirs)


def test_a_judge_sees_the_columns_of_the_second_derivative():
    def judge(value, columns, at):
        fine = jnp.all(jnp.isfinite(columns["power"]))
        said = value | {"fine": jnp.where(fine, value["fine"], 0.0)}
        return said, jax.tree.map(lambda c: jnp.where(fine, c, 0.0), columns)

    # x^1.5 has a first derivative at 0, and no second one.
    judged = by_columns(lambda x: {"power": x**1.5, "fine": jnp.ones(())}, judge)
    one = jnp.ones(())

    def second(x):
        def first(x):
            value, slope = jax.jvp(judged, (x,), (one,))
            return slope["power"], value["fine"]

        _, bend, fine = jax.jvp(first, (x,), (one,), has_aux=True)
        return bend, fine

    bend, fine = jax.vmap(second)(jnp.array([4.0, 0.0]))
    np.testing.assert_allclose(bend, [0.375, 0.0])
    np.testing.assert_array_equal(fine, [1.0, 0.0])
