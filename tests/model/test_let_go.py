"""The largest smoothed friction, against closed forms."""

import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.model import corner_share

RUNGS = ("coarse", "fast", "standard", "reference")


@pytest.mark.parametrize("rung", RUNGS)
@pytest.mark.parametrize(("kinetic", "static"), [(0.35, 0.5), (0.65, 0.85), (0.2, 0.8)])
def test_the_largest_friction_is_the_static_one(rung, kinetic, static):
    # With r = eps / w_s and z = (w / w_s)^2, for small r and z, smoothed friction is
    # mu_s - (mu_s - mu_k) z - mu_s r^2 / (2 z): at most mu_s - r sqrt(2 mu_s (mu_s - mu_k)), at
    # z = r sqrt(mu_s / 2 (mu_s - mu_k)). What is left out is of the order z of that.
    smoothing = getattr(fj.Fidelity, rung)().smoothing
    speeds = smoothing.static_speed * np.geomspace(1e-2, 10, 20001)
    share, _ = corner_share(fj.Friction(kinetic, static), jnp.asarray(speeds), smoothing)
    short = static - np.max(-np.asarray(share))
    ratio = smoothing.slip_speed / smoothing.static_speed
    first_order = ratio * np.sqrt(2 * static * (static - kinetic))
    assert short == pytest.approx(first_order, rel=0.05)
    # sqrt(2) r with no kinetic friction at all.
    assert short < 0.03 * static


@pytest.mark.parametrize("sharper", [1, 5])
def test_a_parcel_lets_go_of_the_belt_at_static_friction(sharper):
    """A slow belt presses a parcel into a still fence, until the force N on its corner tears it
    off. With the lever r of N about C_s the limit surface is N^2 + (N r / c)^2 = (mu_s m g)^2."""
    kinetic, static, angle = 0.65, 0.85, 0.3
    parcel = fj.Parcel(stiffness=1e13)
    scene = fj.scenes.oblique_impact(
        parcel=parcel, drive=fj.HeldDrive(angle, 2.0), parcel_angle=0.2, duration=0.7,
        belt=fj.Belt(speed=0.01, friction=fj.Friction(kinetic, static)), fence_friction=None,
    )  # fmt: skip
    usual = fj.Fidelity.standard(modes=0)
    fidelity = usual.replace(
        slip_speed=usual.slip_speed / sharper, static_speed=usual.static_speed / sharper
    )
    history = fj.simulate(scene, fidelity=fidelity, history=True).history
    forces = np.asarray(history.fence_force)
    peak = int(np.argmax(forces))
    x, y = (float(number) for number in parcel.corner(1))
    turned = float(history.body.angle[peak]) - angle
    lever = x * np.cos(turned) - y * np.sin(turned)
    weight = float(parcel.mass) * 9.81
    largest_force = static * weight / np.hypot(1, lever / float(parcel.mean_distance))
    # Smoothed friction is short of it by (eps / w_s) sqrt(2 (mu_s - mu_k) / mu_s), 1.4 %; the force
    # goes on rising until the parcel slides at w_s, by half as much.
    assert forces[peak] == pytest.approx(largest_force, rel=0.0137)
    # Then the belt slips under it, beyond what is smoothed.
    slip = np.max(np.abs(history.body.x_rate[peak:] - 0.01))
    assert slip > 2 * fidelity.static_speed
