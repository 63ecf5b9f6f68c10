"""The loads that the model leaves out, in the independent version of the impact."""

import numpy as np
import pytest

from .impact import Fence, Impact, solve
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


def test_a_force_loads_the_modes_by_the_motion_of_its_place():
    # How each mode moves the point at a fixed place, by central differences: to their round-off.
    rng = np.random.default_rng(4)
    count, step = IMPACT.link.frequency.size, 1e-5
    state = 0.2 * rng.uniform(-1, 1, 2 * count) / np.arange(1, 2 * count + 1)

    class Touch:
        element, local = 14, 0.4 * IMPACT.l_p / IMPACT.elements

    def place(mode, size):
        moved = state + size * np.eye(2 * count)[mode]
        return np.array(Fence(IMPACT, 0.0, moved).point(Touch.element, Touch.local)[0])

    found = More(frozenset(), IMPACT).moved(Fence(IMPACT, 0.0, state), Touch)
    for mode in range(count):
        expected = (place(mode, step) - place(mode, -step)) / (2 * step)
        np.testing.assert_allclose(found[:, mode], expected, rtol=1e-7, atol=1e-9)
