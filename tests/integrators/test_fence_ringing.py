"""A fence that swings next to a free parcel: it vibrates in its modes, with energy from the
drive."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from reference.beam import clamped_modes
from runs import one_by_one

import fencejax as fj

# Friction plays no part.
STANDARD = fj.Fidelity.standard(slip_speed=1e-3)
CYCLE, TOP_SPEED, RINGING = 1.36, 1.53, 0.14
RING_STEP = 5e-4


@functools.cache
def ringing(step=RING_STEP):
    """A fence beside the parcel through a whole cycle and on: undamped, and as usual."""

    @jax.jit
    @one_by_one
    def run(damping):
        fence = fj.Fence(material=fj.Material(damping_ratio=damping))
        drive = fj.HarmonicDrive(TOP_SPEED, CYCLE)
        scene = fj.scenes.free_motion(fence=fence, drive=drive, duration=CYCLE + RINGING)
        return fj.simulate(scene, fidelity=fj.Fidelity.standard(step=step, step_tolerance=None))

    results = run(jnp.array([0.0, 0.05]))
    return [jax.tree.map(lambda leaf, k=k: np.asarray(leaf[k]), results) for k in range(2)]


def modal_response(time, frequency, damping, participation):
    """eta and etadot of eta'' + c eta' + w^2 eta = -p a cos(W t) from rest, and w and c."""
    turning = 2 * np.pi / CYCLE
    swing = 0.5 * TOP_SPEED * CYCLE / np.pi * turning**2
    steady = -participation * swing / (frequency**2 - turning**2 + 1j * damping * turning)
    root = np.sqrt(frequency**2 - damping**2 / 4 + 0j)
    # The free part undoes the steady one's displacement and speed at t = 0.
    q, v = -steady.real, turning * steady.imag
    sine = (v + damping / 2 * q) / root
    decay = np.exp(-damping / 2 * time)
    free = decay * (q * np.cos(root * time) + sine * np.sin(root * time))
    free_rate = -damping / 2 * free + decay * root * (
        sine * np.cos(root * time) - q * np.sin(root * time)
    )
    wave = steady * np.exp(1j * turning * time)
    return (wave + free).real, (1j * turning * wave + free_rate).real


@pytest.mark.parametrize("lane", [0, 1])
def test_fence_rings_as_its_modes(lane):
    fence = fj.Fence()
    modes = clamped_modes(
        0.45, 0.75, 0.132, 0.045, 3.0e9, 1130.0, (0.0, 0.05)[lane], 20, STANDARD.modes
    )
    history = ringing()[lane].history
    swinging = history.time < CYCLE - RING_STEP / 2
    time = history.time[swinging]
    # Modes are normalised by m_0 = rho z h_1 l_p here and by 1 kg there. The cosine is taken as
    # straight over a step: (W h)^2 / 12 = 4e-7 of the response, in the rate too.
    scale = np.sqrt(float(fence.mass_scale))
    deflection = 0
    for k in range(STANDARD.modes):
        exact, rate = modal_response(
            time, modes.frequency[k], modes.damping[k], modes.participation[k]
        )
        # Amplitudes have no sign of their own: by the tip's deflection.
        ours = history.vibration.amplitude[k][swinging] * scale
        sign = np.sign(np.dot(ours, exact))
        largest = np.max(np.abs(exact))
        np.testing.assert_allclose(sign * ours, exact, atol=1e-6 * largest)
        ours = history.vibration.rate[k][swinging] * scale
        np.testing.assert_allclose(sign * ours, rate, atol=2e-6 * np.max(np.abs(rate)))
        deflection = deflection + modes.displacement[-1, k] * exact
    np.testing.assert_allclose(
        -history.tip_deflection[swinging], deflection, atol=2e-6 * np.max(np.abs(deflection))
    )


def running_integral(power, step):
    return np.concatenate([[0], np.cumsum(step / 2 * (power[1:] + power[:-1]))])


def test_drive_work_is_the_energy_of_the_fence():
    worst = []
    for step in (RING_STEP, RING_STEP / 2):
        errors = []
        for result in ringing(step):
            energy, power = result.history.energy, result.history.power
            stored = energy.fence + energy.strain
            work = running_integral(power.drive, step)
            lost = running_integral(power.beam_damping, step)
            swinging = result.history.time < CYCLE - RING_STEP / 2
            errors.append(np.max(np.abs(stored - work + lost)[swinging]))
            assert result.energy.drive_work == pytest.approx(work[-1], rel=1e-10)
            assert result.energy.damping_loss == pytest.approx(lost[-1], rel=1e-10, abs=0)
            # The same sum in the ledger: the fence's share of it, the parcel's apart.
            assert np.max(stored) > 1.0
        worst.append(errors)
        undamped, usual = ringing(step)
        assert np.all(undamped.history.power.beam_damping == 0)
        assert np.all(usual.history.power.beam_damping >= 0)
        assert usual.energy.damping_loss > 1e-4
    # The motion is exact, its powers are summed by the trapezoidal rule: second order. Undamped,
    # mode 4 with 4 and 8 samples a period rings on and is left out of no sum: near enough to order
    # 2 to call it that.
    orders = np.log2(np.divide(*worst))
    assert np.all(orders > 1.7), (orders, worst)
    assert max(worst[1]) < 5e-5


def test_ring_down():
    # From a step past the cycle's end nothing drives the fence: the exact map of each mode keeps
    # the energy (undamped), and scales it by its own decay (damped).
    undamped, usual = ringing()
    history = undamped.history
    home = history.time > CYCLE + 1.5 * RING_STEP
    stored = (history.energy.fence + history.energy.strain)[home]
    assert stored[0] > 0
    np.testing.assert_allclose(stored, stored[0], rtol=1e-11)
    history = usual.history
    modes = clamped_modes(0.45, 0.75, 0.132, 0.045, 3.0e9, 1130.0, 0.05, 20, 1)
    frequency, damping = modes.frequency[0], modes.damping[0]
    q, v = (block[0][home] for block in (history.vibration.amplitude, history.vibration.rate))
    root = np.sqrt(frequency**2 - damping**2 / 4)
    time = history.time[home] - history.time[home][0]
    sine = (v[0] + damping / 2 * q[0]) / root
    exact = q[0] * np.cos(root * time) + sine * np.sin(root * time)
    exact = np.exp(-damping / 2 * time) * exact
    np.testing.assert_allclose(q, exact, atol=1e-9 * np.max(np.abs(q)))
    # The e-folding rate zeta omega_1 that is on record: 8.7 1/s.
    assert damping / 2 == pytest.approx(8.7, abs=0.05)


def test_parcel_does_not_feel_a_fence_beside_it():
    scene = fj.scenes.free_motion(fence=fj.Fence(), duration=CYCLE + RINGING)
    alone = fj.scenes.free_motion(duration=CYCLE + RINGING)
    fidelity = fj.Fidelity.standard(step=RING_STEP, step_tolerance=None)
    apart, beside = (fj.simulate(s, fidelity=fidelity, history=False) for s in (alone, scene))
    np.testing.assert_allclose(beside.final, apart.final, rtol=1e-12, atol=1e-12)
