"""The positions of points of a bent link: the three geometries against each other and the paper."""

import jax.numpy as jnp
import numpy as np
import pytest
from model.links import (
    ELEMENTS,
    EPS,
    LENGTH,
    RIGID,
    make,
    shape_at,
    vibration,
)

from fencejax.model import dot, small_point

# --- Geometry -----------------------------------------------------------------------------------


@pytest.mark.parametrize("place", [0.0, 0.11, 0.3])
def test_nothing_bends_on_the_rigid_link(place):
    link = make(3)
    shape = shape_at(link, place)
    state = vibration(link)
    assert [float(x) for x in (*shape.deflection, *shape.slope, shape.residual)] == [0.0] * 7
    zero = jnp.zeros(())
    chord = link.chord_point(shape, state, zero, zero, zero)
    small = small_point(shape.place, zero, zero, zero)
    np.testing.assert_allclose(chord, (place, 0, 0, 0, 0), rtol=0, atol=EPS)
    np.testing.assert_allclose(small, (place, 0, 0, 0, 0), rtol=0, atol=0)


def test_slope_is_the_derivative_of_the_deflection():
    # One cubic: central differences over 2 d are in error by d^2 / 6 w'''; round-off eps / d.
    link = make(3)
    d = 1e-5
    for place in (0.33, 0.7, 0.93, 1.0999):
        high, low = (shape_at(link, place + s * d) for s in (1, -1))
        if place > 1.09:  # up to the tip only
            place, high = place - d / 2, shape_at(link, place)
            d_used = d / 2
        else:
            d_used = d
        slope = shape_at(link, place).slope
        for a, b, ours in zip(high.deflection, low.deflection, slope, strict=True):
            np.testing.assert_allclose((a - b) / (2 * d_used), ours, rtol=0, atol=1e-6)


@pytest.mark.parametrize("modes", [3, 12])
def test_beyond_the_tip_the_line_goes_straight_on(modes):
    # w(R + e) = w(R) + e w'(R); the same point in the chord geometry moves along (cos, sin) of the
    # slope. Round-off.
    link = make(modes)
    tip, beyond = (shape_at(link, place) for place in (1.1, 1.104))
    for w0, s0, w1, s1 in zip(
        tip.deflection, tip.slope, beyond.deflection, beyond.slope, strict=True
    ):
        np.testing.assert_allclose(w1, w0 + 0.004 * s0, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(s1, s0, rtol=1e-12)
    state = vibration(link)
    zero = jnp.zeros(())
    a, b = (link.chord_point(shape, state, zero, zero, zero) for shape in (tip, beyond))
    np.testing.assert_allclose(b.slope, a.slope, rtol=1e-12)
    np.testing.assert_allclose(b.x - a.x, 0.004 * jnp.cos(a.slope), rtol=1e-10)
    np.testing.assert_allclose(b.y - a.y, 0.004 * jnp.sin(a.slope), rtol=1e-10)


def reference_chain(link, place, amplitude):
    """(2.14)-(2.17) written out with a loop, in the frame of the rigid link."""
    size = LENGTH / ELEMENTS
    join = np.concatenate if np.ndim(amplitude[0]) else np.array
    eta = join(amplitude)
    tables = [
        np.concatenate([np.atleast_2d(np.array(block).T).T for block in blocks], 1)
        for blocks in (link.deflection, link.slope)
    ]
    q3, q5 = tables[0] @ eta, tables[1] @ eta / LENGTH
    i = min(int((place - RIGID) / size), ELEMENTS - 1)
    d = place - RIGID - i * size
    x, y = RIGID, 0.0
    for k in range(i):
        angle = (q3[k + 1] - q3[k]) / size
        x, y = x + size * np.cos(angle), y + size * np.sin(angle)
    r = d / size
    here = (
        (1 - 3 * r**2 + 2 * r**3) * q3[i] + (r - 2 * r**2 + r**3) * size * q5[i]
        + (3 * r**2 - 2 * r**3) * q3[i + 1] + (r**3 - r**2) * size * q5[i + 1]
    )
    angle = (here - q3[i]) / d
    return x + d * np.cos(angle), y + d * np.sin(angle), here


@pytest.mark.parametrize("modes", [3, 12])
@pytest.mark.parametrize("place", [0.32, 0.777, 1.09])
def test_chord_geometry_is_the_papers(modes, place):
    link = make(modes)
    state, zero = vibration(link), jnp.zeros(())
    shape = shape_at(link, place)
    ours = link.chord_point(shape, state, zero, zero, zero)
    x, y, deflection = reference_chain(link, place, state.amplitude)
    # Round-off of a sum of 20 chords of angles up to 0.1.
    np.testing.assert_allclose((ours.x, ours.y), (x, y), rtol=0, atol=20 * EPS)
    np.testing.assert_allclose(
        float(dot(shape.deflection, state.amplitude)), deflection, rtol=0, atol=20 * EPS
    )
    # Velocity along the motion eta + t etadot: central differences, d^2 / 6 third derivatives.
    d = 1e-6
    high, low = (
        reference_chain(
            link, place,
            tuple(a + s * d * b for a, b in zip(state.amplitude, state.rate, strict=True)),
        )
        for s in (1, -1)
    )
    np.testing.assert_allclose(
        (ours.x_rate, ours.y_rate), (np.subtract(high, low) / (2 * d))[:2], rtol=0, atol=1e-8
    )


def test_chord_and_small_geometry_agree_to_second_order():
    # Chords of angle theta: x is short by sum of size theta^2 / 2, y by sum of size theta^3 / 6:
    # the differences shrink by 4 and by 8 when the amplitude is halved, up to the next even order,
    # theta^2 / 4 with theta < 0.2.
    link, place, zero = make(3), 1.0, jnp.zeros(())
    shape = shape_at(link, place)
    gaps = []
    for scale in (1.0, 0.5):
        state = vibration(link, scale)
        chord = link.chord_point(shape, state, zero, zero, zero)
        w = dot(shape.deflection, state.amplitude)
        rate = dot(shape.deflection, state.rate)
        slope = dot(shape.slope, state.amplitude)
        small = small_point(shape.place, w, rate, slope)
        assert float(chord.slope) == float(small.slope)
        gaps.append([float(b - a) for a, b in zip(chord, small, strict=True)])
    ratio = np.array(gaps[0])[:4] / np.array(gaps[1])[:4]
    np.testing.assert_allclose(ratio, [4, 8, 4, 8], rtol=1e-2)
    assert gaps[0][0] > 1e-4  # the chain's point lies nearer to the hinge
