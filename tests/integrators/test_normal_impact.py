"""A parcel against a fence whose root is at rest, along its normal.

    m yddot = -N,  M qddot + B qdot + K q = p N,  D = y - p.q,
    N = max(0, b m^0.4 Ddot D^2 + k D^4) for D > 0

The first tests are on the beam of the race against other codes, `peers.race`, whose numbers LSODA
and CVODES with forward sensitivities computed on all forty modes; the numbers of the paper's beam
are found here, by `reference.beam` and LSODA.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from peers import fencejax_beam, race
from reference import beam as independent
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

import fencejax as fj
from fencejax.results import Accumulator


def scene(numbers):
    """The race's scene at h_1, E, rho, beta and l_p [SI]."""
    return fencejax_beam.scene(numbers, float(race.unit_modes(1).eigenvalues[0]))


@functools.partial(jax.jit, static_argnames="fidelity")
def run(logs, fidelity):
    def one(logs):
        result = fj.simulate(scene(jnp.exp(logs)), fidelity=fidelity, history=False)
        return jnp.log(result.peak_force), result

    slopes, result = jax.grad(one, has_aux=True)(logs)
    return result, slopes


@pytest.mark.parametrize("modes", [8, None])
def test_reference_numbers(modes):
    # Second order: 1.3e-10 (h / us)^2 of the peak, 2.5e-9 (h / us)^2 of the elasticities, 8e-8 and
    # 1.6e-6 here; with eight modes and the viscoelastic rest as with all of them.
    fidelity = fj.Fidelity(modes=modes, step=2.5e-5, step_tolerance=None)
    result, slopes = run(jnp.log(race.START), fidelity)
    assert float(result.peak_force) == pytest.approx(race.PEAK, rel=1e-6)
    assert float(result.peak_time) == pytest.approx(race.PEAK_TIME, abs=2e-6)
    np.testing.assert_allclose(slopes, race.ELASTICITIES, rtol=0, atol=2e-5)
    assert int(result.status) == fj.Status.SUCCESSFUL


def test_second_order_in_the_step():
    # Halving the step quarters the differences of peak and tip deflection: 4 to a tenth.
    def peaks(step):
        fidelity = fj.Fidelity(modes=6, step=step, step_tolerance=None)
        result = fj.simulate(scene(jnp.asarray(race.START)), fidelity=fidelity, history=False)
        return [float(result.peak_force), float(result.tip_deflection), float(result.peak_time)]

    values = np.array([peaks(step) for step in (2e-4, 1e-4, 5e-5)])
    coarse, fine = np.abs(np.diff(values[:, :2], axis=0))
    np.testing.assert_allclose(coarse / fine, 4.0, rtol=0.1)


@functools.cache
def by_lsoda(distance):
    """Peak force, its time and the largest tip deflection of the paper's fence, by LSODA."""
    fence, parcel = fj.Fence(), fj.Parcel()
    length, width, thickness = 0.75, 0.132, 0.045
    mass, stiffness = independent.matrices(length, width, thickness, 3.0e9, 1130.0, 20)
    values, vectors = eigh(stiffness[2:, 2:], mass[2:, 2:])
    nodes = np.vstack([np.zeros((2, 40)), vectors])
    x = (distance - 0.45) / length * 20
    e, s = int(x), x % 1
    size = length / 20
    cubic = (1 - 3 * s**2 + 2 * s**3, size * (s - 2 * s**2 + s**3))
    cubic += (3 * s**2 - 2 * s**3, size * (s**3 - s**2))
    shape = np.array(cubic) @ nodes[2 * e : 2 * e + 4]
    damping = 2 * 0.05 / np.sqrt(values[0]) * values
    m, k = float(parcel.mass), float(parcel.stiffness)
    b = float(parcel.damping) * m**0.4

    def force(state):
        gap = state[0] - shape @ state[2:42]
        rate = state[1] - shape @ state[42:]
        return max(0.0, b * rate * gap**2 + k * gap**4) if gap > 0 else 0.0

    def slopes(_, state):
        n = force(state)
        bend = shape * n - damping * state[42:] - values * state[2:42]
        return np.concatenate([[state[1], -n / m], state[42:], bend])

    start = np.zeros(82)
    start[1] = 2.426
    times = np.linspace(0, 0.25, 20001)
    found = solve_ivp(slopes, (0, 0.25), start, "LSODA", times, rtol=1e-8, atol=1e-11)
    forces = np.array([force(y) for y in found.y.T])
    tip = np.abs(nodes[-2] @ found.y[2:42])
    assert float(fence.reach) == 1.2
    return forces.max(), times[forces.argmax()], tip.max()


