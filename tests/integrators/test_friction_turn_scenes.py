"""Friction that reverses within a step: the gradient of scenes that a search found for it, against
the secant over many places of the reversal in a step."""

import jax
import jax.numpy as jnp
import numpy as np
from robustness import found_sorts
from robustness.searched_scenes import KINDS, changed
from runs import one_by_one

import fencejax as fj

TURNS = dict(
    thickness=0.0455563, reach=1.52741, flexible=0.695086, width=0.238317, modulus=319631000.0,
    density=554.372, damping_ratio=0.0342861, mass=1.30616, length=0.488201, aspect=0.613654,
    across=-0.136587, along=0.45397, stiffness=687853000.0, damping=216.015, belt=1.38378,
    gravity=9.81, belt_kinetic=0.232297, belt_static=0.334394, kinetic=0.116027, static=0.116027,
    top_speed=1.24487, place=0.817909, angle=0.13059, approach=0.21256, ride=1.38378,
)  # fmt: skip


def test_the_gradient_is_that_of_the_course_and_not_of_the_steps():
    """Friction of a corner reverses 6 ms before the peak of the second blow. By the trapezoidal
    rule the slope in the reach was -0.1 or 3.8, as the steps fell, and the force rippled by
    4e-4 of itself; over 0.2 % of the reach the force rises by 0.47 times as much. Where a step ends
    with the corner nearly at rest, over some 1e-6 of the reach, the slope may still be twice that.
    """
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
    off = np.abs(slope - rise) / middle
    assert np.quantile(off, 0.98) < 0.35
    assert np.mean(off) < 0.07
    assert np.sqrt(rest[0] / shares.size) < 4e-5 * middle


def test_gradient_wherever_in_a_step_a_corner_stops():
    """A corner slides fast along the fence and stops on it. A belt that is faster by 0.05 % lets it
    stop a step of 62.5 us sooner. The slopes in between were from -4.7 to 4.8 times the force, and
    their mean is 1.2: a sixth of the displacement by friction in a step depended on when within it
    the corner stopped.
    """
    course = found_sorts.course("a corner stops on the fence", -1.2e-4, 4e-4, 14)
    np.testing.assert_allclose(
        course.slopes / course.forces, course.secant / course.forces, atol=0.3
    )


def test_gradient_wherever_in_a_step_a_corner_passes_static_friction():
    """A corner reverses 3 ms before the peak, on a fence whose static friction is above the
    kinetic one. A belt that is faster by 0.2 % has it reverse a shortest step sooner. Slopes in
    between were -1.5 to -1.9 times the force, or 2 times it; their mean is 0.02 to 0.03. What is
    left is where a step ends amid static friction: some w_s of the 12 mm/s that it changes the
    sliding by."""
    course = found_sorts.course("a corner turns amid static friction", -4e-3, 4e-3, 17)
    off = np.abs(course.slopes - course.secant) / course.forces
    assert np.quantile(off, 0.9) < 0.15
    assert np.mean(off) < 0.15


def test_gradient_where_a_step_ends_as_a_corner_comes_to_rest():
    """0.6 ms before the peak. The corner's speed at that end is from 40 eps to none. Slopes were a
    quarter too large where it stuck from there on, and up to 3.4 times at the last; so they were
    with shorter steps."""
    course = found_sorts.course("a step ends as a corner comes to rest", -1e-3, 1e-3, 33)
    np.testing.assert_allclose(course.slopes, course.secant, rtol=0.1)
    close = found_sorts.course("a step ends as a corner comes to rest", -4e-6, 6e-6, 33)
    np.testing.assert_allclose(close.slopes, close.slopes[0], rtol=0.02)


def test_gradient_where_both_corners_of_a_wall_turn_in_one_step():
    """The wall lies on the fence, and they turn within 31 us. The force hardly goes with the belt's
    speed. By each corner's own friction alone it was a sawtooth of the place of the turn in a step,
    1e-4 of itself high, with slopes of -0.7 to 0.5 times the force."""
    course = found_sorts.course("both corners of a wall turn round", -1e-3, 1e-3, 33)
    assert abs(course.secant) < 0.05 * course.forces[0]
    np.testing.assert_allclose(course.slopes / course.forces, 0.0, atol=0.15)


def test_gradient_where_the_normal_force_grows_as_a_corner_turns():
    """That of a light parcel rises to its peak within 4 ms. The slopes were 1.9 times the force,
    and the truth's, too, with teeth of its own; the mean is 1.27. By the impulse of the normal
    force they are within a tenth of it, but where a step ends within some eps of rest: of the 0.09
    mm/s that the belt is faster by from tooth to tooth. There the estimated error is large."""
    course = found_sorts.course("a corner turns round as the force rises", -1e-3, 1e-3, 33)
    off = np.abs(course.slopes / course.secant - 1)
    assert np.quantile(off, 0.9) < 0.1
    assert np.all(course.estimated[off > 0.12] > fj.Fidelity.standard().gradient_tolerance)


def test_gradient_where_a_step_begins_amid_static_friction():
    """A corner stops 2 ms before the peak, in steps of 0.5 ms. A belt that is faster by 0.13 % lets
    it stop a step sooner. Slopes were 15 % off, and in steps that do not follow their error nine
    times too large where the corner was nearly at rest at a step's start."""
    course = found_sorts.course("a corner stops by static friction", -1e-3, 1e-3, 21)
    np.testing.assert_allclose(course.slopes, course.secant, rtol=0.1)


def test_a_step_that_ends_amid_static_friction_has_a_large_estimated_error():
    """A corner reverses a millisecond before the peak. A belt that is faster by 0.01 % lets it
    turn a shortest step sooner; where that ends while friction falls from static to kinetic, slopes
    are up to four times the force off."""
    course = found_sorts.course("a corner turns round by static friction", -1e-3, 1e-3, 33)
    size = np.maximum(abs(course.secant), course.forces)
    off = np.abs(course.slopes - course.secant) / size
    assert np.max(off) > 1
    # The promise of a gradient at `standard`; where it is broken, the estimated error says so.
    assert np.all(course.estimated[off > 0.15] > fj.Fidelity.standard().gradient_tolerance)
