"""Each lane of a batch gives the result that it gives alone, for any number of lanes and any
results."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.lanes import FEW, each_lane


def _squares(lanes):
    return each_lane(lambda lane: {"square": lane["x"] ** 2, "sum": jnp.sum(lane["y"])}, lanes)


@pytest.mark.parametrize("count", [1, FEW, FEW + 1])
def test_lanes_are_what_each_is_alone(count):
    x = np.linspace(0.0, 1.0, count)
    found = _squares({"x": x, "y": np.outer(x, [1.0, 2.0])})
    np.testing.assert_allclose(found["square"], x**2, rtol=1e-15)
    np.testing.assert_allclose(found["sum"], 3 * x, rtol=1e-15)


@pytest.mark.parametrize("count", [3, FEW + 1])
def test_they_are_differentiated(count):
    x = jnp.linspace(0.1, 1.0, count)
    for jacobian in (jax.jacfwd, jax.jacrev):
        slopes = jacobian(lambda x: _squares({"x": x, "y": x[:, None]})["square"])(x)
        np.testing.assert_allclose(slopes, np.diag(2 * x), rtol=1e-15)


def test_few_lanes_make_one_program_of_one_lane():
    """Of few lanes the program holds one, which is what makes it small."""

    def shapes(count):
        traced = jax.make_jaxpr(lambda x: each_lane(jnp.sin, x))(jnp.zeros(count))
        return {v.aval.shape for eqn in traced.eqns for v in eqn.outvars}, [
            eqn.primitive.name for eqn in traced.eqns
        ]

    assert shapes(FEW)[1] == ["scan"]
    assert shapes(FEW + 1) == ({(FEW + 1,)}, ["sin"])


def test_impacts_one_after_another_and_side_by_side_agree():
    """The statuses are the same and the forces agree within what Newton's method leaves open,
    5e-7, for gradients in proportion to the norm."""
    masses = jnp.array([2.0, 8.0, 20.0])

    def force(mass):
        scene = fj.scenes.normal_impact(parcel=fj.Parcel(mass=mass), duration=0.05)
        result = fj.simulate(scene, only="peak_force")
        return result.peak_force, result.status

    both = jax.value_and_grad(force, has_aux=True)
    (apart, first), slopes = jax.jit(lambda m: each_lane(both, m))(masses)
    (beside, second), others = jax.jit(jax.vmap(both))(masses)
    np.testing.assert_array_equal(first, second)
    np.testing.assert_allclose(apart, beside, rtol=5e-7)
    np.testing.assert_allclose(slopes, others, rtol=1e-5)
