"""The error of a peak's derivative by a parabola through samples, against signals known exactly."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fencejax.results import Span, peak_kink


def bends(force, times):
    """Of a force of the time at each sample between the first and the last."""
    found = []
    for before, now, new in zip(times, times[1:], times[2:], strict=False):
        a, b, c = force(before), force(now), force(new)
        length = new - now
        ratio = (now - before) / length
        span = Span(jnp.asarray(length), jnp.asarray(False), jnp.asarray(ratio))
        second = 2 * (c - b + (a - b) / ratio) / (1 + ratio)
        found.append(peak_kink.Parabola.of(a, b, c, second, span))
    return found


def derivative(number, at=0.0):
    return float(jax.jacfwd(number)(jnp.asarray(at)))


# Six samples; the step in question is from the third to the fourth.
TIMES = (
    np.array([-2.5, -1.5, -0.5, 0.5, 1.5, 2.5]),
    np.array([-6.0, -4.0, -1.0, 0.5, 1.0, 1.25]),
    np.array([-1.2, -0.8, -0.4, 1.6, 2.6, 3.1]),
)


@pytest.mark.parametrize("times", TIMES)
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
@pytest.mark.parametrize("after", [True, False])
def test_the_jump_at_a_kink_that_is_the_peak(times, share, after):
    """The force rises by 3 to the kink and falls by 5 from there on; the kink moves with p. So N_p
    jumps by 8 there, whatever the steps."""
    kink = times[2] + share * (times[3] - times[2])

    def missed(p):
        def force(t):
            return jnp.where(t < kink + p, 3 * (t - kink - p), -5 * (t - kink - p))

        at_second, at_third = peak_kink.missed_by_kink(*bends(force, times))
        return at_second if after else at_third

    np.testing.assert_allclose(abs(derivative(missed)), 8.0, rtol=1e-12)


@pytest.mark.parametrize("times", TIMES)
def test_a_kink_beside_a_peak_counts_by_the_weight_of_the_sample_beyond(times):
    """An even force has its maximum a tenth of a step before the sample, and falls by 8 more from
    the middle of the step after it: the parabola's derivative is off by just the estimate, where
    the force is straight but for the vertex that the three samples see."""
    h_0, h = times[2] - times[1], times[3] - times[2]
    kink = times[2] + 0.5 * h

    def force(t, p):
        # So slightly bent that the differences outside the step are next to those of the kink.
        even = -1e-3 * (t - times[2]) ** 2 - 1e-3 * (t - times[2])
        return even - jnp.where(t < kink + p, 0.0, 8 * (t - kink - p))

    def missed(p):
        return peak_kink.missed_by_kink(*bends(lambda t: force(t, p), times))[0]

    def vertex(p):
        a, b, c = (force(t, p) for t in times[1:4])
        bend = ((c - b) / h - (b - a) / h_0) / (h + h_0)
        slope = (b - a) / h_0 + bend * h_0
        return b - slope**2 / (4 * bend)

    # The peak itself does not go with the kink.
    np.testing.assert_allclose(abs(derivative(missed)), abs(derivative(vertex)), rtol=0.02)


@pytest.mark.parametrize("times", TIMES)
def test_a_cubic_has_no_kink(times):
    """Nor does one that moves: what is missed of it is the next term of Newton's series."""

    def force(t, p):
        return -((t - 0.1 - p) ** 2) + 0.05 * (t - p) ** 3

    def of_kink(p):
        return peak_kink.missed_by_kink(*bends(lambda t: force(t, p), times))[0]

    def next_term(p):
        _, b, c, _ = bends(lambda t: force(t, p), times)
        return b.next_term(peak_kink.third_difference(b, c))

    assert abs(derivative(of_kink)) < 1e-12
    # N_p = 2 (t - 0.1 - p) - 0.15 (t - p)^2 is a parabola.
    assert abs(derivative(next_term)) < 1e-12

    def quartic(p):
        _, b, c, _ = bends(lambda t: force(t, 0.0) + p * (t - times[2]) ** 3, times)
        return b.next_term(peak_kink.third_difference(b, c))

    # N_p is a cubic: the product of the distances from three samples, half a step from the second.
    before, after = times[2] - times[1], times[3] - times[2]
    opposite, near = (before, after) if 0.1 > times[2] else (after, before)
    expected = 0.5 * near * (opposite + 0.5 * near) * 0.5 * near
    np.testing.assert_allclose(abs(derivative(quartic)), expected, rtol=1e-12)
