"""The loop of steps: how often it is gone through to make a batch of it."""

import jax
import jax.numpy as jnp
import pytest
from passes import PASSES, counted

import fencejax as fj
from fencejax.results import accumulators

LAST = fj.Measure(
    "last_force", "N", "the force at the last sample", "at least 0",
    accumulators.Accumulator(
        "last_force", lambda nothing, body: nothing.fence_force,
        lambda state, step: counted(step.now.fence_force),
    ),
    lambda state: state,
)  # fmt: skip


def force(mass):
    scene = fj.scenes.normal_impact(parcel=fj.Parcel(mass=mass), duration=0.01)
    return fj.simulate(scene, measures=[LAST], only="last_force").last_force


def slope(mass):
    """In a direction that all lanes have in common."""
    return jax.jvp(force, (mass,), (jnp.ones(()),))[1]


@pytest.mark.parametrize("of", [force, slope])
def test_a_batch_takes_one_pass_through_the_steps(of):
    """JAX vectorises a loop's body again where one number of the carry is none a lane at the start
    and one a lane after the first trip: a second pass through thousands of operations."""
    PASSES.clear()
    jax.jit(jax.vmap(of)).trace(jnp.array([5.0, 15.0, 30.0]))
    assert len(PASSES) == 1
