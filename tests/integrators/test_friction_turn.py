"""Friction that turns round within a step: against the motion of one corner, and in a scene."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from robustness.peaks import over_belt_speeds
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


def exact(before, pull=PULL):
    """dw/dt = pull + GAIN share(w) over a time of 1."""
    return motion(before, pull)[0]


def motion(before, pull):
    """The same, and the way."""

    def rate(_, state):
        w, _ = state
        return pull - GAIN * MU * w / np.sqrt(w * w + EPS * EPS), w

    found = solve_ivp(rate, (0, 1), [before, 0.0], rtol=1e-10, atol=1e-14, method="LSODA")
    return found.y[:, -1]


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


@pytest.mark.parametrize("pull", [PULL, 0.01, -0.015])
@pytest.mark.parametrize("before", [0.02, 0.01, 2e-3, -0.01])
def test_a_corner_that_comes_to_rest_goes_as_far(before, pull):
    """Whether it turns round, is held from then on, or slides on. What is left out is what friction
    does within some eps of rest; the cubic alone is off by up to a sixth of the jump."""
    after, further = motion(before, pull)
    slide = GAIN * float(share(before))
    change = slide - (after - before - pull)
    cubic = (2 * before + after) / 3 + (pull + slide) / 6
    early = float(friction_turn._early(*map(jnp.asarray, (before, after, change))))
    assert cubic + early * change == pytest.approx(further, abs=2 * EPS)


def test_the_cubic_alone_would_not_do():
    after, further = motion(2e-3, PULL)
    cubic = (2 * 2e-3 + after) / 3 + (PULL + GAIN * float(share(2e-3))) / 6
    assert abs(cubic - further) > 10 * EPS


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


# Found by a search for wrong gradients: a corner slides fast along the fence and stops on it.
STOPS = {
    "thickness": 0.0729507, "reach": 1.20105, "flexible": 0.247196, "width": 0.132,
    "modulus": 8.65281e8, "density": 1992.04, "damping_ratio": 0.0133956, "mass": 0.212283,
    "length": 0.701001, "aspect": 0.887783, "across": -0.463594, "along": 0.386737,
    "stiffness": 3.64918e11, "damping": 15.6606, "belt": 2.64223, "belt_kinetic": 0.191825,
    "belt_static": 0.750392, "kinetic": 0.903703, "static": 0.903703, "border": 0.717774,
    "top_speed": 0.97873, "cycle": 1.36, "front": -0.0707817, "offset": 0.0795404,
    "turn": -0.19874, "place": 0.75, "angle": 0.25, "ride": 2.64223, "gravity": 9.81,
}  # fmt: skip


def test_gradient_wherever_in_a_step_a_corner_stops():
    """A belt that is faster by 0.05 % lets it stop a step of 62.5 us sooner. The slopes in between
    were from -4.7 to 4.8 times the force, and their mean is 1.2: a sixth of the way that friction
    makes in a step depended on when within it the corner stopped. Of that a tenth may be left, as
    the normal force grows by 6 % in a step.
    """
    course = over_belt_speeds(STOPS, -1.2e-4, 4e-4, 14)
    np.testing.assert_allclose(
        course.slopes / course.forces, course.secant / course.forces, atol=0.5
    )
