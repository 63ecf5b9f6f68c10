"""Friction that reverses within a step, against the motion of one corner and of two."""

import functools
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root

import fencejax as fj
from fencejax.fidelity import Smoothing
from fencejax.integrators import corner_way, friction_turn, sliding_corner
from fencejax.model import corner_share

MU, STATIC, EPS = 0.3, 0.5, 1.5e-4
SMOOTHING = Smoothing(EPS, 5 * EPS)
# The changes of the sliding speed in a step by friction of mu = 1, and by all else [m/s].
GAIN, PULL = 0.06, -0.03


def share(speed, static=MU):
    return corner_share(fj.Friction(MU, static), jnp.asarray(speed), SMOOTHING)


def corner_of(before, after, static=MU, law=None):
    law = fj.Friction(MU, static) if law is None else law
    before, after = jnp.asarray(before), jnp.asarray(after)
    mean = sliding_corner.mean_friction(law, before, SMOOTHING)
    start = sliding_corner.Start(before, *corner_share(law, before, SMOOTHING), mean)
    return sliding_corner.Corner(
        start, after, *corner_share(law, after, SMOOTHING),
        sliding_corner.mean_friction(law, after, SMOOTHING), jnp.asarray(GAIN), EPS,
    )  # fmt: skip


def from_sliding(corner, others=0.0):
    return friction_turn._from_sliding(corner, sliding_corner.linear_mean(corner), others)


def in_equation(corner, sticking):
    """Twice the mean friction in the step's equation, and its slope with the speed at the end; that
    of a sticking corner is the friction at the end alone."""
    added = friction_turn._from_rest(corner) if sticking else from_sliding(corner)
    twice = 2 * corner.share if sticking else corner.start.share + corner.share
    return twice + added.share, (1 + sticking) * corner.slope + added.slope


def end(before, sticking, static=MU, pull=PULL):
    """The sliding speed at which the step's equation holds."""
    residual = residual_of(sticking, static)
    return brentq(lambda w: float(residual(w, float(before), float(pull))), -1.0, 1.0, xtol=1e-13)


@functools.cache
def residual_of(sticking, static):
    @jax.jit
    def residual(after, before, pull):
        mean, _ = in_equation(corner_of(before, after, static), sticking)
        return after - before - pull - 0.5 * GAIN * mean

    return residual


# The normal force at a step's start and end, its mean being 1: constant, or growing.
CONSTANT, GROWS = (1.0, 1.0), (0.4, 1.6)


def exact(before, pull=PULL, static=MU, pressed=CONSTANT):
    """dw/dt = N(t) [pull + GAIN share(w)] over a time of 1, N straight between its ends."""
    return motion(before, pull, static, pressed)[0]


def motion(before, pull, static=MU, pressed=CONSTANT):
    """The same, and the displacement."""
    first, last = pressed

    def rate(t, state):
        w, _ = state
        mu = MU + (static - MU) * np.exp(-((w / SMOOTHING.static_speed) ** 2))
        normal = first + (last - first) * t
        return normal * (pull - GAIN * mu * w / np.sqrt(w * w + EPS * EPS)), w

    found = solve_ivp(rate, (0, 1), [before, 0.0], rtol=1e-10, atol=1e-14, method="LSODA")
    return found.y[:, -1]


@pytest.mark.parametrize(
    ("before", "sticking"),
    [(0.04, False), (0.03, False), (0.01, False), (2e-3, False), (1e-4, True), (-1e-4, True)],
)
def test_a_corner_ends_as_smoothed_friction_has_it(before, sticking):
    # The error is the effect of friction within some eps of rest.
    assert end(before, sticking) == pytest.approx(exact(before), abs=2 * EPS)
    # And so in the derivative, which the trapezoidal rule has as 1.
    step = 1e-5
    slope = (end(before + step, sticking) - end(before - step, sticking)) / (2 * step)
    true = (exact(before + step) - exact(before - step)) / (2 * step)
    assert slope == pytest.approx(true, abs=0.1)


# How fast a corner is at the step's end that has just reversed [eps], and by how much what
# pulls is more than friction holds, in a step [eps].
@pytest.mark.parametrize("pulled", [13, 47, 147])
@pytest.mark.parametrize("end_at", [2, 3, 5, 8, 15])
def test_a_corner_that_has_just_turned_has_the_slope_of_smoothed_friction(end_at, pulled):
    """It leaves by beta + J u, of which smoothed friction's share u is eps^2 / 4 b^2; the slope of
    its speed with that at the start was off by J u / beta, up to a third, where a step ends so.
    What is left is of the second order in it, where that is a third at most, and of the first in
    eps over the speed at the start."""
    pull = -(MU * GAIN + pulled * EPS)
    before = brentq(lambda w: exact(w, pull) + end_at * EPS, 0.0, 0.08, xtol=1e-12)
    assert end(before, False, pull=pull) == pytest.approx(-end_at * EPS, abs=0.3 * EPS)
    step = 1e-6
    slope = (end(before + step, False, pull=pull) - end(before - step, False, pull=pull)) / step
    true = (exact(before + step, pull) - exact(before - step, pull)) / step
    left = 2 * MU * GAIN / (4 * end_at**2 * pulled * EPS)
    assert slope == pytest.approx(true, rel=0.2 * min(left, left**2) + 0.01 + EPS / before)


