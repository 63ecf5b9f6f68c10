"""Laplace's posterior: a bent model in closed form, and a simulated impact."""

import numpy as np
import pytest

import fencejax as fj
from fencejax.study import Experiment, Recording, fit, laplace


class Bent:
    """Residuals x and c + k x^2 / 2 with x = (u - 1/2) / width: half their squares' sum bends by
    1 + c k at its least, of which Gauss and Newton see 1."""

    width = 0.01

    def __init__(self, lift, bend, kink=0.0):
        self.lift, self.bend, self.kink = lift, bend, kink
        self.parameters = (fj.DesignVariable("thickness", 0.0, 1.0, "m", "linear"),)
        self.spans = np.ones(1)

    def stacked(self, shares, noise):
        x = (shares[0] - 0.5) / self.width
        high = np.maximum(x - 0.5, 0.0)
        left = np.array([x, self.lift + 0.5 * self.bend * x**2, self.kink * high])
        rows = np.array([1.0, self.bend * x, self.kink * (x > 0.5)]) / self.width
        return left, rows[:, None]

    def curvature(self, shares, noise):
        return np.array([[(1 + self.lift * self.bend) / self.width**2]])

    def sampled(self):
        """The standard deviation of the posterior itself, by quadrature."""
        shares = np.linspace(0.4, 0.6, 2001)
        costs = np.array([0.5 * np.sum(self.stacked([u], {})[0] ** 2) for u in shares])
        density = np.exp(costs.min() - costs)
        mean = np.sum(density * shares) / np.sum(density)
        return np.sqrt(np.sum(density * (shares - mean) ** 2) / np.sum(density))


@pytest.mark.parametrize("lift", [300.0, -50.0])
def test_bent_residuals_change_the_errors(lift):
    # c k = 3 and -1/2: half and 1.41 times the error of straight lines. What Laplace leaves out is
    # the fourth order, (k x^2)^2 / 8 with x^2 up to 2: 1e-4.
    bent = Bent(lift, 0.01)
    found = laplace(bent, np.array([0.5]), {}, 1.0, np.array([bent.width]))
    exact = 1 / np.sqrt(1 + lift * 0.01)
    np.testing.assert_allclose(found.ratios, [exact], rtol=1e-12)
    np.testing.assert_allclose(found.standard_errors, [bent.sampled()], rtol=3e-4)
    assert found.holds


def test_a_kink_within_the_error_is_reported():
    # Beyond half a standard error the model bends: over a whole one to each side the slope changes
    # by 9 (1 - 1/2) / 2 more.
    bent = Bent(0.0, 0.0, kink=3.0)
    found = laplace(bent, np.array([0.5]), {}, 1.0, np.array([bent.width]))
    assert found.unsteadiness == pytest.approx(2.25, rel=1e-9)
    assert not found.holds


def test_no_minimum_has_no_errors():
    bent = Bent(-200.0, 0.01)
    found = laplace(bent, np.array([0.5]), {}, 1.0, np.array([bent.width]))
    assert np.all(np.isinf(found.standard_errors))
    assert not found.holds


def test_of_a_simulated_impact():
    # Of small noise the residuals' curvature is as good as nothing: that of the signal over its
    # slope, some units in ln k, times the noise over the signal, 1 %, times n^(-1/2).
    def scene(stiffness):
        return fj.scenes.rigid_wall(
            parcel=fj.Parcel(stiffness=stiffness), speed=1.0, duration=0.02
        )

    fidelity = fj.Fidelity.fast()
    time = np.linspace(0.0, 0.02, 61)[1:]
    history = fj.simulate(scene(1.2e9), fidelity=fidelity, only=("history",)).history.at(time)
    force = np.asarray(history.fence_force)
    noise = 0.01 * np.max(force)
    force = force + noise * np.random.default_rng(0).normal(size=force.size)
    found = fit(
        Experiment(scene(1.6e9), Recording(time, {"force": force}, "impact.csv")),
        ["stiffness"], noise={"force": noise}, fidelity=fidelity, posterior=True,
    )  # fmt: skip
    assert found.posterior.holds, found.posterior
    np.testing.assert_allclose(found.posterior.ratios, 1.0, atol=0.05)
    # Not the same number: second derivatives there are.
    assert abs(found.posterior.ratios[0] - 1) > 1e-5
