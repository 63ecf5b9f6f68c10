"""Friction after Stribeck, against quadrature: a parcel that is braked by the belt."""

import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

import fencejax as fj
from fencejax.fidelity import Smoothing
from fencejax.model import belt_grip, corner_share

GRAVITY, DURATION, SPEED = 9.81, 0.2, 2.0
POINT = {"kinetic": 0.3, "static": 0.55, "stribeck_speed": 0.8, "viscous": 0.06}
SMOOTHING = Smoothing(slip_speed=1e-2, static_speed=5e-2)


def test_slopes_are_those_of_the_forces():
    law = fj.friction_laws.Stribeck(0.3, 0.5, 0.04, viscous=0.2)
    speeds = np.array([-2.0, -0.3, -0.011, -1e-4, 0.0, 1e-8, 0.004, 0.03, 1.0])
    share = jax.vmap(jax.value_and_grad(lambda w: corner_share(law, w, SMOOTHING)[0]))(speeds)
    ours = corner_share(law, speeds, SMOOTHING)
    np.testing.assert_allclose(ours[1], share[1], rtol=1e-12, atol=1e-13 * 0.5 / 1e-2)
    mu = 0.3 + 0.2 * np.exp(-((speeds / 0.04) ** 2)) + 0.2 * np.abs(speeds)
    exact = -mu * speeds / np.sqrt(speeds**2 + 1e-4)
    np.testing.assert_allclose(ours[0], exact, rtol=1e-13)
    squares = speeds[speeds > 0] ** 2
    grip = jax.vmap(jax.grad(lambda s: belt_grip(law, 100.0, s, SMOOTHING)[0]))(squares)
    np.testing.assert_allclose(belt_grip(law, 100.0, squares, SMOOTHING)[1], grip, rtol=1e-12)
    by_law = jax.grad(lambda law: belt_grip(law, 100.0, jnp.asarray(0.0), SMOOTHING)[0])(law)
    assert all(np.isfinite(leaf) for leaf in jax.tree.leaves(by_law))


@jax.jit
def braked(x):
    """Slip [m/s] that is left of a parcel put on the belt at rest: slopes, and with them values."""

    def run(x):
        belt = fj.Belt(speed=SPEED, friction=fj.friction_laws.Stribeck(**x), gravity=GRAVITY)
        scene = fj.scenes.free_motion(velocity=(0.0, 0.0, 0.0), belt=belt, duration=DURATION)
        result = fj.simulate(scene, only=["final"])
        return SPEED - result.final.x_rate, (SPEED - result.final.x_rate, result.status)

    return jax.grad(run, has_aux=True)({name: jnp.asarray(value) for name, value in x.items()})


def test_a_parcel_braked_by_the_belt():
    # u' = -g mu(u): the time from u_0 to u is the integral of du / (g mu), whose derivative in u is
    # -1 / (g mu) and in a number p the integral of -mu_p / (g mu^2).
    x = POINT

    def mu(u):
        fall = np.exp(-((u / x["stribeck_speed"]) ** 2))
        return x["kinetic"] + (x["static"] - x["kinetic"]) * fall + x["viscous"] * u

    def slope(name, u):
        fall = np.exp(-((u / x["stribeck_speed"]) ** 2))
        by_speed = 2 * u**2 / x["stribeck_speed"] ** 3 * (x["static"] - x["kinetic"]) * fall
        return {
            "kinetic": 1 - fall, "static": fall, "stribeck_speed": by_speed, "viscous": u
        }[name]  # fmt: skip

    def integral(f, u):
        return quad(f, u, SPEED, epsabs=1e-13, epsrel=1e-12)[0]

    left = brentq(lambda u: integral(lambda w: 1 / (GRAVITY * mu(w)), u) - DURATION, 0.5, 2.0,
                  xtol=1e-13)  # fmt: skip
    slopes, (value, status) = braked(x)
    assert int(status) == fj.Status.SUCCESSFUL
    # Smoothing takes eps^2 / (2 u^2) = 1e-7 of the force; the scheme is of the second order, with
    # the square of 2.5e-4 s over the 0.2 s in which the speed halves: 1.6e-6.
    np.testing.assert_allclose(value, left, rtol=2e-6)
    for name in x:
        by = integral(lambda u, name=name: -slope(name, u) / (GRAVITY * mu(u) ** 2), left)
        np.testing.assert_allclose(slopes[name], by * GRAVITY * mu(left), rtol=1e-5)


def test_a_parcel_that_comes_to_rest_stays():
    # After 2 / (9.81 1.5) = 0.14 s at most; what is left of the slip has no number to follow.
    slopes, (value, status) = braked(POINT | {"kinetic": 1.5, "static": 2.0})
    assert int(status) == fj.Status.SUCCESSFUL
    assert abs(float(value)) < 0.1 * fj.Fidelity.standard().slip_speed
    assert all(abs(float(slope)) < 1e-3 for slope in slopes.values())


def test_numbers_of_the_law_have_names_and_units():
    law = fj.friction_laws.Stribeck(**POINT)
    scene = fj.scenes.whole_sort(belt=fj.Belt(friction=law), fence_friction=law)
    path = fj.scene_numbers.resolve(scene, "belt.friction.stribeck_speed")
    assert fj.scene_numbers.number(scene, path).unit == "m/s"
    assert fj.scene_numbers.resolve(scene, "belt_kinetic_friction") == "belt.friction.kinetic"
    assert fj.scene_numbers.number(scene, "fence_friction.viscous").unit == "s/m"
