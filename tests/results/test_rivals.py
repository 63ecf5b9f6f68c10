"""Instants at which the fence's force may be largest, and their part in the estimated error of
gradients."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from robustness.searched_scenes import KINDS, changed

import fencejax as fj
from fencejax.results import Peak, Span, rivals

STEP = 0.05
TIMES = STEP * np.arange(100)


def bump(time, at):
    """A bump of height 1 and of a width of half a second."""
    return jnp.exp(-(((time - at) / 0.5) ** 2))


def two_bumps(heights, time):
    return heights[0] * bump(time, 1.51) + heights[1] * bump(time, 3.52)


def shoulder(heights, time):
    """A rise that comes to rest, and a bump upon it."""
    rise = 0.5 * (1 + jnp.tanh((time - 1.5) / 0.4))
    return heights[0] * rise + heights[1] * bump(time, 3.52)


def ranges(force, heights, tolerance):
    """The largest force at a rival, and the least and the most of the derivatives in the heights,
    each of the shape (2,). There are no modes: forces are known to the tolerance of the steps."""
    watched = rivals.rivals(tolerance)

    def run(heights):
        zero = 0.0 * heights[0]

        def step(carry, time):
            peak, contact, state = carry
            now, first = force(heights, time), time == 0
            span = Span(jnp.where(first, 0.0, STEP), first, 1.0)
            names = "force_before", "rate_before", "length_before"
            before = SimpleNamespace(**dict(zip(names, contact, strict=True)))
            given = SimpleNamespace(
                known={"force": peak, "contact": before, "resolution": None, "deepest": zero},
                span=span, cutoff=None, before=SimpleNamespace(fence_force=peak.now),
                now=SimpleNamespace(fence_force=now),
            )  # fmt: skip
            state = watched.update(state, given)
            contact = peak.now, (peak.now - before.force_before) / STEP, span.length
            return (peak.update(now, time, span), contact, state), None

        nothing = SimpleNamespace(time=zero)
        begin = Peak.start(zero), (zero, zero, zero), watched.start(nothing, None)
        (_, _, state), _ = jax.lax.scan(step, begin, jnp.asarray(TIMES))
        return state, state

    slopes, state = jax.jit(jax.jacfwd(run, has_aux=True))(jnp.asarray(heights))
    assert state.least == 0
    assert state.most == 0
    return float(state.largest), np.asarray(slopes.least), np.asarray(slopes.most)


# A parabola through samples of a bump misses h^4 N'''' / 128 of its height: 12 / 0.5^4 * 0.05^4 /
# 128 = 1e-5; the other bump adds exp(-16) there.
TOLERANCE = 2e-5


@pytest.mark.parametrize("heights", [(1.0, 0.98), (0.98, 1.0)])
def test_maxima_about_as_high_are_estimated(heights):
    largest, least, most = ranges(two_bumps, heights, 0.05)
    assert largest == pytest.approx(1.0, abs=TOLERANCE)
    np.testing.assert_allclose(least, [0, 0], atol=TOLERANCE)
    np.testing.assert_allclose(most, [1, 1], atol=TOLERANCE)


@pytest.mark.parametrize("heights", [(1.0, 0.9), (0.9, 1.0)])
def test_the_highest_stands_alone_otherwise(heights):
    largest, least, most = ranges(two_bumps, heights, 0.05)
    assert largest == pytest.approx(1.0, abs=TOLERANCE)
    only = [1, 0] if heights[0] > heights[1] else [0, 1]
    np.testing.assert_allclose(least, only, atol=TOLERANCE)
    np.testing.assert_allclose(most, only, atol=TOLERANCE)


def test_a_shoulder_counts_as_a_maximum_that_may_be():
    """Where a small error of the force would make one of it: between the rise and the bump."""
    _, least, most = ranges(shoulder, (1.0, 0.02), 0.05)
    # Both hang on the rise; on the bump the later one does in full, the shoulder next to nothing.
    assert least[1] < 0.1
    assert most[1] == pytest.approx(1.0, abs=0.01)
    # Of a bump so high that the rise is far below, it is the bump alone.
    _, least, most = ranges(shoulder, (1.0, 0.2), 0.05)
    np.testing.assert_allclose(least, most, rtol=1e-12)


# A soft parcel on a light fence: its force has two maxima 1.3 ms apart that are equal within
# 0.04 %, and four modes make a rise with a shoulder of the first one. Found by searching.
TIED = {
    "thickness": 0.0454287, "reach": 1.05972, "flexible": 0.724328, "width": 0.0613673,
    "modulus": 373953000.0, "density": 491.644, "damping_ratio": 0.00419874, "mass": 5.64418,
    "length": 0.170169, "aspect": 0.324565, "across": -0.375726, "along": 0.155109,
    "stiffness": 36944600.0, "damping": 988888.0, "belt": 2.71112, "gravity": 9.81,
    "belt_kinetic": 0.113987, "belt_static": 0.264677, "kinetic": 0.228253, "static": 0.240054,
    "top_speed": 0.549785, "place": 0.788149, "angle": 0.154713, "approach": 2.17066,
    "ride": 2.71112,
}  # fmt: skip


def test_a_peak_that_may_be_another_one_has_a_gradient_in_doubt():
    """The last rung tells the two apart."""
    varied = {name: jnp.asarray(TIED[name]) for name in KINDS["impact"].varied}

    def found(fidelity):
        def peak(varied):
            scene = KINDS["impact"].scene(changed(TIED, varied))
            result = fj.simulate(scene, fidelity=fidelity, only="peak_force")
            return result.peak_force, result

        slopes, result = jax.jit(jax.jacfwd(peak, has_aux=True))(varied)
        along = np.array([slopes[name] * varied[name] for name in varied]) / result.peak_force
        return along, result

    rungs = fj.Fidelity.standard().ladder()
    (slopes, first), (true, last) = map(found, (rungs[0], rungs[-1]))
    # The lag of the modes left out tells, too.
    assert first.status == fj.Status.MODES_TOO_FEW
    assert first.gradient_error > 0.1
    off = np.linalg.norm(slopes - true) / np.linalg.norm(slopes)
    assert 0.15 < off < 1.5 * first.gradient_error
    assert first.peak_force == pytest.approx(float(last.peak_force), rel=5e-3)
    assert last.status <= fj.Status.LEFT_OVER_TIP
    assert last.gradient_error < 1e-3
