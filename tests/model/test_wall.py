"""The rigid wall against closed forms, scaling laws and SciPy.

    m_p Dddot = -N,  N = max(0, b_p m_p^0.4 Ddot D^2 + k_p D^4),  D(0) = 0, Ddot(0) = v_n

The scheme is of the second order. A contact lasts T ~ 50 ms here, so that a step h leaves some
(h / T)^2: 3e-5 at 0.25 ms and 3e-7 at 25 us, for a slope a few times that.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import beta

import fencejax as fj

SPEED, MASS, STIFFNESS, DAMPING = 2.426, 15.0, 1.72e9, 3.3e5
POINT = {"speed": SPEED, "mass": MASS, "stiffness": STIFFNESS, "damping": DAMPING}
FINE = fj.Fidelity.reference()


def strike(x, fidelity=FINE, history=False):
    parcel = fj.Parcel(mass=x["mass"], stiffness=x["stiffness"], damping=x["damping"])
    scene = fj.scenes.rigid_wall(speed=x["speed"], parcel=parcel)
    return fj.simulate(scene, fidelity=fidelity, history=history)


@functools.partial(jax.jit, static_argnames="fidelity")
def lanes(x, fidelity=FINE):
    """The strikes of arrays of numbers, and the derivatives of the peak force lane by lane."""

    def one(x):
        result = strike(x, fidelity)
        return result.peak_force, result

    slopes, results = jax.vmap(jax.grad(one, has_aux=True))(x)
    return results, slopes


def batch(fidelity=FINE, **changes):
    """`lanes` of up to eight sets of numbers, always by the program for eight."""
    width = max(np.size(values) for values in changes.values())
    x = {name: np.resize(changes.get(name, value), 8) for name, value in POINT.items()}
    found = lanes({name: jnp.asarray(values, dtype=float) for name, values in x.items()}, fidelity)
    return jax.tree.map(lambda leaf: leaf[:width], found)


def restitution(result, speed):
    return np.asarray(result.final.y_rate) / speed


def law(x, gap, rate):
    force = x["damping"] * x["mass"] ** 0.4 * rate * gap**2 + x["stiffness"] * gap**4
    return max(0.0, force) if gap > 0 else 0.0


@functools.cache
def scipy_strike(speed, mass, stiffness, damping):
    """Peak force [N], its time [s] and the speed after [m/s], to some 1e-10."""
    x = {"speed": speed, "mass": mass, "stiffness": stiffness, "damping": damping}

    def field(_, y):
        return y[1], -law(x, *y) / mass

    def crest(_, y):
        # dN/dt = 0 while N > 0.
        viscous = damping * mass**0.4
        gap, rate = y
        by_gap = 2 * viscous * rate * gap + 4 * stiffness * gap**3
        return by_gap * rate - viscous * gap**2 * law(x, gap, rate) / mass

    def leaves(_, y):
        # N = 0 at D > 0: from there on the parcel flies off.
        return damping * mass**0.4 * y[1] + stiffness * y[0] ** 2

    crest.direction = -1
    leaves.direction, leaves.terminal = -1, True
    solution = solve_ivp(
        field, (0, 0.1), (0.0, speed), "DOP853", rtol=1e-12, atol=1e-15, max_step=2e-4,
        events=(crest, leaves),
    )
    states = solution.y_events[0]
    forces = [law(x, *state) for state in states]
    best = int(np.argmax(forces))
    return forces[best], solution.t_events[0][best], -solution.y_events[1][0][1]


@pytest.mark.parametrize("fidelity", [FINE, fj.Fidelity.standard()], ids=["reference", "standard"])
@pytest.mark.parametrize(
    ("speed", "peak", "ratio"), [(2.426, 3293.85, 0.4388), (0.5, 283.93, 0.5318)]
)
def test_recorded_figures(fidelity, speed, peak, ratio):
    result = strike(POINT | {"speed": speed}, fidelity)
    # Half a unit of the last digit, and what steps may miss: their tolerance, of fixed ones 1e-4.
    left = fidelity.step_tolerance or 1e-4
    assert float(result.peak_force) == pytest.approx(peak, abs=0.005 + left * peak)
    assert float(restitution(result, speed)) == pytest.approx(ratio, abs=0.5e-4 + left * ratio)
    assert int(result.status) == fj.Status.SUCCESSFUL


def test_elastic_in_closed_form():
    # b_p = 0: k D^5 / 5 = m v^2 / 2 at the crest, N = k D^4 there, and it bounces back whole.
    # The time to the crest is D / v times the integral of ds / sqrt(1 - s^5) over 0 ... 1,
    # B(1/5, 1/2) / 5, and the contact lasts twice that. Newton leaves 1e-9 of the force.
    speed, mass = np.array([0.7, 1.0, 2.426]), np.array([15.0, 4.0, 30.0])
    result, slopes = batch(speed=speed, mass=mass, damping=0.0)
    depth = (2.5 * mass * speed**2 / STIFFNESS) ** 0.2
    peak = STIFFNESS * depth**4
    crest = depth / speed * beta(0.2, 0.5) / 5
    np.testing.assert_allclose(result.peak_force, peak, rtol=1e-6)
    np.testing.assert_allclose(result.peak_time, crest, rtol=5e-6)
    # The deepest gap is that of a sample: below the crest by at most N / m (h / 2)^2 / 2.
    below = peak / mass * (FINE.step / 2) ** 2 / 2
    assert np.all(np.abs(depth - result.deepest) < below + 1e-6 * depth)
    # The end of the contact is found where the gap, straight over the step, is zero, or earlier
    # where the force k D^4 is below the 1e-9 N that Newton's method leaves.
    unseen = (1e-9 / STIFFNESS) ** 0.25 / speed
    assert np.all(np.abs(result.contact_time - 2 * crest) < 5e-6 * crest + unseen)
    # The scheme's own energy is the parcel's, k D^5 / 5 by its trapezoid: round-off and Newton.
    np.testing.assert_allclose(restitution(result, speed), 1.0, rtol=1e-8)
    np.testing.assert_allclose(result.impulse, 2 * mass * speed, rtol=1e-8)
    # N = k^(1/5) (5 m v^2 / 2)^(4/5): elasticities 8/5, 4/5, 1/5.
    np.testing.assert_allclose(slopes["speed"], 1.6 * peak / speed, rtol=5e-6)
    np.testing.assert_allclose(slopes["mass"], 0.8 * peak / mass, rtol=5e-6)
    np.testing.assert_allclose(slopes["stiffness"], 0.2 * peak / STIFFNESS, rtol=5e-6)


def test_restitution_is_independent_of_the_mass():
    # Measured in D0 = (m v^2 / k)^(1/5) and D0 / v, the equation holds b v^0.2 / k^0.6 alone.
    # The contact's time goes with m^0.2, a factor 2.7 here: the step's error is below 1e-4.
    mass = np.geomspace(0.2, 30.0, 8)
    result, _ = batch(mass=mass)
    ratios = restitution(result, SPEED)
    assert np.ptp(ratios) < 1e-4 * ratios.mean()
    np.testing.assert_allclose(result.peak_force / mass**0.8, 3293.85 / MASS**0.8, rtol=1e-4)
    # Without the factor m^0.4 in the law it would go with the mass: b -> b m^-0.4 undoes it.
    result, _ = batch(mass=mass, damping=DAMPING * (mass / MASS) ** -0.4)
    assert np.ptp(restitution(result, SPEED)) > 0.1


def test_one_number_governs_the_restitution():
    # b v^0.2 / k^0.6 constant while all three are changed; the peak goes with k^0.2 (m v^2)^0.8.
    speed = np.array([SPEED, 1.2, 0.6, 1.8])
    stiffness = STIFFNESS * np.array([1.0, 0.5, 2.0, 1.7])
    damping = DAMPING * (speed / SPEED) ** -0.2 * (stiffness / STIFFNESS) ** 0.6
    result, _ = batch(speed=speed, stiffness=stiffness, damping=damping)
    ratios = restitution(result, speed)
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-4)
    scale = stiffness**0.2 * speed**1.6
    peaks = np.asarray(result.peak_force) / scale
    np.testing.assert_allclose(peaks, peaks[0], rtol=1e-4)


def test_forces_scale_step_by_step():
    # m, k and b m^0.4 all times L: the same motion, every force times L, in the scheme too. What
    # differs is where Newton's method stops, at 1e-9 N + 1e-9 N.
    factor = np.array([1.0, 0.1, 7.0])
    result, _ = batch(
        fidelity=fj.Fidelity.fast(), mass=MASS * factor, stiffness=STIFFNESS * factor,
        damping=DAMPING * factor**0.6,
    )
    np.testing.assert_allclose(result.peak_force, result.peak_force[0] * factor, rtol=1e-8)
    np.testing.assert_allclose(result.final.y_rate, result.final.y_rate[0], rtol=1e-8)


@pytest.mark.parametrize("fidelity", [FINE, fj.Fidelity.fast()], ids=["reference", "fast"])
def test_momentum_is_the_impulse(fidelity):
    # m dv = h / 2 (N0 + N1) in every step, which is how the impulse is summed: exact at any step,
    # but for the 1e-9 of the force that Newton leaves, and for the step in which the force ends. Of
    # that the impulse has the part until then: at most h^2 |N'| / 8 less, with N' where the force
    # ends below twice the mean slope of its rise.
    result, _ = batch(fidelity, speed=np.array([0.5, 2.426]))
    change = MASS * (np.asarray(result.final.y_rate) + np.array([0.5, 2.426]))
    steepest = 2 * np.asarray(result.peak_force) / np.asarray(result.peak_time)
    short = change - np.asarray(result.impulse)
    assert np.all(short > -1e-8 * change)
    assert np.all(short < 1e-8 * change + fidelity.step**2 * steepest / 8)


def scipy_slope(name, speed):
    """Derivative of the peak force by Richardson's central differences, to some 1e-8."""
    at = POINT | {"speed": speed}

    def central(share):
        up, down = (
            scipy_strike(**(at | {name: at[name] * factor}))[0]
            for factor in (1 + share, 1 - share)
        )
        return (up - down) / (2 * share * at[name])

    return (4 * central(1e-3) - central(2e-3)) / 3


