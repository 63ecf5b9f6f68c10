"""Shadow prices of limits and bounds, and a weighted risk, against closed forms."""

import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.design import (
    Bounded,
    DesignVariable,
    ShadowPrices,
    conflict,
    relaxations,
    risk,
    shadow_prices,
)


def test_prices_are_the_slopes_of_the_least_objective():
    # min 3 (1 - z0) + z1 + z2 with z0 <= 0.6 and z1 >= z2: the limit holds z0 down, the lower
    # bounds z2 and, through the second limit, z1. The least objective is 1.2; a unit of the first
    # margin is worth 3, one of z1 >= z2 is worth 1, and z2 may go down at 1 + 1.
    def problem(z):
        margins = jnp.stack([0.6 - z[0], z[1] - z[2]])
        return 3 * (1 - z[0]) + z[1] + z[2], margins, jnp.zeros((), int)

    optimum = fj.minimize(problem, [0.2, 0.5, 0.4])
    assert optimum.objective == pytest.approx(1.2, rel=1e-3)
    prices = shadow_prices(optimum)
    # The conditions of an optimum hold to 1e-3 of the scale 3.3, the objective at the start.
    assert prices.margins[0] == pytest.approx(3.0, abs=7e-3)
    total = prices.lower[1] + prices.lower[2]
    assert total == pytest.approx(2.0, abs=1e-2)
    assert prices.margins[1] == pytest.approx(prices.lower[2] - 1, abs=1e-2)
    np.testing.assert_array_equal(prices.upper, np.zeros(3))


def test_a_conflict_says_which_limits_fight():
    # z0 >= 0.8 and 2 (0.5 - z0) >= 0: the largest violation is least where both are the same,
    # 0.8 - z0 = 2 z0 - 1, z0 = 0.6, and -w_1 + 2 w_2 = 0 with w_1 + w_2 = 1. The third holds.
    def problem(z):
        margins = jnp.stack([z[0] - 0.8, 2 * (0.5 - z[0]), z[1] + 1])
        return z[1], margins, jnp.zeros((), int)

    optimum = fj.minimize(problem, [0.1, 0.5])
    assert not optimum.feasible
    # To the tolerance of the search.
    assert optimum.last.violation == pytest.approx(0.2, abs=2e-3)
    np.testing.assert_allclose(conflict(optimum.last).margins, [2 / 3, 1 / 3, 0], atol=1e-9)


def test_a_bound_can_be_what_a_limit_fights():
    # 0.5 (z0 - 1.2) >= 0 within z0 <= 1: that bound alone is in its way, at the slope 0.5.
    def problem(z):
        return z[0], 0.5 * (z[:1] - 1.2), jnp.zeros((), int)

    found = conflict(fj.minimize(problem, [0.3]).last)
    np.testing.assert_allclose((found.margins[0], found.upper[0], found.lower[0]), (1, 0.5, 0))


@pytest.mark.parametrize("measure", ["mean", "cvar", "worst"])
def test_weights_count_as_often_as_a_value_comes(measure):
    values, counts = np.array([3.0, 9.0, 1.0, 5.0]), np.array([2, 1, 4, 3])
    repeated = risk.risk(np.repeat(values, counts), measure, 0.75)
    weighted = risk.risk(values, measure, 0.75, weights=counts / 10)
    # Sums of ten numbers: rounding alone.
    assert float(weighted) == pytest.approx(float(repeated), rel=1e-12)
    valid = np.array([True, False, True, True])
    left = risk.risk(np.repeat(values, counts), measure, 0.75, np.repeat(valid, counts))
    alike = risk.risk(np.where(valid, values, np.nan), measure, 0.75, valid, counts / 10)
    assert float(alike) == pytest.approx(float(left), rel=1e-12)


def test_a_limit_is_worth_the_rates_of_the_margins_that_it_would_free():
    """Two limits of two margins each; the second margin of the first is further away than a tenth
    of its bound, so that it does not decide. The other limit is 0, and steps by its margins' unit.
    """
    limits = [
        Bounded("stress", 40.0, "MPa", 20.0, True, (0, 1)),
        Bounded("sorted", 0.0, "m", 0.5, False, (2, 3)),
    ]
    thickness = DesignVariable("thickness", 0.02, 0.08, "m", "linear")
    ratio = DesignVariable("length_ratio", 0.0, 3.0, "1", "linear")
    prices = ShadowPrices(
        np.array([2.0, 7.0, 0.0, 5.0]), np.array([0.0, 9.0]), np.array([30.0, 0.0])
    )
    found = relaxations(
        limits, {"h": thickness, "ratio": ratio}, prices, np.array([0.0, 0.25, 0.0, 0.0])
    )
    upper, sorted_, stress = found
    assert (stress.name, stress.relaxed, stress.margins) == ("stress", 44.0, (0,))
    assert stress.gain == pytest.approx(2.0 * 4 / 20)
    assert (sorted_.name, sorted_.margins) == ("sorted", (3,))
    assert (sorted_.relaxed, sorted_.gain) == pytest.approx((-0.05, 5.0 * 0.05 / 0.5))
    # The bound of 0 is the number's own.
    assert (upper.name, upper.relaxed) == ("upper bound of h", pytest.approx(0.088))
    assert upper.gain == pytest.approx(30.0 * 0.008 / 0.06)
