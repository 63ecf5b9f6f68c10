"""The flexible link in SI units: statics, stress, geometry and the free swing."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from model.links import (
    ELEMENTS,
    EPS,
    FENCE,
    LENGTH,
    RIGID,
    ROOT_STIFFNESS,
    make,
    shape_at,
    static_amplitude,
    vibration,
)
from scipy.integrate import solve_ivp

from fencejax import Fence, HarmonicDrive, Uniform, model
from fencejax.model import SWING_STEPS, dot

# --- Statics ------------------------------------------------------------------------------------


def gauss(function, high, points=40):
    nodes, weights = np.polynomial.legendre.leggauss(points)
    x = high * (1 + nodes) / 2
    return np.sum(high / 2 * weights * function(x))


@pytest.mark.parametrize("modes", [1, 4, 12, None])
@pytest.mark.parametrize("node", [4, 10, 17])
def test_static_deflection_under_a_force(node, modes):
    # w(a) = P / (E I_1) integral_0^a (a - x)^2 (1 - x / l)^(-3/2) dx for the constant-strength
    # link. The FE value is low by h^4 / 720 integral of E I f''^2, f = w'' the curvature, up to
    # O(h / (l - a)) of that (see test_beam); with any number of modes it is the same FE value.
    link, load, a = make(modes), 250.0, node / ELEMENTS
    amplitude, shape = static_amplitude(link, RIGID + a * LENGTH, load)
    ours = float(dot(shape.deflection, amplitude))
    if modes is not None:
        ours += load * float(shape.residual)
    unit = load * LENGTH**3 / ROOT_STIFFNESS
    exact = unit * gauss(lambda x: (a - x) ** 2 * (1 - x) ** -1.5, a)
    missing = unit / ELEMENTS**4 / 720 * gauss(
        lambda x: (1 - x) ** 1.5
        * (-3 * (1 - x) ** -2.5 + 3.75 * (a - x) * (1 - x) ** -3.5) ** 2,
        a,
    )
    # Between 0.8 and 1.2 times what is missing, and round-off (1e-10) of the 40 modes' sum.
    allowed = 0.2 * missing + 1e-9 * exact
    assert abs(exact - ours - missing) < allowed
    assert missing < 1e-3 * exact


@pytest.mark.parametrize("modes", [1, 3, None])
def test_static_deflection_between_the_nodes(modes):
    # A uniform link under a force P at a: P a^3 / (3 E I). With the force on the element's cubics
    # by virtual work the finite elements lack just what an element clamped at both ends gives way
    # inside, P h^3 s^3 (1 - s)^3 / (3 E I); round-off as the condition of K,
    # eps x 4 x 20^4 = 1.4e-10 of the tip's compliance, and in the sum of the modes as the first
    # one's eigenvalue beside the last one's, whose size all are right to.
    fence = Fence(
        rigid_length=RIGID, flexible_length=LENGTH, width=0.12, thickness=0.05,
        material=FENCE.material, taper=Uniform(),
    )
    link = make(modes, fence)
    unit = LENGTH**3 / ROOT_STIFFNESS / 3
    square = np.concatenate([np.ravel(b) for b in make(None, fence).frequency_squared])
    allowed = np.finfo(float).eps * (4 * ELEMENTS**4 + square.max() / square.min())
    assert allowed < 2e-8
    for a in (0.123, 0.375, 0.51, 0.874, 0.975):
        amplitude, shape = static_amplitude(link, RIGID + a * LENGTH, 1.0)
        ours = float(dot(shape.deflection, amplitude))
        if modes is not None:
            ours += float(shape.residual)
        s = a * ELEMENTS % 1
        inside = (s * (1 - s) / ELEMENTS) ** 3
        assert abs(ours - unit * (a**3 - inside)) < allowed * unit
        # What is missing is above that bound: without it the test would fail.
        assert inside > allowed


def test_static_deflection_with_the_force_shared_by_the_nodes():
    # Shared linearly, a force at s of an element is two forces at its nodes: each mode kept gets
    # its share L_i = (1 - s) phi_i(node) + s phi_i(next) of it, those left out yield by virtual
    # work: C = sum_kept phi_i L_i / (m_0 w_i^2) + sum_left phi_i^2 / (m_0 w_i^2).
    whole = make(None, load="shared")
    shape = whole.shape(jnp.asarray(RIGID + 0.61 * LENGTH))
    phi, load = (np.concatenate([np.ravel(b) for b in q]) for q in (shape.deflection, shape.load))
    square = np.concatenate([np.ravel(b) for b in whole.frequency_squared])
    # An element's middle fifth: the load there is not the deflection.
    assert np.max(np.abs(load - phi)) > 0.1
    for modes in (2, 5):
        link = make(modes, load="shared")
        amplitude, shape = static_amplitude(link, RIGID + 0.61 * LENGTH, 1.0)
        ours = float(dot(shape.deflection, amplitude)) + float(shape.residual)
        terms = phi * np.where(np.arange(phi.size) < modes, load, phi) / square
        assert ours == pytest.approx(terms.sum() / float(whole.mass_scale), rel=1e-9)


@pytest.mark.parametrize("share", [0.1, 0.4, 0.75, 0.95])
@pytest.mark.parametrize("modes", [1, 2, 4])
def test_modes_left_out_turn_the_fence(modes, share):
    # The slope under a static load at sigma is d/dx w(x; sigma) there, by Maxwell-Betti half of
    # dC / dsigma, C the compliance: modes kept and residual mode together give that of all 40
    # modes, and the residual mode alone the compliance that they lack.
    whole, few = make(None), make(modes)
    place = RIGID + share * LENGTH
    at = jnp.asarray(place)
    full, shape = whole.shape(at), few.shape(at)
    amplitude, _ = static_amplitude(whole, place, 1.0)
    slope = float(dot(full.slope, amplitude))
    kept, _ = static_amplitude(few, place, 1.0)
    deflection, lean = (float(q) for q in shape.residual_mode)
    ours = float(dot(shape.slope, kept)) + lean * deflection
    assert ours == pytest.approx(slope, rel=1e-6)
    assert deflection**2 == pytest.approx(float(shape.residual), rel=1e-6)
    # It matters: by more than a tenth near the joint.
    if share == 0.1:
        assert abs(lean * deflection) > 0.1 * slope


@pytest.mark.parametrize("modes", [1, 3, 12])
def test_bending_stress_under_a_static_load(modes):
    # sigma_b = P (a - x) / W(x), W = z h^2 / 6, with any number of modes: the share of the modes
    # kept is subtracted from the load's and added from their amplitudes, so only round-off is left.
    # `loads` press on the parcel, so the fence takes -P.
    link, load = make(modes), 400.0
    for a in (0.33, 0.62, 1.0):
        place = RIGID + a * LENGTH
        amplitude, shape = static_amplitude(link, place, -load)
        ours = jnp.abs(link.bending_stress(amplitude, (load,), (shape,)))
        x = np.arange(ELEMENTS) / ELEMENTS
        modulus = 0.12 * (0.05 * np.sqrt(1 - x)) ** 2 / 6
        exact = load * np.maximum(a - x, 0) * LENGTH / modulus
        # Terms of the sum of modes are up to about ten times the result.
        np.testing.assert_allclose(ours, exact, rtol=0, atol=100 * EPS * np.max(exact))
    # Constant strength: under a force at the tip every section carries the same stress.
    np.testing.assert_allclose(ours, ours[0], rtol=1e-12)


def test_load_and_vibration_add_with_their_signs():
    # The fence takes -P at a and vibrates besides: E I w'' = -P (a - x) + sum E I phi_i'' eta_i.
    # A mode that bends the tip up and a load that presses it down take from each other.
    link, load, place = make(3), 400.0, RIGID + 0.9 * LENGTH
    amplitude, shape = static_amplitude(link, place, -load)
    extra = (0.03, 0.004, -0.001)
    both = tuple(a + b for a, b in zip(amplitude, extra, strict=True))
    ours = jnp.abs(link.bending_stress(both, (load,), (shape,)))
    x = np.arange(ELEMENTS) / ELEMENTS
    moment = sum(np.array(table) * eta for table, eta in zip(link.bending, extra, strict=True))
    alone = np.abs(moment).max()
    moment = moment - load * np.maximum(0.9 - x, 0) * LENGTH
    exact = np.abs(moment) / (0.12 * 0.05**2 * (1 - x) / 6)
    np.testing.assert_allclose(ours, exact, rtol=0, atol=100 * EPS * np.max(exact))
    assert np.abs(moment).max() < alone


def test_bending_stress_of_a_mode():
    # sigma_b = E (h / 2) |w''| of the first mode alone, w'' from the shape's second difference over
    # one element: in error by h^2 / 12 w'''' / w'' and the element's own, below (k h)^2, with
    # k^4 = omega^2 rho A / (E I) = 21.2 / xi per l_p^4.
    link = make(1)
    ours = jnp.abs(link.bending_stress((jnp.asarray(0.01),), (), ()))
    shape = 0.01 * np.array(link.deflection[0])
    size = LENGTH / ELEMENTS
    bend = np.diff(shape, 2) / size**2
    xi = 1 - np.arange(1, ELEMENTS - 3) / ELEMENTS
    exact = 2.2e9 * 0.05 * np.sqrt(xi) / 2 * bend[: len(xi)]
    allowed = np.sqrt(21.2 / xi) / ELEMENTS**2
    assert np.all(np.abs(ours[1 : len(xi) + 1] / exact - 1) < allowed)


def test_two_loads_superpose():
    link = make(3)
    places = (RIGID + 0.4 * LENGTH, RIGID + 0.9 * LENGTH)
    loads = (300.0, 120.0)
    one, two = (static_amplitude(link, p, -f) for p, f in zip(places, loads, strict=True))
    amplitude = tuple(a + b for a, b in zip(one[0], two[0], strict=True))
    ours = jnp.abs(link.bending_stress(amplitude, loads, (one[1], two[1])))
    x = np.arange(ELEMENTS) / ELEMENTS
    moment = sum(
        f * np.maximum(p - RIGID - x * LENGTH, 0) for p, f in zip(places, loads, strict=True)
    )
    exact = moment / (0.12 * 0.05**2 * (1 - x) / 6)
    np.testing.assert_allclose(ours, exact, rtol=0, atol=100 * EPS * np.max(exact))


def test_inertias_and_damping():
    # integral of rho z h (l_s + x)^2 dx with h = h_1 sqrt(1 - x / l_p): 2/3, 4/15 and 16/105; the
    # rigid link's rho z h_1 l_s^3 / 3; c_i = 2 zeta omega_i^2 / omega_1. Round-off.
    link = make(3)
    m0 = 980.0 * 0.12 * 0.05 * LENGTH
    exact = m0 * (2 / 3 * RIGID**2 + 2 * 4 / 15 * RIGID * LENGTH + 16 / 105 * LENGTH**2)
    np.testing.assert_allclose(link.swing_inertia, exact, rtol=50 * EPS)
    np.testing.assert_allclose(
        link.root_inertia, 980.0 * 0.12 * 0.05 * RIGID**3 / 3, rtol=10 * EPS
    )
    ratio = np.array(link.damping) / (2 * np.sqrt(link.eigenvalues))
    np.testing.assert_allclose(ratio[0], 0.07, rtol=10 * EPS)
    np.testing.assert_allclose(
        ratio, 0.07 * np.sqrt(link.eigenvalues / link.eigenvalues[0]), rtol=10 * EPS
    )


# --- Free swing ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def swung():
    return jax.jit(swing)


def swing(link, drive, time):
    """The free swing up to a time, in its own number of steps."""
    step = jnp.asarray(time) / SWING_STEPS
    maps = link.propagators([step])
    return model.swung(link, drive, step, jax.tree.map(lambda values: values[0], maps))


def exact_swing(link, drive, time):
    """Each mode's equation to 1e-12 by an eighth-order Runge-Kutta method; harmonic drive."""
    turn = 2 * np.pi / float(drive.cycle_time)
    largest = float(drive.top_speed * drive.cycle_time) / np.pi
    states = []
    for value, c, p in zip(link.frequency_squared, link.damping, link.swing, strict=True):
        value, c, p = float(value), float(c), float(p)

        def rate(t, y, value=value, c=c, p=p):
            force = -p * 0.5 * largest * turn**2 * np.cos(turn * t)
            return [y[1], force - c * y[1] - value * y[0]]

        solution = solve_ivp(rate, (0, time), [0, 0], method="DOP853", rtol=1e-11, atol=1e-15)
        states.append(solution.y[:, -1])
    return np.array(states)


