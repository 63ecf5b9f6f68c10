"""The largest static friction that smoothed friction holds, against its closed form."""

import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.fidelity import Smoothing
from fencejax.model import corner_share


@pytest.mark.parametrize("ratio", [0.2, 0.02, 0.002])
@pytest.mark.parametrize(("kinetic", "static"), [(0.35, 0.5), (0.65, 0.85), (0.2, 0.8)])
def test_what_holds_is_short_of_static_friction(ratio, kinetic, static):
    # With r = eps / w_s and z = (w / w_s)^2, for small r and z, smoothed friction is
    # mu_s - (mu_s - mu_k) z - mu_s r^2 / (2 z): at most mu_s - r sqrt(2 mu_s (mu_s - mu_k)), at
    # z = r sqrt(mu_s / 2 (mu_s - mu_k)). The next order is z / 4 + 5 z (mu_s - mu_k) / 4 mu_s of
    # that, at most 3 z / 2, and makes it less short.
    smoothing = Smoothing(ratio * 1e-3, 1e-3)
    speeds = smoothing.static_speed * np.geomspace(1e-2, 10, 20001)
    share, _ = corner_share(fj.Friction(kinetic, static), jnp.asarray(speeds), smoothing)
    short = static - np.max(-np.asarray(share))
    first_order = ratio * np.sqrt(2 * static * (static - kinetic))
    z = ratio * np.sqrt(static / (2 * (static - kinetic)))
    assert (1 - 1.5 * z) * first_order < short < first_order


def test_the_named_settings_have_one_ratio():
    for rung in ("coarse", "fast", "standard", "reference"):
        eps, scale = getattr(fj.Fidelity, rung)().smoothing
        assert scale == pytest.approx(5 * eps)