def further(before, after, pull, static=MU, pressed=CONSTANT):
    """The displacement by the step's cubic, and what the reversal adds to it; the friction over the
    step is that which leads from one speed to the other."""
    start = pressed[0] * (pull + GAIN * float(share(before, static)[0]))
    cubic = (2 * before + after) / 3 + start / 6
    mean = jnp.asarray((after - before - pull) / GAIN)
    pressed = tuple(map(jnp.asarray, pressed))
    corner = corner_of(before, after, static)
    force = corner_way.comes_to_rest(corner, sliding_corner.linear_mean(corner), mean, pressed)
    return cubic, GAIN * float(force)


@pytest.mark.parametrize("pressed", [CONSTANT, GROWS])
@pytest.mark.parametrize("pull", [PULL, 0.01, -0.015])
@pytest.mark.parametrize("before", [0.02, 0.01, 2e-3, -0.01])
def test_a_corner_that_comes_to_rest_goes_as_far(before, pull, pressed):
    """Whether it reverses, sticks from then on, or slides on. The difference is the effect of
    friction within some eps of rest; the cubic alone is off by up to a sixth of the jump."""
    after, displacement = motion(before, pull, pressed=pressed)
    cubic, extra = further(before, after, pull, pressed=pressed)
    assert cubic + extra == pytest.approx(displacement, abs=2 * EPS)


@pytest.mark.parametrize("before", [2e-4, 5e-4, 1e-3, 2e-3])
def test_a_corner_that_begins_amid_static_friction_goes_as_far(before):
    """The cubic takes the friction of the step's very start, which is near kinetic already while
    the corner comes to rest by more, to be that all the way: h^2 F / 6 for a difference of F."""
    after, displacement = motion(before, -0.02, STATIC)
    cubic, extra = further(before, after, -0.02, STATIC)
    assert cubic + extra == pytest.approx(displacement, abs=2 * EPS)


@jax.jit
def counted_by_force(before, after):
    """For a corner under a growing normal force: twice the mean friction in the step's equation,
    with the force at each end and the reversal, and its slope with the speed at the end."""
    law, (first, last) = fj.Friction(MU, MU), map(jnp.asarray, GROWS)
    before = jnp.asarray(before)
    at_start, by_speed = corner_share(law, before, SMOOTHING)
    mean = sliding_corner.mean_friction(law, before, SMOOTHING)
    start = sliding_corner.Start(before, at_start, by_speed, mean)
    at_end, steeper = corner_share(law, after, SMOOTHING)
    mechanics = SimpleNamespace(
        fidelity=SimpleNamespace(smoothing=SMOOTHING), frictions=(law,), lightness=lambda _: GAIN
    )
    touch = SimpleNamespace(normal=last, sliding=after)
    response = SimpleNamespace(share=at_end, sliding=steeper)
    forces = SimpleNamespace(meetings=[(touch, None, None, response)])
    (turn,) = friction_turn.turns(mechanics, forces, (0.0,), (first,), (start,), 1.0)
    return first * at_start + last * at_end + turn.added, last * steeper + turn.slope


def end_by_force(before, pull):
    """The sliding speed at which that step's equation holds."""
    return brentq(
        lambda w: float(residual_by_force(w, float(before), pull)), -1.0, 1.0, xtol=1e-13
    )


@jax.jit
def residual_by_force(after, before, pull):
    return after - before - pull - 0.5 * GAIN * counted_by_force(before, after)[0]


@pytest.mark.parametrize("before", [0.03, 0.02, 0.01, 2e-3])
def test_a_corner_turns_round_as_smoothed_friction_has_it_where_the_force_grows(before):
    """The speed at the end, and its slope; with the force at the step's end on both sides of the
    reversal it would be off by mu (1 - theta)^2 (N_1 - N_0), a fifth of the jump."""
    pull = -0.04
    found = end_by_force(before, pull)
    assert found == pytest.approx(exact(before, pull, pressed=GROWS), abs=2 * EPS)
    step = 1e-5
    ends = [
        (end_by_force(b, pull), exact(b, pull, pressed=GROWS))
        for b in (before - step, before + step)
    ]
    (low, true_low), (high, true_high) = ends
    slope, true = (high - low) / (2 * step), (true_high - true_low) / (2 * step)
    assert slope == pytest.approx(true, abs=0.1)
    # The slope for Newton's method is that of the friction in the equations.
    at = jnp.asarray(found)
    slope = float(counted_by_force(before, at)[1])
    assert slope == pytest.approx(float(jax.jacfwd(lambda w: counted_by_force(before, w)[0])(at)))