@pytest.mark.parametrize("time", [0.05, 0.3, 0.66])
def test_free_swing(time, swung):
    # The drive's acceleration is replaced by chords over time / 64 = h, off by h^2 / 8 of its
    # second derivative at most. Through a mode's impulse response g the error is at most
    # h^2 / 8 p max|alpha''''| integral|g|, with integral|g| = coth(pi zeta / (2 sqrt(1 - zeta^2)))
    # / omega^2, and that over omega more for the rate.
    link, drive = make(3), HarmonicDrive(1.5, 1.3)
    state = swung(link, drive, time)
    exact = exact_swing(link, drive, time)
    turn = 2 * np.pi / 1.3
    fourth = 0.5 * 1.5 * 1.3 / np.pi * turn**4
    for i in range(3):
        omega = float(jnp.sqrt(link.frequency_squared[i]))
        zeta = float(link.damping[i]) / (2 * omega)
        spread = 1 / np.tanh(np.pi * zeta / (2 * np.sqrt(1 - zeta**2)))
        bound = (time / 64) ** 2 / 8 * abs(float(link.swing[i])) * fourth * spread / omega**2
        assert abs(float(state.amplitude[i]) - exact[i, 0]) < bound
        assert abs(float(state.rate[i]) - exact[i, 1]) < 2 * bound * omega
        # The bound is meaningful: it is below 5 % of the deflection when the fence starts.
        start = abs(float(link.swing[i])) * fourth / turn**2 / omega**2
        assert bound < 0.05 * start


