"""Dry friction: the coefficient, the corner's share and the belt's limit surface."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fencejax import Friction
from fencejax.fidelity import Smoothing
from fencejax.model import BeltContact, belt_grip, corner_share
from fencejax.scenes import Body

FRICTION = Friction(kinetic=0.35, static=0.5)
SMOOTHING = Smoothing(slip_speed=1e-2, static_speed=5e-2)
SPEEDS = np.array([-2.0, -0.3, -0.06, -0.011, -1e-4, 0.0, 1e-4, 0.004, 0.03, 0.1, 1.0])
WEIGHT = 15 * 9.81
ARM = 0.13  # c, the mean distance


def mu_at(square):
    return FRICTION.coefficient(square, SMOOTHING.static_speed)


def test_coefficient_goes_from_static_to_kinetic():
    # mu = mu_k + (mu_s - mu_k) exp(-(w / w_s)^2): mu_s at rest, the e-th part of the excess at w_s,
    # and less than e^-36 of it at 6 w_s.
    mu = [float(mu_at(jnp.asarray(w**2))[0]) for w in (0, 0.05, 0.3)]
    np.testing.assert_allclose(mu, [0.5, 0.35 + 0.15 / np.e, 0.35], rtol=0, atol=1e-15)


def test_derivative_of_the_coefficient():
    value = jax.jit(jax.vmap(jax.grad(lambda s: mu_at(s)[0])))(SPEEDS**2)
    ours = mu_at(SPEEDS**2)[1]
    np.testing.assert_allclose(ours, value, rtol=1e-13)


def test_corner_friction_opposes_the_sliding():
    # -mu(w) w / sqrt(w^2 + eps^2): odd, against w, never above mu_s, mu_k at speed up to
    # eps^2 / (2 w^2), and dissipating.
    share = np.array(corner_share(FRICTION, SPEEDS, SMOOTHING)[0])
    mu = 0.35 + 0.15 * np.exp(-((SPEEDS / 0.05) ** 2))
    exact = -mu * SPEEDS / np.sqrt(SPEEDS**2 + 1e-4)
    np.testing.assert_allclose(share, exact, rtol=1e-13)
    assert np.all(share * SPEEDS <= 0)
    assert np.all(np.abs(share) <= 0.5)
    np.testing.assert_allclose(share, -np.array(corner_share(FRICTION, -SPEEDS, SMOOTHING)[0]))
    fast = float(corner_share(FRICTION, jnp.asarray(2.0), SMOOTHING)[0])
    assert 0 < fast + 0.35 < 0.35 * 1e-4 / 8 * 1.01


def test_derivative_of_the_corner_friction():
    slope = jax.grad(lambda w: corner_share(FRICTION, w, SMOOTHING)[0])
    value = jax.jit(jax.vmap(slope))(SPEEDS)
    ours = corner_share(FRICTION, SPEEDS, SMOOTHING)[1]
    # Terms cancel where the friction has its maximum: round-off on the largest of them.
    np.testing.assert_allclose(ours, value, rtol=1e-12, atol=1e-13 * 0.5 / 1e-2)
    # At rest the slope is -mu_s / eps.
    at_rest = float(corner_share(FRICTION, jnp.asarray(0.0), SMOOTHING)[1])
    np.testing.assert_allclose(at_rest, -0.5 / 1e-2, rtol=1e-14)


def test_derivative_of_the_grip():
    squares = np.array([0.0, 1e-8, 1e-5, 1e-4, 3e-3, 0.04, 4.0])
    slope = jax.grad(lambda s: belt_grip(FRICTION, WEIGHT, s, SMOOTHING)[0])
    value = jax.jit(jax.vmap(slope))(squares)
    ours = belt_grip(FRICTION, WEIGHT, squares, SMOOTHING)[1]
    np.testing.assert_allclose(ours, value, rtol=1e-12)


def belt_load(slip_x, slip_y, spin, friction, smoothing):
    """F_1 = grip u, T = -grip c^2 phidot, the dissipation, and F_max."""
    square = slip_x**2 + slip_y**2 + (ARM * spin) ** 2
    grip = np.array(belt_grip(friction, WEIGHT, square, smoothing)[0])
    largest = WEIGHT * np.array(friction.coefficient(square, smoothing.static_speed)[0])
    force = (grip * slip_x, grip * slip_y)
    moment = -grip * ARM**2 * spin
    return force, moment, force[0] * slip_x + force[1] * slip_y - moment * spin, largest, square


@pytest.fixture(scope="module")
def motions():
    rng = np.random.default_rng(5)
    size = 10 ** rng.uniform(-4, 0.5, 300)
    direction = rng.normal(size=(3, 300))
    direction /= np.linalg.norm(direction, axis=0)
    return direction[0] * size, direction[1] * size, direction[2] * size / ARM


@pytest.mark.parametrize("slip_speed", [1e-2, 1e-5])
def test_belt_load_stays_within_the_limit_surface(slip_speed, motions):
    # (|F| / F_max)^2 + (T / (c F_max))^2 = s^2 / (s^2 + eps^2) <= 1, so 1 as eps -> 0.
    smoothing = Smoothing(slip_speed, 5e-2)
    (fx, fy), moment, _, largest, square = belt_load(*motions, FRICTION, smoothing)
    surface = (fx**2 + fy**2) / largest**2 + (moment / (ARM * largest)) ** 2
    np.testing.assert_allclose(surface, square / (square + slip_speed**2), rtol=1e-12)
    assert np.all(surface <= 1 + 1e-12)
    if slip_speed == 1e-5:  # s >= 1e-4 here
        assert np.all(surface > 1 - 1.01e-2)


def test_belt_force_is_the_gradient_of_its_dissipation(motions):
    # With one coefficient the limit surface is that of a dissipation function: the load is minus
    # the gradient of F_max sqrt(s^2 + eps^2) in (u_x, u_y, phidot), so normal to it (Goyal).
    belt = BeltContact(jnp.asarray(2.0), Friction(0.4, 0.4), jnp.asarray(WEIGHT), jnp.asarray(ARM))

    def body(rates):
        return Body(0.0, 0.0, 0.0, rates[0] + 2.0, rates[1], rates[2])

    def potential(rates):
        square = rates[0] ** 2 + rates[1] ** 2 + (ARM * rates[2]) ** 2
        return 0.4 * WEIGHT * jnp.sqrt(square + SMOOTHING.slip_speed**2)

    rates = jnp.stack([jnp.asarray(motion) for motion in motions], 1)
    load = jax.vmap(lambda r: jnp.stack(belt.force(body(r), SMOOTHING)[0][:3]))(rates)
    np.testing.assert_allclose(load, -jax.vmap(jax.grad(potential))(rates), rtol=1e-9, atol=1e-9)


def test_belt_force_dissipates(motions):
    # What `force` says that friction takes is the power of its load against the slip, above 0 and
    # at most F_max s, which it reaches as eps / s -> 0.
    belt = BeltContact(jnp.asarray(2.0), FRICTION, jnp.asarray(WEIGHT), jnp.asarray(ARM))
    x, y, spin = (jnp.asarray(motion) for motion in motions)
    load, _ = belt.force(Body(0.0, 0.0, 0.0, x + 2.0, y, spin), SMOOTHING)
    power = -np.array(load.x * x + load.y * y + load.moment * spin)
    # The slip is a difference of speeds of some m/s: round-off on them.
    np.testing.assert_allclose(load.dissipated, power, rtol=1e-9)
    size = np.sqrt(x**2 + y**2 + (ARM * spin) ** 2)
    most = WEIGHT * np.array(mu_at(size**2)[0]) * size
    assert np.all(power > 0)
    ratio = size / np.sqrt(size**2 + SMOOTHING.slip_speed**2)
    np.testing.assert_allclose(power, most * ratio, rtol=1e-9)


def test_belt_drags_a_sliding_parcel_along_with_the_kinetic_force():
    # No spin, 2 m/s too slow: F = mu_k m g along +x, up to eps^2 / (2 s^2) = 1.25e-5.
    (fx, fy), moment, _, _, _ = belt_load(2.0, 0.0, 0.0, Friction(0.65, 0.85), SMOOTHING)
    np.testing.assert_allclose(fx, 0.65 * WEIGHT, rtol=1.3e-5)
    assert float(fy) == 0.0
    assert float(moment) == 0.0
    # Spin alone: T = -mu_k m g c, against the spin.
    (fx, _), moment, _, _, _ = belt_load(0.0, 0.0, 2.0 / ARM, Friction(0.65, 0.85), SMOOTHING)
    np.testing.assert_allclose(moment, -0.65 * WEIGHT * ARM, rtol=1.3e-5)
    assert float(fx) == 0.0