def settled(before, pull):
    """The speed and the displacement at the end of a step in which a corner sticks, as the step has
    them: by its cubic with the friction of its end, and what is added to it."""
    after = end(before, sticking=True, pull=pull)
    corner = corner_of(before, after, MU)
    cubic = (2 * before + after) / 3 + (pull + GAIN * float(corner.share)) / 6
    extra = corner_way.settles(corner, friction_turn._from_rest(corner).gained)
    return after, cubic + GAIN * float(extra)


# At this length of a step a corner sticks by the slope of friction up to 6 eps. With the first pull
# it goes on sticking, with the second it breaks away.
@pytest.mark.parametrize("pull", [-0.01, PULL])
@pytest.mark.parametrize("before", [8e-4, 4e-4, EPS, 3e-5, -1e-4])
def test_a_corner_that_settles_goes_as_far(before, pull):
    """In the derivative: the displacement alone is smaller than these speeds. The cubic keeps two
    thirds of a speed that is gone in a small part of the step, and half of it with the friction
    that took it.
    """
    ahead = max(before, 0.0)
    assert settled(before, pull)[1] == pytest.approx(motion(before, pull)[1], abs=EPS + 0.1 * ahead)
    step = 1e-6
    (_, high), (_, low) = settled(before + step, pull), settled(before - step, pull)
    true = motion(before + step, pull)[1] - motion(before - step, pull)[1]
    assert (high - low) / (2 * step) == pytest.approx(true / (2 * step), abs=0.1)


@pytest.mark.parametrize("end_at", [20, 5, 2, 1, 0.5, 0.0, -0.5, -2])
def test_a_corner_that_stops_at_the_very_end_is_slowed_by_no_more_than_it_is(end_at):
    """A corner that is faster at the start is faster at the end, and by no more than that, whether
    it just slides on or has just been stopped: half an eps before it stops it was 1.8 times as
    much."""
    pull = -0.01
    before = MU * GAIN - pull + end_at * EPS
    step = 1e-7
    slope = (end(before + step, False, pull=pull) - end(before - step, False, pull=pull)) / step / 2
    assert -0.02 < slope < 1.02


# Two corners of one wall: what friction of mu = 1 at either changes the sliding by, at itself and
# at the other one.
GAINS, ACROSS = np.array([0.06, 0.04]), np.array([[0.0, 0.03], [0.045, 0.0]])


def pair_of(before, after):
    """The corners, and the effect of the other corner's reversal in the step equation of each."""
    corners = {
        k: corner_of(b, a, MU)._replace(gain=jnp.asarray(GAINS[k]))
        for k, (b, a) in enumerate(zip(before, after, strict=True))
    }
    changes = {
        k: friction_turn._change(corner, sliding_corner.linear_mean(corner))
        for k, corner in corners.items()
    }
    forces = SimpleNamespace(meetings=[SimpleNamespace(touch=k) for k in corners])
    mechanics = SimpleNamespace(
        lightness=lambda one, other=None: GAINS[one] if other is None else ACROSS[one, other]
    )
    coupled = friction_turn._coupled(mechanics, forces, corners, changes)
    others = friction_turn._by_others(coupled, changes, friction_turn._acts_with)
    return list(corners.values()), [others[k] for k in corners]


def ends_of_pair(before, pull, coupled=True):
    """The sliding speeds at which both equations hold."""
    residual = pair_residual(coupled)
    given = tuple(map(float, before)), tuple(map(float, pull))
    # From where dry friction alone would lead them.
    found = root(lambda w: np.asarray(residual(w, *given)), true_pair(before, pull), tol=1e-12)
    assert np.max(np.abs(found.fun)) < 1e-9
    return found.x


@functools.cache
def pair_residual(coupled):
    @jax.jit
    def residual(after, before, pull):
        corners, others = pair_of(before, after)
        twice = jnp.stack([
            corner.start.share + corner.share
            + from_sliding(corner, other if coupled else 0.0).share
            for corner, other in zip(corners, others, strict=True)
        ])  # fmt: skip
        return jnp.stack([
            after[k] - before[k] - pull[k] - 0.5 * (GAINS[k] * twice[k] + ACROSS[k] @ twice)
            for k in (0, 1)
        ])  # fmt: skip

    return residual


def true_pair(before, pull):
    def rate(t, w):
        share = -MU * w / np.sqrt(w * w + EPS * EPS)
        return np.asarray(pull) + GAINS * share + ACROSS @ share

    found = solve_ivp(rate, (0, 1), before, rtol=1e-10, atol=1e-14, method="LSODA")
    return found.y[:, -1]


