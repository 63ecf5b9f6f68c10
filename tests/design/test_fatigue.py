"""Rainflow counting against the package `rainflow`, and the damage of a sort by NumPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import rainflow as oracle

import fencejax as fj
from fencejax.design import fatigue


def counted(cycles):
    """Ranges, means and counts, in the order of the ranges; cycles of no range left out."""
    amplitude, mean, count = (np.asarray(column) for column in cycles)
    rows = np.stack([2 * amplitude, mean, count], -1)[(count > 0) & (amplitude > 0)]
    return rows[np.lexsort(rows.T[::-1])]


def expected(signal):
    """The same by the package."""
    rows = np.array([cycle[:3] for cycle in oracle.extract_cycles(signal)])
    rows = rows[rows[:, 0] > 0]
    return rows[np.lexsort(rows.T[::-1])]


def from_largest(signal):
    return np.append(np.roll(signal, -np.argmax(signal)), np.max(signal))


# One program for signals of one length.
COUNT = jax.jit(fatigue.rainflow)
REPEATED = jax.jit(lambda x: fatigue.rainflow(x, repeating=True))


@pytest.mark.parametrize("seed", range(6))
def test_cycles_are_those_of_the_standard(seed):
    random = np.random.default_rng(seed)
    noise = random.normal(size=150)
    # White, a random walk, plateaus, a decaying and a growing oscillation.
    time = np.linspace(0, 9, 150)
    signals = [
        noise, np.cumsum(noise), np.repeat(noise[:50], 3),
        np.exp(-0.3 * time) * np.sin(9 * time) + 0.01 * noise,
        np.exp(0.3 * time) * np.sin(9 * time), np.concatenate([np.zeros(20), noise[20:]]),
    ]  # fmt: skip
    for signal in signals:
        np.testing.assert_allclose(counted(COUNT(signal)), expected(signal), atol=1e-12)
        ours = counted(REPEATED(signal))
        # Begun at the largest value, all cycles are whole: the package has the largest in halves.
        theirs = expected(from_largest(signal))
        assert np.sum(ours[:, 2] * ours[:, 0] ** 4) == pytest.approx(
            np.sum(theirs[:, 2] * theirs[:, 0] ** 4), rel=1e-12
        )


def test_the_standards_own_example():
    # ASTM E1049-85, figure 6: ranges 3, 4, 6, 8, 9 with 0.5, 1.5, 0.5, 1, 0.5 cycles.
    cycles = fatigue.rainflow(jnp.array([-2.0, 1, -3, 5, -1, 3, -4, 4, -2]))
    found = counted(cycles)
    assert {r: found[found[:, 0] == r, 2].sum() for r in (3, 4, 6, 8, 9)} == {
        3: 0.5, 4: 1.5, 6: 0.5, 8: 1.0, 9: 0.5,
    }  # fmt: skip


def numpy_equivalent(time, stress, exponent=10.0):
    """sigma_eq of a periodic signal, by NumPy and the package: each inner extreme
    is the vertex of the parabola through three samples."""
    fine = stress.copy()
    for i in range(1, len(stress) - 1):
        if (stress[i] - stress[i - 1]) * (stress[i + 1] - stress[i]) <= 0:
            a, b, c = np.polyfit(time[i - 1 : i + 2] - time[i], stress[i - 1 : i + 2], 2)
            fine[i] = c - b * b / (4 * a) if a != 0 else stress[i]
    worst = 0.0
    for side in (fine, -fine):
        total = 0.0
        for span, mean, count, *_ in oracle.extract_cycles(from_largest(side)):
            total += count * (max(mean + span / 2, 0) * span / 2) ** (exponent / 2)
        worst = max(worst, total ** (1 / exponent))
    return worst


def blow(time, z):
    """A stress as of a blow and the ringing after it [MPa], from three numbers."""
    ring = z[0] * np.exp(-z[1] * time) * np.sin(z[2] * time)
    return ring + 0.4 * z[0] * np.exp(-((time - 0.3) ** 2) / 0.01)


def test_equivalent_amplitude_and_its_gradient():
    # Uneven samples, as of a loop with strides.
    time = np.cumsum(np.random.default_rng(1).uniform(0.5e-3, 3e-3, 600))
    z = np.array([20.0, 6.0, 170.0])

    def ours(z):
        t = jnp.asarray(time)
        ring = z[0] * jnp.exp(-z[1] * t) * jnp.sin(z[2] * t)
        stress = ring + 0.4 * z[0] * jnp.exp(-((t - 0.3) ** 2) / 0.01)
        return fatigue.worst_amplitude(fj.results.Course(t, stress[:, None]))

    value, slope = jax.jit(jax.value_and_grad(ours))(z)
    exact = numpy_equivalent(time, blow(time, z))
    # The gate leaves out cycles of 2 % of the range: 1e-17 of the damage of each.
    assert float(value) == pytest.approx(exact, rel=1e-10)
    for i in range(3):
        step = 1e-5 * z[i] * np.eye(3)[i]
        change = [numpy_equivalent(time, blow(time, z + s * step)) for s in (1, -1)]
        # Central differences: 1e-10 of their own error, 1e-11 of rounding over a step of 1e-5.
        assert float(slope[i]) * z[i] == pytest.approx(
            (change[0] - change[1]) / 2e-5, rel=1e-5, abs=1e-7 * exact
        )


def test_one_cycle_is_its_own_equivalent():
    # Around 0 sigma_eq is the amplitude; pulsating, sqrt(2) of it (Smith, Watson and Topper).
    time = np.linspace(0, 1, 401)
    around = jnp.asarray(7.0 * np.sin(2 * np.pi * time))[:, None]
    pulsating = jnp.asarray(7.0 * (1 - np.cos(2 * np.pi * time)))[:, None]
    courses = [fj.results.Course(time, stress) for stress in (around, pulsating)]
    amplitude = jax.jit(fatigue.worst_amplitude)
    found = [float(amplitude(one)) for one in courses]
    # Parabolas through samples 2 pi / 400 apart: h^4 / 384 of the amplitude.
    assert found == pytest.approx([7.0, 7.0 * np.sqrt(2)], rel=1e-8)
    assert float(fatigue.life(19e6, 19e6)) == pytest.approx(1e7)
    assert float(fatigue.life(2 * 19e6, 19e6, 11)) == pytest.approx(1e7 / 2**11)
    assert float(fatigue.amplitude_for(1e8, 19e6)) == pytest.approx(19e6 * 0.1**0.1)
    still = fj.results.Course(time, jnp.zeros((401, 2)))
    slope = jax.jit(jax.grad(lambda x: amplitude(still._replace(signal=x))))(still.signal)
    assert np.all(np.asarray(slope) == 0)
