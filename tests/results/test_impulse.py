"""The fence's impulse: its value, and derivatives that do not ripple with the time of
separation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fencejax as fj

STANDARD = fj.Fidelity.standard()
MASS, STIFFNESS, DAMPING = 15.0, 1.72e9, 3.3e5
SPEEDS = np.linspace(0.5, 4.0, 36)


def on_the_wall(fidelity):
    """Impulse over m v [1], and the elasticities of the impulse in (m, v, k_p, b_p)."""

    def impulse(shares, speed):
        mass, faster, stiffness, damping = jnp.exp(shares)
        parcel = fj.Parcel(
            mass=MASS * mass, stiffness=STIFFNESS * stiffness, damping=DAMPING * damping
        )
        scene = fj.scenes.rigid_wall(speed=speed * faster, parcel=parcel)
        return jnp.log(fj.simulate(scene, fidelity=fidelity, only="impulse").impulse)

    along = jax.jit(jax.vmap(jax.value_and_grad(impulse), in_axes=(None, 0)))
    value, slopes = map(np.asarray, along(jnp.zeros(4), jnp.asarray(SPEEDS)))
    return np.exp(value) / (MASS * SPEEDS), slopes


def restitution(speed):
    """Of the wall, by SciPy: m D'' = -D^2 (b_p m^0.4 D' + k_p D^2) until the force is 0 again."""
    viscosity = DAMPING * MASS**0.4

    def rates(time, state):
        gap, rate = state
        return rate, -gap * gap * (viscosity * rate + STIFFNESS * gap * gap) / MASS

    def force(time, state):
        return viscosity * state[1] + STIFFNESS * state[0] ** 2

    force.terminal, force.direction = True, -1
    found = solve_ivp(rates, (0, 1), (0, speed), "DOP853", events=force, rtol=1e-11, atol=1e-13)
    return -found.y[1, -1] / speed


@pytest.mark.parametrize(
    ("fidelity", "off", "apart"),
    [
        # The error of second order in the step: a tenth of it has a hundredth of the error.
        (STANDARD.replace(step=2.5e-4, step_tolerance=None), 6e-5, 2e-4),
        (STANDARD.replace(step=2.5e-5, step_tolerance=None), 6e-7, 2e-6),
        # Steps that are chosen change from speed to speed.
        (STANDARD, 2e-4, 1e-3),
    ],
    ids=["0.25 ms", "25 us", "standard"],
)
def test_against_the_similarity_of_impacts_on_a_wall(fidelity, off, apart):
    """I = m v (1 + e(b_p v^0.2 / k_p^0.6)), so that the elasticities are 1, 1 + 0.2 s, -0.6 s, s.

    By the trapezoidal rule alone they are off by 3.6e-3, 3.5e-4 and 6.9e-3: the first order in the
    step, h |N'| times what the instant of parting changes.
    """
    value, slopes = on_the_wall(fidelity)
    expected = 1 + np.array([restitution(speed) for speed in SPEEDS[::7]])
    np.testing.assert_allclose(value[::7], expected, rtol=off)
    _, _, _, damping = slopes.T
    similar = np.stack([1 + 0 * damping, 1 + 0.2 * damping, -0.6 * damping, damping], axis=1)
    assert np.max(np.abs(slopes - similar)) < apart


def test_elasticities_along_the_fence_do_not_ripple():
    """Oblique impacts at places 1 mm apart: the elasticities in h_1, E, m and R run smoothly.

    By the trapezoidal rule alone those in R are off by 27e-3 in places, those in h_1 by 14e-3. What
    is left comes from steps that are chosen anew from place to place, above all by which step the
    parcel parts: one that misses a share `step_tolerance` of the force there moves the derivatives
    in the instant of parting, which R moves most, at one place in a hundred by more than 4e-3.
    """
    fence = fj.Fence()

    def impulse(shares, place):
        thickness, modulus, mass, further = jnp.exp(shares)
        material = fj.Material(
            3e9 * modulus, fence.material.density, fence.material.damping_ratio
        )
        scene = fj.scenes.oblique_impact(
            fence=fj.Fence(thickness=0.045 * thickness, material=material),
            distance=place * further, parcel=fj.Parcel(mass=MASS * mass), duration=0.13,
        )  # fmt: skip
        return jnp.log(fj.simulate(scene, only="impulse").impulse)

    places = np.arange(1.02, 1.0605, 1e-3)
    along = jax.jit(jax.vmap(jax.grad(impulse), in_axes=(None, 0)))
    slopes = np.asarray(along(jnp.zeros(4), jnp.asarray(places)))
    share = (places - places.mean()) / np.ptp(places)
    smooth = np.stack([np.polyval(np.polyfit(share, row, 4), share) for row in slopes.T], axis=1)
    ripple = np.abs(slopes - smooth)
    assert np.all(np.quantile(ripple, 0.95, axis=0) < [1e-3, 5e-4, 5e-4, 2e-3]), ripple
    assert np.all(np.max(ripple, axis=0) < [5e-3, 2e-3, 2e-3, 8e-3]), ripple
