"""The loads that the model leaves out, in the independent version of the impact."""

import numpy as np
import pytest

from .impact import Impact, solve
from .second_order import POISSON, SHEAR_SHAPE, More

IMPACT = Impact(distance=1.0, load="cubic", modes=4, horizon=0.02)


def test_without_loads_it_is_the_impact():
    plain, same = (
        solve(IMPACT, rtol=1e-6, samples=51, more=more)
        for more in (None, More(frozenset(), IMPACT))
    )
    # LSODA's error, of a force that grows with the fourth power of the depth.
    np.testing.assert_allclose(same.force, plain.force, rtol=1e-4, atol=1e-4 * plain.force.max())


def test_shear_yields_as_a_beam_of_constant_strength_does():
    # The integral of 1 / (k G z h) to the middle, by 10,000 slices.
    more = More(frozenset({"shear"}), IMPACT)
    x = (np.arange(10000) + 0.5) / 10000 * 0.5 * IMPACT.l_p
    h = IMPACT.thickness * np.sqrt(1 - x / IMPACT.l_p)
    modulus = IMPACT.E / (2 * (1 + POISSON))
    expected = np.sum(x[1] - x[0]) * np.sum(1 / (SHEAR_SHAPE * modulus * IMPACT.width * h))

    class Touch:
        element, arc = 10, IMPACT.l_s + 0.5 * IMPACT.l_p

    assert more._yielding(Touch) == pytest.approx(expected, rel=1e-6)


def test_tension_stiffens_as_a_straight_line_does():
    # A unit slope all along the link: the integral of w'^2 is its length.
    link = IMPACT.link
    slopes = More(frozenset(), IMPACT)._stiffening(IMPACT.elements - 1, IMPACT.l_p / 20)
    size = IMPACT.l_p / IMPACT.elements
    along = np.linspace(0, IMPACT.l_p, IMPACT.elements + 1)
    # Of the first mode by differences of its nodes: of the second order in the elements.
    expected = np.sum(np.diff(link.displacement[:, 0]) ** 2 / np.diff(along))
    assert slopes[0, 0] == pytest.approx(expected, rel=2 * size)
