"""Friction that turns round within a step: against the motion of one corner, and in a scene."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from robustness.searched_scenes import KINDS, changed
from runs import one_by_one
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fencejax as fj
from fencejax.fidelity import Smoothing
from fencejax.integrators import friction_turn
from fencejax.model import corner_share

MU, EPS = 0.3, 1.5e-4
FRICTION, SMOOTHING = fj.Friction(MU, MU), Smoothing(EPS, 5 * EPS)
# What friction of mu = 1, and all else, change the sliding by in a step [m/s].
GAIN, PULL = 0.06, -0.03


def share(speed):
    return corner_share(FRICTION, jnp.asarray(speed), SMOOTHING)[0]


def end(before, held):
    """The sliding speed at which the step's equation, 0.5 (start + end) but for what is added,
    holds; friction that held the corner counts by the end alone."""
    rule = friction_turn._from_hold if held else friction_turn._from_sliding

    @jax.jit
    def residual(after):
        was, now = share(before), share(after)
        corner = friction_turn._Corner(
            jnp.asarray(before), after, jnp.asarray(MU), jnp.asarray(GAIN), EPS, was, now
        )
        mean = (2 * now if held else was + now) + rule(corner).share
        return after - before - PULL - 0.5 * GAIN * mean

    return brentq(lambda w: float(residual(jnp.asarray(w))), -1.0, 1.0, xtol=1e-13)


def exact(before):
    """dw/dt = PULL + GAIN share(w) over a time of 1."""

    def rate(_, w):
        return PULL - GAIN * MU * w / np.sqrt(w * w + EPS * EPS)

    return solve_ivp(rate, (0, 1), [before], rtol=1e-10, atol=1e-14, method="LSODA").y[0, -1]


@pytest.mark.parametrize(
    ("before", "held"),
    [(0.04, False), (0.03, False), (0.01, False), (2e-3, False), (1e-4, True), (-1e-4, True)],
)
def test_a_corner_ends_as_smoothed_friction_has_it(before, held):
    # What is left out is what friction does within some eps of rest.
    assert end(before, held) == pytest.approx(exact(before), abs=2 * EPS)
    # And so in the derivative, which the trapezoidal rule has as 1.
    step = 1e-5
    slope = (end(before + step, held) - end(before - step, held)) / (2 * step)
    true = (exact(before + step) - exact(before - step)) / (2 * step)
    assert slope == pytest.approx(true, abs=0.1)


def test_a_corner_that_slides_on_has_nothing_added():
    corner = friction_turn._Corner(
        *map(jnp.asarray, (0.2, 0.1, MU, GAIN)), EPS, share(0.2), share(0.1)
    )
    # eps^2 / w^2 twice over: what smoothing leaves of a jump.
    assert abs(friction_turn._from_sliding(corner).share) < 2 * MU * (EPS / 0.1) ** 2


TURNS = dict(
    thickness=0.0455563, reach=1.52741, flexible=0.695086, width=0.238317, modulus=319631000.0,
    density=554.372, damping_ratio=0.0342861, mass=1.30616, length=0.488201, aspect=0.613654,
    across=-0.136587, along=0.45397, stiffness=687853000.0, damping=216.015, belt=1.38378,
    gravity=9.81, belt_kinetic=0.232297, belt_static=0.334394, kinetic=0.116027, static=0.116027,
    top_speed=1.24487, place=0.817909, angle=0.13059, approach=0.21256, ride=1.38378,
)  # fmt: skip


def test_the_gradient_is_that_of_the_course_and_not_of_the_steps():
    """Friction of a corner turns round 6 ms before the peak of the second blow. By the trapezoidal
    rule the slope in the reach was -0.1 or 3.8, as the steps fell, and the force rippled by
    4e-4 of itself; over 0.2 % of the reach the force rises by 0.47 times as much."""
    x = {name: jnp.asarray(value) for name, value in TURNS.items()}

    @jax.jit
    @one_by_one
    def run(share):
        def peak(share):
            scene = KINDS["impact"].scene(changed(x, {"reach": x["reach"] * (1 + share)}))
            return fj.simulate(scene, only=("peak_force",)).peak_force

        return jax.jvp(peak, (share,), (jnp.ones_like(share),))

    shares = np.linspace(-1e-3, 1e-3, 64)
    force, slope = map(np.asarray, run(jnp.asarray(shares)))
    (rise, middle), rest, *_ = np.polyfit(shares, force, 1, full=True)
    assert np.max(np.abs(slope - rise)) < 0.35 * middle
    assert np.sqrt(rest[0] / shares.size) < 4e-5 * middle