def test_second_order_in_the_step_values_and_gradients():
    # The kink where the force ends moves over the grid with the step, so that the order is that
    # of the largest error over several speeds, and over two halvings; the crest is clear of it.
    speed = np.linspace(1.0, 2.426, 7)
    truth = np.array([scipy_strike(**(POINT | {"speed": float(v)})) for v in speed]).T
    slope = {name: np.array([scipy_slope(name, float(v)) for v in speed]) for name in POINT}
    errors = []
    for step in (4e-4, 2e-4, 1e-4, 2.5e-5):
        result, slopes = batch(FINE.replace(step=step), speed=speed)
        found = {"peak": result.peak_force, "time": result.peak_time, "after": result.final.y_rate}
        wanted = dict(zip(found, truth, strict=True)) | slope
        found |= slopes
        errors.append(
            {k: float(np.max(np.abs(found[k] / v - 1))) for k, v in wanted.items()}
        )
    coarse, middle, fine, finest = errors
    for first, second in ((coarse, middle), (middle, fine)):
        assert np.log2(first["peak"] / second["peak"]) == pytest.approx(2, abs=0.2)
    for name in coarse:
        assert np.log2(coarse[name] / fine[name]) / 2 > 1.7, (name, errors)
    # Sixteen times finer than the first, 256 times better; 3e-7 by the estimate on top.
    assert finest["peak"] < 1e-6
    assert max(finest.values()) < 5e-6, finest


def test_receding_parcel_never_touches():
    result, slopes = batch(speed=np.array([-0.5, -2.426]))
    assert np.all(np.asarray(result.status) == fj.Status.NEVER_TOUCHED)
    assert np.all(np.asarray(result.peak_force) == 0)
    assert np.all(np.asarray(result.impulse) == 0)
    assert all(np.all(np.asarray(slope) == 0) for slope in slopes.values())
    # It goes on as it went.
    np.testing.assert_array_equal(result.final.y_rate, [0.5, 2.426])


def test_history_is_the_law():
    result = strike(POINT, history=True)
    history = result.history
    gap, rate = np.asarray(history.fence[0].gap), np.asarray(history.fence[0].gap_rate)
    forces = [law(POINT, *state) for state in zip(gap, rate, strict=True)]
    np.testing.assert_allclose(history.fence_force, forces, rtol=1e-12)
    # The parabola's crest lies above the highest sample, by less than a step could raise it.
    highest = np.max(forces)
    assert highest <= float(result.peak_force) < highest + 1e-3
