"""The parcel's geometry and the contact law."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import dblquad

from fencejax import Parcel
from fencejax.model import fade
from fencejax.parts import AbstractContactLaw, Kelvin

EPS = np.finfo(float).eps

# --- Parcel -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("length", "breadth", "x", "y"),
    [
        (0.4, 0.3, 0.0, 0.0),
        (0.4, 0.3, 0.07, -0.11),
        (0.4, 0.3, -0.2, 0.1),  # on the edge
        (0.4, 0.3, 0.2, -0.15),  # at a corner
        (1.0, 1e-3, 0.1, 0.0),  # a lath: (1/4 + x^2) for a line
    ],
)
def test_mean_distance_is_the_integral(length, breadth, x, y):
    # c = 1 / (A B) integral of |r - r_s|; the quadrature is cut at C_s, where the integrand is not
    # smooth, and asked for 1e-11.
    def distance(v, u):
        return np.hypot(u, v)

    total = 0.0
    for low_x, high_x in ((-length / 2 - x, 0.0), (0.0, length / 2 - x)):
        for low_y, high_y in ((-breadth / 2 - y, 0.0), (0.0, breadth / 2 - y)):
            if high_x > low_x and high_y > low_y:
                piece, _ = dblquad(
                    distance, low_x, high_x, low_y, high_y, epsabs=1e-14, epsrel=1e-11
                )
                total += piece
    ours = Parcel(length=length, breadth=breadth, center_x=x, center_y=y).mean_distance
    np.testing.assert_allclose(ours, total / (length * breadth), rtol=1e-9)


def test_mean_distance_of_a_square():
    # (sqrt(2) + asinh(1)) / 6 times the side.
    ours = Parcel(length=0.5, breadth=0.5).mean_distance
    np.testing.assert_allclose(ours, 0.5 * (np.sqrt(2) + np.arcsinh(1)) / 6, rtol=10 * EPS)


slopes = jax.jit(
    jax.value_and_grad(
        lambda a, b, x, y: Parcel(length=a, breadth=b, center_x=x, center_y=y).mean_distance,
        argnums=(0, 1, 2, 3),
    )
)


def test_gradient_of_the_mean_distance():
    # Central differences, d^2 / 6 times third derivatives (below 1e3), round-off eps / d = 2e-11.
    numbers, d = np.array([0.4, 0.3, 0.07, -0.11]), 1e-5
    _, ours = slopes(*numbers)
    for k in range(4):
        step = d * np.eye(4)[k]
        difference = (slopes(*(numbers + step))[0] - slopes(*(numbers - step))[0]) / (2 * d)
        np.testing.assert_allclose(ours[k], difference, rtol=0, atol=1e-7)


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (0.2, 0.0), (0.2, 0.15), (-0.2, 0.15)])
def test_gradient_of_the_mean_distance_is_finite_at_the_edges(x, y):
    value, ours = slopes(0.4, 0.3, x, y)
    assert np.isfinite(value)
    assert np.all(np.isfinite(ours))
    if x == y == 0:  # the centre is the place of least mean distance, by symmetry exactly
        np.testing.assert_allclose(ours[2:], 0.0, atol=10 * EPS)
    else:  # outwards the mean distance grows
        assert float(ours[2]) * x >= 0
        assert abs(float(ours[2])) > 0.1


@pytest.mark.parametrize("edge", [0.2, -0.2])
def test_mean_distance_is_smooth_up_to_the_edge(edge):
    # One-sided difference from within, error d times a second derivative below 10 / A.
    d = 1e-6
    at_edge, ours = slopes(0.4, 0.3, edge, 0.02)
    inside, _ = slopes(0.4, 0.3, edge - np.sign(edge) * d, 0.02)
    np.testing.assert_allclose(
        ours[2], (at_edge - inside) / d * np.sign(edge), rtol=0, atol=1e-4
    )


def test_corners_go_round():
    # 1 leading lower, 2 trailing lower, 3 trailing upper, 4 leading upper, from C_s.
    parcel = Parcel(length=0.4, breadth=0.3, center_x=0.05, center_y=-0.02)
    exact = [(0.15, -0.13), (-0.25, -0.13), (-0.25, 0.17), (0.15, 0.17)]
    for number, corner in zip((1, 2, 3, 4), exact, strict=True):
        np.testing.assert_allclose(parcel.corner(number), corner, rtol=10 * EPS)


def test_inertia_follows_the_mass_unless_given():
    # m (A^2 + B^2) / 12, derivative in the mass (A^2 + B^2) / 12.
    exact = (0.4**2 + 0.3**2) / 12
    value, slope = jax.value_and_grad(lambda m: Parcel(mass=m).inertia)(6.0)
    np.testing.assert_allclose((value, slope), (6 * exact, exact), rtol=4 * EPS)
    value, slope = jax.value_and_grad(lambda m: Parcel(mass=m, inertia=0.3).inertia)(6.0)
    assert (float(value), float(slope)) == (0.3, 0.0)


# --- Contact law --------------------------------------------------------------------------------

STIFFNESS, VISCOSITY = 1.72e9, 3.3e5 * 15**0.4
LAW = Kelvin()
kelvin = jax.jit(lambda d, v, c: LAW.force(d, v, c))
GAPS = np.array([-0.01, -1e-12, 0.0, 1e-9, 1e-4, 2e-3, 0.01, 0.03])
RATES = np.array([-30.0, -2.0, -1e-3, 0.0, 0.5, 2.4])

force_slopes = jax.jit(
    jax.vmap(
        jax.value_and_grad(lambda d, v: kelvin(d, v, VISCOSITY).force, (0, 1)),
    )
)


def grid():
    gap, rate = np.meshgrid(GAPS, RATES, indexing="ij")
    return gap.ravel(), rate.ravel()


def test_viscosity_grows_with_the_mass():
    parcel = Parcel()
    np.testing.assert_allclose(
        parcel.contact_law.viscosity(parcel.mass), VISCOSITY, rtol=10 * EPS
    )


def test_a_parcel_has_one_contact_law():
    # The paper's numbers are the parcel's own; with another law they are not there at all.
    law = Parcel(stiffness=2e9, damping=1e5).contact_law
    assert (float(law.stiffness), float(law.damping)) == (2e9, 1e5)
    other = Parcel(contact=Kelvin(1e9, 0.0))
    assert (other.stiffness, other.damping) == (None, None)
    assert float(other.contact_law.stiffness) == 1e9
    with pytest.raises(ValueError, match=r"`damping` must be None where `contact` is given, but"):
        Parcel(damping=1e5, contact=Kelvin())
    with pytest.raises(ValueError, match=r"`stiffness` must be at least 0 \[N/m\^4\], but is -1"):
        Kelvin(stiffness=-1.0)


@pytest.mark.parametrize(("speed", "damping"), [(2.426, 3.3e5), (0.5, 3.3e5), (3.0, 0.0)])
def test_peak_at_a_wall_by_integration_is_that_of_the_table(speed, damping):
    # Two ways to the same number: the table interpolates f to 1e-6 (600 nodes over 4.8), the
    # integration has 200 steps of a fourth-order rule over the time of penetration.
    law = Kelvin(damping=damping)
    integrated = AbstractContactLaw.wall_force(law, speed, 15.0)
    np.testing.assert_allclose(law.wall_force(speed, 15.0), integrated, rtol=1e-5)

def test_force_is_the_modified_kelvin_law():
    # N = max(0, b m^0.4 Ddot D^2 + k D^4) for D > 0, else 0.
    gap, rate = grid()
    law = kelvin(gap, rate, VISCOSITY)
    exact = np.where(gap > 0, VISCOSITY * rate * gap**2 + STIFFNESS * gap**4, 0.0)
    exact = np.maximum(exact, 0.0)
    np.testing.assert_allclose(law.force, exact, rtol=1e-12)
    assert np.sum(exact > 0) > 10
    assert np.sum((exact == 0) & (gap > 0)) > 3  # pulled apart: never negative
    assert np.all(law.force >= 0)


def test_force_derivatives_by_hand_are_those_of_the_force():
    gap, rate = grid()
    law = kelvin(gap, rate, VISCOSITY)
    value, (by_gap, by_rate) = force_slopes(gap, rate)
    np.testing.assert_allclose(value, law.force, rtol=1e-14)
    np.testing.assert_allclose(law.by_gap, by_gap, rtol=1e-12)
    np.testing.assert_allclose(law.by_rate, by_rate, rtol=1e-12)


@pytest.mark.parametrize("rate", [-2.4, 0.0, 2.4])
def test_onset_is_continuously_differentiable(rate):
    # At D = d: N <= (b |v| + k d^2) d^2 and dN/dD <= (2 b |v| + 4 k d^2) d: both go to 0 with d,
    # where a linear spring's derivative would jump.
    for d in (1e-4, 1e-6, 1e-8):
        law = kelvin(jnp.asarray(d), jnp.asarray(rate), VISCOSITY)
        assert float(law.force) <= (VISCOSITY * abs(rate) + STIFFNESS * d**2) * d**2 * 1.001
        assert abs(float(law.by_gap)) <= (2 * VISCOSITY * abs(rate) + 4 * STIFFNESS * d**2) * d
        assert float(law.by_rate) <= VISCOSITY * d**2
    at_zero = kelvin(jnp.asarray(0.0), jnp.asarray(rate), VISCOSITY)
    assert [float(x) for x in at_zero] == [0.0, 0.0, 0.0]


def test_stored_energy_is_the_work_of_the_elastic_part():
    # d/dD (k D^5 / 5) = k D^4, the force at rest.
    gaps = jnp.array([-0.01, 0.0, 1e-3, 0.02])
    slope = jax.vmap(jax.grad(lambda d: LAW.stored_energy(d)))(gaps)
    at_rest = kelvin(gaps, jnp.zeros(4), VISCOSITY).force
    np.testing.assert_allclose(slope, at_rest, rtol=1e-12)
    assert float(LAW.stored_energy(jnp.asarray(-0.1))) == 0.0


def test_fade_ends_the_force_smoothly():
    # 1 on the fence, 0 from the length on, 1/2 in the middle, level at both ends, monotone.
    length = 5e-3
    x = jnp.linspace(-0.01, 0.01, 401)
    share = fade(x, length)
    assert np.all(share[x <= 0] == 1)
    np.testing.assert_allclose(share[x >= length - 1e-12], 0.0, atol=4 * EPS)
    np.testing.assert_allclose(fade(jnp.asarray(length / 2), length), 0.5, rtol=10 * EPS)
    assert np.all(np.diff(share) <= EPS)
    slope = jax.vmap(jax.grad(lambda d: fade(d, length)))
    ends = np.array([0.0, 1e-9, length - 1e-9, length])
    # 1 - 3 s^2 + 2 s^3: slope 6 s (1 - s) / length near the ends.
    np.testing.assert_allclose(slope(ends), 0.0, atol=6 * 1e-9 / length**2 * 1.01)
    np.testing.assert_allclose(slope(np.array([length / 2])), -1.5 / length, rtol=1e-12)