def test_free_swing_is_linear_in_the_drive_and_moves_at_its_rate(swung):
    # d eta / d alphadot_max = eta / alphadot_max exactly; d eta / d t is the rate up to the step's
    # error, h^2 / 12 alpha'''' of the force in both.
    link, time = make(3), 0.3

    def amplitude(speed, time):
        return jnp.stack(swing(link, HarmonicDrive(speed, 1.3), time).amplitude)

    values, (by_speed, by_time) = (
        jax.jit(amplitude)(1.5, time),
        jax.jit(jax.jacfwd(amplitude, (0, 1)))(1.5, time),
    )
    np.testing.assert_allclose(by_speed, values / 1.5, rtol=1e-11)
    rate = np.array(swung(link, HarmonicDrive(1.5, 1.3), time).rate)
    start = np.array(link.swing) * 0.5 * 1.5 * 1.3 / np.pi * (2 * np.pi / 1.3) ** 2
    speed = start / np.sqrt(np.array(link.frequency_squared))  # of the ringing
    np.testing.assert_allclose(by_time, rate, rtol=0, atol=1e-3 * np.max(np.abs(speed)))


def test_rest_and_tip():
    link = make(3)
    rest = link.rest()
    assert all(float(x) == 0 for x in (*rest.amplitude, *rest.rate))
    state = vibration(link)
    shape = shape_at(link, link.reach)
    np.testing.assert_allclose(
        link.tip_deflection(state.amplitude, (), ()),
        dot(shape.deflection, state.amplitude),
        rtol=1e-12,
    )


def test_few_and_many_modes_are_the_same_link():
    # Up to 8 modes are kept as scalars, more as one array: the same numbers in both layouts.
    few, many = make(3), make(12)
    for place in (0.5, 1.0):
        a, b = shape_at(few, place), shape_at(many, place)
        np.testing.assert_allclose(np.array(a.deflection), b.deflection[0][:3], rtol=1e-12)
        np.testing.assert_allclose(np.array(a.slope), b.slope[0][:3], rtol=1e-12)
    np.testing.assert_allclose(np.array(few.swing), many.swing[0][:3], rtol=1e-12)
    step = jnp.asarray(1e-3)
    one, other = (np.array(link.propagators([step])) for link in (few, many))
    np.testing.assert_allclose(one, other[..., :3], rtol=1e-12)


def test_a_fence_without_modes_is_rigid():
    link = make(0)
    shape = shape_at(link, 0.8)
    assert shape.deflection == ()
    assert shape.residual is None
    assert float(link.tip_deflection((), (), ())) == 0.0
    state = swing(link, HarmonicDrive(), 0.3)
    assert jax.tree.leaves(state) == []
