"""The loop of steps: the passes that JAX needs to vectorise it, its end whatever it saves at
samples, and derivatives of the saved values."""

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


# Step control takes more than ten trials for each sample here.
_TIGHT = fj.Fidelity.standard(step_tolerance=1e-6, halvings=5, modes=2)


@pytest.mark.parametrize(
    ("scene", "gradient"),
    [
        (fj.scenes.oblique_impact(duration=0.03), "forward"),
        (fj.scenes.normal_impact(duration=0.02), "forward"),
        (fj.scenes.normal_impact(duration=0.02), "reverse"),
    ],
    ids=["oblique", "normal", "reverse"],
)
def test_a_history_changes_no_result(scene, gradient):
    fidelity = _TIGHT.replace(gradient=gradient)
    alone = fj.simulate(scene, fidelity=fidelity, history=False)
    saved = fj.simulate(scene, fidelity=fidelity)
    assert saved.history.time[-1] == pytest.approx(saved.history.time[0] + float(scene.duration))
    assert saved.status == alone.status
    # The same operations, fused in another way.
    assert saved.peak_force == pytest.approx(float(alone.peak_force), rel=1e-9)


def test_a_history_has_the_same_derivative_in_reverse_mode():
    """Trials that step control rejects, and steps that end between two samples, are no samples."""

    def weighted(mass, gradient):
        scene = fj.scenes.normal_impact(duration=0.02, parcel=fj.Parcel(mass=mass))
        force = fj.simulate(scene, fidelity=fj.Fidelity.standard(gradient=gradient)).history
        # A sum that no sample cancels in, whatever their number.
        return jnp.sum(force.fence_force * jnp.cos(jnp.arange(force.fence_force.shape[0])))

    mass = jnp.asarray(10.0)
    forward, reverse = (
        jax.jit(jax.grad(weighted), static_argnums=1)(mass, by) for by in ("forward", "reverse")
    )
    # The same sum of derivatives in another order; they grow a thousandfold on the way.
    assert float(reverse) == pytest.approx(float(forward), rel=1e-8)