@pytest.mark.parametrize("distance", [0.7, 1.013])
def test_paper_fence_against_lsoda(distance):
    # Of second order in the step: at the standard fidelity's 0.25 ms up to 2e-5 of the peak and
    # 8e-5 of the tip, a fourth of both at half the step. The other side's maximum is sampled, which
    # costs it (12.5 us / 10 ms)^2 / 8 = 2e-7.
    peak, moment, tip = by_lsoda(distance)
    result = fj.simulate(fj.scenes.normal_impact(distance=distance), history=False)
    assert float(result.peak_force) == pytest.approx(peak, rel=1e-3)
    assert float(result.peak_time) == pytest.approx(moment, abs=2e-4)
    assert float(result.tip_deflection) == pytest.approx(tip, rel=1e-3)


def test_rigid_fence_is_the_wall():
    # Without modes the very same equations; and where it meets the rigid link.
    wall = fj.simulate(fj.scenes.rigid_wall(duration=0.1), history=False)
    for distance, fidelity in ((1.0, fj.Fidelity(modes=0)), (0.3, fj.Fidelity())):
        on_fence = fj.scenes.normal_impact(distance=distance, duration=0.1)
        result = fj.simulate(on_fence, fidelity=fidelity, history=False)
        assert float(result.peak_force) == pytest.approx(float(wall.peak_force), rel=1e-9)
        assert float(result.tip_deflection) == 0


def test_stiff_fence_tends_to_the_wall():
    # The fence gives way by N C: some D0 / C N of the peak, so that the difference falls as 1 / E.
    wall = fj.simulate(fj.scenes.rigid_wall(duration=0.1), history=False).peak_force
    short = []
    for modulus in (3e13, 3e14):
        fence = fj.Fence(material=fj.Material(youngs_modulus=modulus, damping_ratio=0.5))
        struck = fj.scenes.normal_impact(fence=fence, distance=0.7, duration=0.1)
        short.append(1 - float(fj.simulate(struck, history=False).peak_force / wall))
    assert 0 < short[1] < short[0] / 5 < 1e-2


def test_place_is_refused_beyond_the_fence():
    with pytest.raises(ValueError, match=r"`distance` .* most 1\.2"):
        fj.scenes.normal_impact(distance=1.3)


def test_momentum_is_the_impulse():
    # Trapezoidal rates and the trapezoidal sum of the force: equal to round-off. Of the step in
    # which a blow ends the impulse counts the part until then: N h / 2 less, at most.
    def add(state, step):
        before, now = step.before.fence_force, step.now.fence_force
        half = step.integral(before, now)
        return state + jnp.stack([half, jnp.where(now > 0, 0.0, half)])

    both = Accumulator("both", lambda nothing, body: jnp.zeros(2), add)
    names = ("trapezoidal", "of ends")
    sums = [
        fj.Measure(name, "N s", "", "at least 0", both, lambda state, k=k: state[k])
        for k, name in enumerate(names)
    ]
    result = fj.simulate(fj.scenes.normal_impact(), history=False, measures=sums)
    trapezoidal, ends = (float(result.measures[name]) for name in names)
    lost = 15.0 * (float(result.final.y_rate) + 2.426)
    assert trapezoidal == pytest.approx(lost, rel=1e-12)
    assert 0 < trapezoidal - float(result.impulse) < ends
