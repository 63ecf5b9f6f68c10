"""Sliding that stops and turns round within a few steps: light parcels, grippy fence."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj

LANES = 64
FINE = dict(step=6.25e-5, slip_speed=2e-4, static_speed=1e-3)


@pytest.fixture(scope="module")
def parcels():
    rng = np.random.default_rng(0)
    return {
        "mass": np.exp(rng.uniform(np.log(0.2), np.log(2.0), LANES)),
        "length": rng.uniform(0.2, 0.5, LANES),
        "breadth": rng.uniform(0.2, 0.4, LANES),
        "grip": rng.uniform(0.25, 0.5, LANES),
        "distance": rng.uniform(0.75, 1.1, LANES),
        "angle": rng.uniform(0.25, 0.5, LANES),
    }


def peaks(parcels, fidelity):
    @jax.jit
    @jax.vmap
    def run(x):
        scene = fj.scenes.oblique_impact(
            parcel=fj.Parcel(mass=x["mass"], length=x["length"], breadth=x["breadth"]),
            fence_friction=fj.Friction(kinetic=x["grip"], static=x["grip"] / 0.7),
            distance=x["distance"], drive_angle=x["angle"], duration=0.08,
        )  # fmt: skip
        result = fj.simulate(scene, fidelity=fidelity, only=("peak_force",))
        return result.peak_force, result.status

    return jax.device_get(run(jax.tree.map(jnp.asarray, parcels)))


@pytest.fixture(scope="module")
def fine(parcels):
    return peaks(parcels, fj.Fidelity.standard(**FINE))


# What the rungs promise of ordinary impacts in 95 % of them, and half as much again.
@pytest.mark.parametrize(
    ("rung", "promise"), [("coarse", 2.5e-3), ("fast", 1.2e-3), ("standard", 5e-4)]
)
def test_every_step_finds_its_forces(parcels, fine, rung, promise):
    # Friction that falls from static to kinetic bends both ways, and falls faster than the inertia
    # of a light parcel over a step holds against: Newton's own steps go to and fro there, or to a
    # fold of the equations, and leave a tenth of the force unbalanced in 8 to 20 of these lanes.
    found, status = peaks(parcels, getattr(fj.Fidelity, rung)(modes=4))
    np.testing.assert_array_equal(status, fj.Status.SUCCESSFUL)
    np.testing.assert_array_equal(fine[1], fj.Status.SUCCESSFUL)
    np.testing.assert_allclose(found, fine[0], rtol=promise)
