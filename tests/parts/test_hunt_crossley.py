"""The contact law of Hunt and Crossley: its closed forms at a rigid wall, and an impact."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

import fencejax as fj

HuntCrossley = fj.contact_laws.HuntCrossley
LAW = HuntCrossley(6.065e5, 0.4947, 1.5)
POINT = {"stiffness": 6.065e5, "dissipation": 0.4947, "exponent": 1.5, "speed": 2.426, "mass": 15.0}


# --- The law ------------------------------------------------------------------------------------


def test_slopes_are_those_of_the_force_and_finite_at_the_onset():
    viscosity = 1.5 * 0.4947
    gap, rate = (
        q.ravel()
        for q in np.meshgrid([-0.01, -1e-12, 0.0, 1e-9, 1e-3, 0.02], [-30.0, -0.5, 0.0, 2.4])
    )
    every = jax.jit(jax.vmap(lambda d, v: LAW.force(d, v, viscosity)))(gap, rate)
    slopes = jax.vmap(
        jax.grad(lambda law, d, v: law.force(d, v, law.viscosity(15.0)).force, (0, 1, 2)),
        in_axes=(None, 0, 0),
    )(LAW, gap, rate)
    inside = gap > 0
    exact = 6.065e5 * np.where(inside, gap, 0.0) ** 1.5 * np.maximum(0.0, 1 + viscosity * rate)
    np.testing.assert_allclose(every.force, exact, rtol=1e-12)
    np.testing.assert_allclose(every.by_gap, slopes[1], rtol=1e-12)
    np.testing.assert_allclose(every.by_rate, slopes[2], rtol=1e-12)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(slopes))
    assert np.all(np.asarray(slopes[0].exponent)[~inside] == 0)


def test_stored_energy_is_the_work_of_the_force_at_rest():
    gaps = jnp.array([-0.01, 0.0, 1e-3, 0.02])
    still = jnp.zeros(4)
    deep = HuntCrossley(2e4, 0.3, 2.2, reference_depth=0.01)
    np.testing.assert_allclose(
        jax.vmap(jax.grad(deep.stored_energy))(gaps), deep.force(gaps, still, still).force,
        rtol=1e-12,
    )
    # k is the secant stiffness at the reference depth.
    np.testing.assert_allclose(deep.force(jnp.array(0.01), 0.0, 0.45).force, 2e4 * 0.01, rtol=1e-12)


# --- A rigid wall -------------------------------------------------------------------------------
# Along the blow m v dv/dD = -k D^n (1 + c v), c = 3/2 a, which separates:
# k D^(n+1) / (n + 1) = m / c^2 [h(c v_0) - h(c v)], h(x) = x - ln(1 + x). The parcel leaves at -e
# v_0 with h(-c e v_0) = h(c v_0), and the force along the way is k D^n (1 + c v).


def height(x):
    return x - jnp.log1p(x)


def force_at(share, x):
    """N [N] where the speed is `share` of that of approach."""
    c = 1.5 * x["dissipation"]
    n, scale = x["exponent"], x["mass"] / c**2
    left = height(c * x["speed"]) - height(c * share * x["speed"])
    depth = ((n + 1) * scale * left / x["stiffness"]) ** (1 / (n + 1))
    return x["stiffness"] * depth**n * (1 + c * share * x["speed"])


def exact(x):
    """Peak force [N] and speed of departure [m/s], with their derivatives by name."""
    found = minimize_scalar(lambda s: -float(force_at(s, x)), bounds=(0, 1), method="bounded",
                            options={"xatol": 1e-10})  # fmt: skip
    # At the peak the derivative in the share is 0: the others are the partial ones.
    peak, by_peak = jax.value_and_grad(lambda y: force_at(found.x, y))(x)
    c = 1.5 * x["dissipation"]

    def balance(speed, y):
        c = 1.5 * y["dissipation"]
        return height(c * y["speed"]) - height(-c * speed)

    gone = brentq(lambda v: float(balance(v, x)), 1e-6 * x["speed"], min(1 / c, x["speed"]) - 1e-9)
    by_speed, by_rest = jax.grad(balance, (0, 1))(gone, x)
    return (float(peak), gone), (by_peak, jax.tree.map(lambda q: -q / by_speed, by_rest))


STEP = 1e-4


@jax.jit
def struck(x):
    """The same as simulated: slopes, and with them values and status."""

    def run(x):
        law = HuntCrossley(x["stiffness"], x["dissipation"], x["exponent"])
        scene = fj.scenes.rigid_wall(
            speed=x["speed"], parcel=fj.Parcel(mass=x["mass"], contact=law), duration=0.06
        )
        only = ["peak_force", "final"]
        result = fj.simulate(scene, fidelity=fj.Fidelity(step=STEP, step_tolerance=None), only=only)
        found = (result.peak_force, result.final.y_rate)
        return found, (found, result.status)

    return jax.jacfwd(run, has_aux=True)(x)


@pytest.mark.parametrize(
    "changes",
    [{}, {"exponent": 2.2, "stiffness": 2e7, "dissipation": 0.2, "mass": 4.0}, {"speed": 0.5}],
)
def test_peak_and_restitution_at_a_rigid_wall(changes):
    # The scheme is of the second order: values to the square of a step over the time T in contact,
    # about 3 D_m / v. Slopes lose half an order where contact begins and ends: that in n goes with
    # D^n ln D, |ln D| being 5 at most here.
    x = POINT | changes
    expected, expected_slopes = exact(x)
    slopes, (values, status) = struck({name: jnp.asarray(value) for name, value in x.items()})
    assert int(status) == fj.Status.SUCCESSFUL
    energy = 0.5 * x["mass"] * x["speed"] ** 2
    deepest = ((x["exponent"] + 1) * energy / x["stiffness"]) ** (1 / (x["exponent"] + 1))
    allowed = (STEP * x["speed"] / (3 * deepest)) ** 2
    np.testing.assert_allclose(values, expected, rtol=allowed)
    for ours, theirs, size in zip(slopes, expected_slopes, expected, strict=True):
        for name in POINT:
            off = abs(float(ours[name] - theirs[name])) * x[name] / size
            assert off < 5 * allowed**0.75, name


def test_the_default_of_the_docstring_is_as_hard_as_the_papers_parcel():
    np.testing.assert_allclose(exact(POINT)[0], (3294.0, 0.4388 * 2.426), rtol=1e-3)


def test_wall_force_and_drop_height():
    # Of any law, by integration: against the closed form, and back to the height.
    parcel = fj.Parcel(contact=LAW)
    (peak, _), (by_peak, _) = exact(POINT)
    force, slope = jax.value_and_grad(lambda v: fj.shock.wall_force(v, parcel))(2.426)
    np.testing.assert_allclose(force, peak, rtol=1e-6)
    np.testing.assert_allclose(slope, by_peak["speed"], rtol=1e-4)
    height, rise = jax.value_and_grad(lambda f: fj.shock.drop_height(f, parcel))(force)
    np.testing.assert_allclose(height, 2.426**2 / (2 * 9.81), rtol=1e-9)
    np.testing.assert_allclose(rise, 2.426 / 9.81 / slope, rtol=1e-9)


# --- An impact ----------------------------------------------------------------------------------


def test_energy_of_an_oblique_impact():
    # The ledger holds the law's stored energy and what it dissipates: it closes at the order of the
    # step, and the loss is that of the law, between nothing and the energy of the blow.
    scene = fj.scenes.oblique_impact(
        parcel=fj.Parcel(contact=LAW), belt=None, velocity=(2.0, 0.0, 0.0), fence_friction=None,
        duration=0.1,
    )  # fmt: skip
    fidelity = fj.Fidelity.fast(geometry="small")

    @jax.jit
    def impact(scene):
        def run(scene):
            result = fj.simulate(scene, fidelity=fidelity, only=["peak_force", "energy"])
            return result.peak_force, result

        return jax.grad(run, has_aux=True)(scene)

    slopes, result = impact(scene)
    loss = float(result.energy.contact_loss)
    assert fj.holds(result)
    assert 0.1 < loss < 0.5 * 15 * 2.4**2
    assert abs(float(result.energy.residual)) < 0.01 * loss
    # The harder, the harder struck.
    assert float(slopes.parcel.contact.secant_stiffness) > 0
    assert all(np.isfinite(leaf) for leaf in jax.tree.leaves(slopes))


def test_numbers_of_the_law_have_names_and_units():
    scene = fj.scenes.rigid_wall(parcel=fj.Parcel(contact=LAW))
    path = fj.scene_numbers.resolve(scene, "dissipation")
    assert path == "parcel.contact.dissipation"
    assert fj.scene_numbers.number(scene, path).unit == "s/m"
    (value,) = fj.scene_numbers.read(scene, ["secant_stiffness"])
    assert float(value) == 6.065e5
    assert not [name for name in fj.scene_numbers.names(scene) if name == "parcel.stiffness"]
