"""A blow's velocity change, damage, and shock spectrum, against closed forms and other filters."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pictures import shows_data
from scipy import signal

import fencejax as fj
from fencejax.design import shock
from fencejax.results import Course


def half_sine(time, height, width):
    inside = (time > 0.01) & (time < 0.01 + width)
    return jnp.where(inside, height * jnp.sin(jnp.pi * (time - 0.01) / width), 0.0)


def test_impulse_of_the_largest_pulse_alone():
    # Of F sin(pi t / T) above a tenth: 2 F T / pi cos(arcsin 0.1).
    time = jnp.linspace(0, 0.2, 2001)

    def impulse(height, width):
        force = half_sine(time, height, width) + half_sine(time - 0.1, 90.0, 0.05)
        return shock.pulse_impulse(Course(time, force))

    share = 2 / np.pi * np.cos(np.arcsin(0.1))
    # Chords of a sine of 400 samples: (pi / 400)^2 / 12 = 5e-6 of the area; the level's own height
    # is that of a sample, 8e-6 below the top at most.
    (value, slopes) = jax.jit(jax.value_and_grad(impulse, (0, 1)))(100.0, 0.04)
    assert float(value) == pytest.approx(share * 100.0 * 0.04, rel=2e-5)
    assert float(slopes[0]) == pytest.approx(share * 0.04, rel=2e-5)
    assert float(slopes[1]) == pytest.approx(share * 100.0, rel=1e-3)
    # The other one, where it is the largest.
    assert float(impulse(80.0, 0.04)) == pytest.approx(share * 90.0 * 0.05, rel=2e-5)
    assert float(shock.pulse_impulse(Course(time, 0 * time))) == 0.0


def test_damage_needs_both():
    class Blow:
        peak_force, pulse_impulse = 981.0, 3.0

    scene = fj.scenes.rigid_wall(parcel=fj.Parcel(mass=2.0))
    load, change = 981.0 / (2 * 9.81), 1.5
    assert float(shock.damage_boundary(40.0, 1.0)(Blow, scene)) == pytest.approx(load / 40)
    assert float(shock.damage_boundary(20.0, 1.2)(Blow, scene)) == pytest.approx(change / 1.2)
    assert float(shock.damage_boundary(60.0, 1.0)(Blow, scene)) < 1
    assert float(shock.damage_boundary(20.0, 2.0)(Blow, scene)) < 1


def test_share_of_parcels_damaged():
    load, change = np.array([10.0, 50, 50, 80]), np.array([3.0, 0.5, 3, 4])
    assert float(shock.share_damaged(load, change, 40.0, 1.0)) == 0.5
    weights = np.array([1.0, 1, 5, 3])
    assert float(shock.share_damaged(load, change, 40.0, 1.0, weights=weights)) == 0.8
    # At both medians a quarter is damaged; d/dA of it is phi(0) / (2 s A_c).
    value, slope = jax.value_and_grad(
        lambda a: shock.share_damaged(a, jnp.ones(1), 40.0, 1.0, spread=0.3)[()]
    )(jnp.array([40.0]))
    assert float(value) == pytest.approx(0.25)
    assert float(slope[0]) == pytest.approx(0.5 / np.sqrt(2 * np.pi) / (0.3 * 40), rel=1e-9)
    assert float(shock.share_damaged(0 * load, change, 40.0, 1.0, spread=0.3)) == 0.0
    for refused, text in (
        ({"spread": -1.0}, "`spread` must be at least 0"),
        ({"weights": [1.0, -1, 1, 1]}, "`weights` must be at least 0"),
        ({"weights": np.zeros(4)}, "in all.* must be above 0"),
    ):
        with pytest.raises(ValueError, match=text):
            shock.share_damaged(load, change, 40.0, 1.0, **refused)


@pytest.mark.parametrize(
    ("time", "text"), [([0.0, 2, 1], "`time's steps` must be at least 0"), ([0.0, 1], "one shape")]
)
def test_a_history_that_goes_back_has_no_spectrum(time, text):
    with pytest.raises(ValueError, match=text):
        shock.pseudo_velocity_spectrum(time, [0.0, 2, 0], [1.0])


def filtered(acceleration, step, frequency, damping):
    """omega max |z| by the ramp-invariant filter of the oscillator, the course followed by two
    periods of nothing."""
    omega = 2 * np.pi * frequency
    plant = ([-1.0], [1.0, 2 * damping * omega, omega**2])
    above, below, _ = signal.cont2discrete(plant, step, method="foh")
    rest = np.zeros(int(2 / frequency / step))
    return omega * np.max(np.abs(signal.lfilter(above.ravel(), below, [*acceleration, *rest])))


def smallwood(acceleration, step, frequency):
    """The same without damping by Smallwood's own coefficients (1981), of the oscillator's absolute
    acceleration, which is then -omega^2 z."""
    omega = 2 * np.pi * frequency
    turn = omega * step
    cosine, slack = np.cos(turn), np.sin(turn) / turn
    above = [1 - slack, 2 * (slack - cosine), 1 - slack]
    rest = np.zeros(int(2 / frequency / step))
    response = signal.lfilter(above, [1, -2 * cosine, 1], [*acceleration, *rest])
    return np.max(np.abs(response)) / omega


STEP = 1e-4
FREQUENCIES = np.array([1.0, 7.3, 21.0, 60.0, 133.0, 300.0])


def course(time, width):
    """A half-sine, and an irregular pulse after it."""
    return half_sine(time, 300.0, width) + 40 * jnp.sin(900 * time) * jnp.exp(-time / 0.01)


def test_shock_spectrum_against_recursive_filters():
    time = np.arange(0, 0.08, STEP)
    spectrum = jax.jit(shock.pseudo_velocity_spectrum, static_argnums=3)
    pulse = np.array(course(time, 0.03))
    # At rest as it ends, where a filter takes the step back to nothing for a ramp.
    pulse[-1] = 0.0
    for damping in (0.0, 0.05, 0.3):
        ours = np.asarray(spectrum(time, pulse, FREQUENCIES, damping))
        theirs = [filtered(pulse, STEP, f, damping) for f in FREQUENCIES]
        # Both are exact at samples; after the end the filter alone looks at samples.
        np.testing.assert_allclose(ours, theirs, rtol=0.5 * (np.pi * 300 * STEP) ** 2)
        np.testing.assert_allclose(ours[:2], theirs[:2], rtol=1e-5)
        # Poles of the filter 1e-3 from 1 lose half of the digits.
        assert np.all(ours > np.array(theirs) * (1 - 1e-7))
        if damping == 0:
            theirs = [smallwood(pulse, STEP, f) for f in FREQUENCIES]
            np.testing.assert_allclose(ours, theirs, rtol=0.5 * (np.pi * 300 * STEP) ** 2)
    # Far below the pulse's frequencies it is the velocity change, far above the acceleration.
    low = float(spectrum(time, pulse, np.array([0.05]), 0.0)[0])
    assert low == pytest.approx(np.trapezoid(pulse, time), rel=1e-3)


@pytest.mark.parametrize(
    ("frequencies", "damping", "message"),
    [
        ([5.0], 1.2, r"`damping_ratio` must be below 1 \[1\], but is 1.2"),
        ([5.0], 1.0, r"`damping_ratio` must be below 1 \[1\], but is 1"),
        ([5.0], -0.1, r"`damping_ratio` must be at least 0 \[1\], but is -0.1"),
        ([5.0, 0.0], 0.05, r"`frequencies` must be above 0 \[Hz\], but is 0"),
    ],
)
def test_a_shock_spectrum_of_what_does_not_ring_is_refused(frequencies, damping, message):
    with pytest.raises(ValueError, match=message):
        shock.pseudo_velocity_spectrum([0.0, 0.1], [1.0, 1.0], frequencies, damping)


def test_slope_of_a_shock_spectrum():
    time = np.arange(0, 0.08, STEP)

    def ours(width):
        return shock.pseudo_velocity_spectrum(time, course(time, width), FREQUENCIES[:3])

    # No sample at the pulse's end, where its slope jumps.
    slopes = np.asarray(jax.jit(jax.jacfwd(ours))(0.03005))
    wide, thin = (np.asarray(course(time, 0.03005 + d)) for d in (1e-5, -1e-5))
    for frequency, slope in zip(FREQUENCIES, slopes, strict=False):
        change = [filtered(pulse, STEP, frequency, 0.05) for pulse in (wide, thin)]
        # The peak of the filter is that of a sample: off by (pi f h)^2 / 2, as is its slope.
        assert slope == pytest.approx((change[0] - change[1]) / 2e-5, rel=2e-3)


def test_figure_of_a_shock_spectrum(tmp_path):
    time = np.arange(0, 0.08, STEP)
    frequencies = np.geomspace(2, 500, 60)
    values = shock.pseudo_velocity_spectrum(time, course(time, 0.03), frequencies)
    axes = fj.plot.shock_spectrum(
        frequencies, {"blow": values}, critical_load=50.0, critical_velocity_change=2.0
    )
    assert axes.get_xscale() == axes.get_yscale() == "log"
    first = axes.lines[0]
    np.testing.assert_allclose(first.get_ydata(), values)
    # 50 g at 10 Hz.
    bound = axes.lines[1]
    np.testing.assert_allclose(
        bound.get_ydata() * 2 * np.pi * bound.get_xdata(), 50 * 9.81, rtol=1e-12
    )
    assert [t.get_text() for t in axes.get_legend().get_texts()] == ["blow", "50 g", "2 m/s"]
    assert {"10 g", "10 mm"} <= {t.get_text() for t in axes.texts}
    axes.figure.savefig(tmp_path / "spectrum.png", dpi=100)
    assert shows_data(tmp_path / "spectrum.png")
    with pytest.raises(ValueError, match="one shape"):
        fj.plot.shock_spectrum(frequencies, values[:5])
    with pytest.raises(ValueError, match="above 0"):
        fj.plot.shock_spectrum(frequencies, 0 * values)