@pytest.mark.parametrize("before", [(0.03, 0.02), (0.03, 0.029), (0.02, 0.045), (0.04, 1e-3)])
def test_corners_that_turn_together_turn_as_they_do(before):
    """Each speed is right to a hundredth of the change by both reversals, as that by the other
    corner enters as a mean; with its own friction alone the first would be off by a tenth of the
    other's."""
    pull = np.array([-0.06, -0.055])
    true = true_pair(before, pull)
    assert np.all(true < -10 * EPS)
    jumps = 2 * MU * (GAINS + ACROSS.sum(axis=1))
    np.testing.assert_array_less(np.abs(ends_of_pair(before, pull) - true), 0.01 * jumps)


def test_by_their_own_friction_alone_they_would_not():
    before, pull = (0.03, 0.029), np.array([-0.06, -0.055])
    off = ends_of_pair(before, pull, coupled=False) - true_pair(before, pull)
    assert np.max(np.abs(off)) > 5 * EPS


def test_the_cubic_alone_would_not_do():
    after, displacement = motion(2e-3, PULL)
    cubic, _ = further(2e-3, after, PULL)
    assert abs(cubic - displacement) > 10 * EPS


def test_a_corner_that_slides_on_has_nothing_added():
    # eps^2 / w^2 twice over: what smoothing leaves of a jump.
    added = from_sliding(corner_of(0.2, 0.1)).share
    assert abs(added) < 2 * MU * (EPS / 0.1) ** 2


# The pull is larger than static friction (0.5 x GAIN), so that a corner reverses, wherever in the
# step, and it may end or begin where friction falls to kinetic.
@pytest.mark.parametrize("before", [0.04, 0.03, 0.0241, 0.02, 0.01, 2e-3, -4e-4, -2e-3])
@pytest.mark.parametrize("pull", [-0.045, -0.06])
def test_a_corner_passes_static_friction_as_fast_as_it_does(before, pull):
    """The error is the effect of friction within some eps of rest, and that the speed is not linear
    while static friction falls: (mu_s - mu_k) w_s of it lasts w_s / (pull - mu_s GAIN)."""
    found = end(before, sticking=False, static=STATIC, pull=pull)
    lasts = SMOOTHING.static_speed / (-pull - STATIC * GAIN)
    bound = 2 * EPS + GAIN * (STATIC - MU) * lasts
    assert found == pytest.approx(exact(before, pull, STATIC), abs=bound)
    step = 1e-6
    ends = (
        [end(b, False, STATIC, pull), exact(b, pull, STATIC)]
        for b in (before + step, before - step)
    )
    (high, true_high), (low, true_low) = ends
    slope, true = (high - low) / (2 * step), (true_high - true_low) / (2 * step)
    assert slope == pytest.approx(true, abs=0.15)


@pytest.mark.parametrize("static", [MU, STATIC])
@pytest.mark.parametrize("after", [0.02, 1e-3, 1e-4, -1e-4, -1e-3, -0.02])
@pytest.mark.parametrize("before", [0.01, -2e-3])
def test_the_slope_is_that_of_what_is_counted(before, after, static):
    slope, expected = counted_and_slope(static)(before, after)
    assert slope == pytest.approx(float(expected), rel=1e-6)


@functools.cache
def counted_and_slope(static):
    """The slope of the mean friction in the step's equation, and its derivative."""
    def twice(after, before):
        return in_equation(corner_of(before, after, static), False)

    @jax.jit
    def both(before, after):
        return twice(after, before)[1], jax.jacfwd(lambda w: twice(w, before)[0])(after)

    return both


STRIBECK = fj.friction_laws.Stribeck(MU, STATIC, stribeck_speed=0.1, viscous=0.2)


@pytest.mark.parametrize("law", [fj.Friction(MU, MU), fj.Friction(MU, STATIC), STRIBECK])
@pytest.mark.parametrize("change", [1e-12, 1e-9, 1e-7, 1e-5])
@pytest.mark.parametrize("before", [2e-4, 6e-4, 2e-3, 0.1, 3.0])
def test_a_corner_that_slides_on_has_the_friction_of_its_speed(before, change, law):
    """Whatever the law, and to the last places. The two ends differ from the mean by the square of
    the change over the least speed that friction goes with, eps here; a quotient of differences
    leaves roundings of what static friction adds near rest: 1e-16 x 0.2 w_s / (1e-4 eps)."""
    corner = corner_of(before, before + change, law=law)
    ends = corner.start.share + corner.share
    twice, _ = in_equation(corner, sticking=False)
    assert twice == pytest.approx(float(ends), abs=(change / EPS) ** 2 + 1e-11)
