"""The belt's edge under the parcel: the mean distance against quadrature, the forces beyond it,
and a parcel that slides off."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.fidelity import Smoothing
from fencejax.model import BeltContact, BeltEdge, strip_mean_distance
from fencejax.scenes import Body

LENGTH, BREADTH, WIDTH = 0.4, 0.3, 0.7
PARCEL = fj.Parcel(length=LENGTH, breadth=BREADTH)
BELT = fj.Belt(friction=fj.Friction(0.6, 0.6), edge=True)
WEIGHT = 15.0 * 9.81


def quadrature(angle, half_width, count=1500):
    """Mean distance of the points of the turned rectangle within a strip, by a grid of its points:
    weights of its cells by their share inside, so that the error goes with the cell's square."""
    x = ((np.arange(count) + 0.5) / count - 0.5) * LENGTH
    y = ((np.arange(count) + 0.5) / count - 0.5) * BREADTH
    x, y = np.meshgrid(x, y)
    across = x * np.sin(angle) + y * np.cos(angle)
    reach = 0.5 * (LENGTH * abs(np.sin(angle)) + BREADTH * abs(np.cos(angle))) / count
    share = np.clip(0.5 + 0.5 * (half_width - np.abs(across)) / reach, 0, 1)
    return float(np.sum(share * np.hypot(x, y)) / np.sum(share))


@pytest.fixture(scope="module")
def mean():
    def value(angle, half_width):
        return strip_mean_distance(jnp.asarray(LENGTH), jnp.asarray(BREADTH), angle, half_width)

    return jax.jit(jax.value_and_grad(value, argnums=(0, 1)))


@pytest.mark.parametrize(("angle", "half_width"), [(0.0, 0.07), (0.3, 0.1), (-1.1, 0.12)])
def test_mean_distance_is_the_quadrature(mean, angle, half_width):
    # Cells of 1/1500: some 1e-6 of the value; its differences of 1 % lose two digits.
    found, slopes = mean(jnp.asarray(angle), jnp.asarray(half_width))
    assert float(found) == pytest.approx(quadrature(angle, half_width), rel=1e-5)
    step = 4e-3
    by_angle = quadrature(angle + step, half_width) - quadrature(angle - step, half_width)
    by_width = quadrature(angle, half_width + step) - quadrature(angle, half_width - step)
    assert float(slopes[0]) == pytest.approx(by_angle / (2 * step), rel=5e-3, abs=2e-4)
    assert float(slopes[1]) == pytest.approx(by_width / (2 * step), rel=5e-3)


def test_mean_distance_at_its_ends(mean):
    # All of the rectangle, however turned, is its own closed form; a line is a quarter of itself.
    for angle in (0.0, 0.4, np.pi / 2):
        whole, slopes = mean(jnp.asarray(angle), jnp.asarray(1.0))
        assert float(whole) == pytest.approx(float(PARCEL.mean_distance), rel=1e-12)
        assert all(abs(float(slope)) < 1e-9 for slope in slopes)
    line, _ = mean(jnp.asarray(0.2), jnp.asarray(0.0))
    assert float(line) == pytest.approx(LENGTH / np.cos(0.2) / 4, rel=1e-3)


def test_what_a_linear_pressure_would_change():
    # The pressure that is linear and has no tension: over all of the part on the belt while C_s is
    # at least a third of it inside, else over three times the distance of C_s.
    s, x = (np.arange(300) + 0.5) / 300, ((np.arange(300) + 0.5) / 300 - 0.5) * LENGTH
    for inside in np.linspace(0.01, 0.149, 12):
        carries = inside + 0.5 * BREADTH
        carries = 3 * inside if inside < carries / 3 else carries
        # 1 + b (s - 1/2) over the part, s from the edge: its mean is where C_s is.
        pressure = 1 - 12 * (0.5 - inside / carries) * (s - 0.5)
        assert pressure.min() > -1e-9
        y = inside - s * carries
        linear = np.mean(pressure[:, None] * np.hypot(x[None], y[:, None]))
        uniform = np.mean(np.hypot(x[None], ((2 * s - 1) * inside)[:, None]))
        assert 0.95 * linear < uniform <= linear


def test_forces_are_those_of_what_carries():
    # Sliding without spin: mu m g at C_s on the belt; beyond it mu m g k^2 / (k^2 + delta^2) at the
    # edge, whose moment about C_s has the arm delta. With spin alone at E: mu N c.
    contact = BeltContact(
        BELT.speed, BELT.friction, jnp.asarray(WEIGHT), PARCEL.mean_distance,
        BeltEdge(BELT, PARCEL),
    )  # fmt: skip
    force = jax.jit(jax.vmap(lambda body: contact.force(body, Smoothing(1e-9, 1e-9))[0]))
    gyration = (LENGTH**2 + BREADTH**2) / 12
    # Far inside, over the edge, beyond it, beyond it while spinning about E, and gone.
    y = np.array([0.3, 0.65, 0.75, 0.75, 0.9])
    spin = np.array([0.0, 0.0, 0.0, 2.0, 0.0])
    body = Body(
        np.zeros(5), y, np.zeros(5), np.array([1.0, 1.0, 1.0, 2.0 - 0.05 * 2.0, 1.0]),
        np.zeros(5), spin,
    )  # fmt: skip
    found = force(Body(*map(jnp.asarray, body)))
    less = gyration / (gyration + 0.05**2)
    whole = 0.6 * WEIGHT
    np.testing.assert_allclose(found.x, [whole, whole, whole * less, 0.0, 0.0], atol=1e-6)
    moment = [0.0, 0.0, 0.05 * whole * less, -whole * less * LENGTH / 4, 0.0]
    centred = float(PARCEL.mean_distance / contact.edge.centred)
    moment[3] *= centred
    np.testing.assert_allclose(found.moment, moment, atol=1e-6)


def test_a_parcel_slides_off_and_its_energy_balances():
    # The ledger closes to the order of the step, and friction ends: with all of it the speed across
    # would fall by mu g t.
    belt = fj.Belt(friction=fj.Friction(0.6, 0.6), edge=True)
    scene = fj.scenes.free_motion(
        position=(0.0, 0.6), angle=0.2, velocity=(2.0, 1.8, 0.0), belt=belt, duration=0.2
    )
    energy = fj.simulate(scene, only=["energy"]).energy
    moved = sum(abs(float(term)) for term in jax.tree.leaves(energy))
    assert abs(float(energy.residual)) < 1e-3 * moved
    braked = 0.5 * 15.0 * ((1.8 - 0.6 * 9.81 * 0.2) ** 2 - 1.8**2)
    assert 0.9 * braked < float(energy.parcel_kinetic) < 0.3 * braked


def test_it_is_refused_as_a_number():
    with pytest.raises(TypeError, match="`edge` must be True or False"):
        fj.Belt(edge=0.7)
