"""Batches of scenes, and results in doubt computed again."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from robustness.random_scenes import impacts

import fencejax as fj

# Friction smoothed so far that some lanes are in doubt.
COARSE = fj.Fidelity.coarse(slip_speed=2e-3, static_speed=1e-2)


def scenes():
    return impacts(5, 24, 0.1)


@functools.cache
def results():
    """A batch as it is, and refined."""
    lanes = scenes()
    return tuple(
        fj.simulate_many(lanes, fidelity=COARSE, only="peak_force", refine=refine)
        for refine in (False, True)
    )


def doubtful(result):
    return np.array([fj.Status(int(s)).numerical for s in result.status])


def test_simulate_many_computes_doubtful_lanes_again_and_no_others():
    plain, refined = results()
    doubts = doubtful(plain)
    assert 0 < doubts.sum() < doubts.size
    np.testing.assert_array_equal(refined.rung > 0, doubts)
    np.testing.assert_array_equal(refined.peak_force[~doubts], plain.peak_force[~doubts])
    assert doubtful(refined).sum() < doubts.sum()
    # What is still in doubt went up the whole ladder.
    assert np.all(refined.rung[doubtful(refined)] == len(COARSE.ladder()) - 1)


def test_simulate_refines_as_the_batch_does():
    _, refined = results()
    lane = int(np.argmax(refined.rung))
    scene = jax.tree.map(lambda leaf: leaf[lane], scenes())
    one = fj.simulate(scene, fidelity=COARSE, only="peak_force", refine=True)
    assert int(one.rung) == refined.rung[lane]
    # A lane of a batch takes the same steps and iterations as alone: what differs is the rounding
    # of programs compiled apart, which the contact's thousand steps add up.
    assert float(one.peak_force) == pytest.approx(refined.peak_force[lane], rel=1e-11)


def test_refusals():
    with pytest.raises(TypeError, match="refine=True needs concrete numbers"):
        jax.jit(lambda v: fj.simulate(fj.scenes.rigid_wall(speed=v), refine=True))(2.0)
    with pytest.raises(ValueError, match="`scenes` must have the lanes as the first axis"):
        fj.simulate_many(fj.scenes.rigid_wall())
    walls = jax.vmap(lambda v: fj.scenes.rigid_wall(speed=v))(jnp.array([1.0, 2.0]))
    with pytest.raises(ValueError, match="`only` must not hold 'history'"):
        fj.simulate_many(walls, only=("history",))
