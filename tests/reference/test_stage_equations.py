"""Each stage's right-hand side against Newton-Euler in Cartesian coordinates."""

from dataclasses import replace

import numpy as np
import pytest
from reference import polar
from reference.impact import (
    Fence,
    contact_force,
    derivative,
    smoothed_friction,
    turned_arm,
)
from reference.sorts import (
    sorting,
    staged,
)
from reference.stages import (
    along_fence,
    border_and_fence,
    common,
    free_motion,
    sequence,
    two_corners,
)

CASES = 12


def vibrating(impact, rng):
    """(time, modal state): the fence somewhere on its way out, ringing by some millimetres."""
    count = impact.link.frequency.size
    fade = 0.3 ** np.arange(count)
    eta = 0.01 * rng.uniform(-1, 1, count) * fade
    return rng.uniform(0.1, 0.5), np.concatenate([eta, 100 * rng.uniform(-1, 1, count) * eta])


def newton_euler(impact, time, modal, motion, corner):
    """(beam's rate, x'', y'', phi'') with corner `corner` on the fence, by `reference.impact`.

    With corner None nothing touches the fence.
    """
    place = polar.cartesian_state_from_polar(motion)
    if corner is None:
        place, corner = place._replace(y=place.y + 10.0), 1
    state = np.concatenate([modal, place, [0.0]])
    rate = derivative(replace(impact, corner=corner), time, state)
    return np.concatenate([rate[: modal.size], rate[-4:-1]])


def in_cartesian(modal, motion, rate):
    """The same of a stage's time derivative, layout `FREE` or `TIED` (without phi'')."""
    r_ddot, alpha_ddot = (rate[-3], rate[-2]) if len(rate) == modal.size + 6 else rate[-2:]
    acceleration = polar.cartesian_acceleration_from_polar(motion, r_ddot, alpha_ddot)
    spin = [rate[-1]] if len(rate) == modal.size + 6 else []
    return np.concatenate([rate[: modal.size], acceleration, spin])


def border_push(impact, motion):
    """(x'', y'', phi'') from corner 2 on the border, with vectors."""
    x, y, phi, x_rate, y_rate, spin = polar.cartesian_state_from_polar(motion)
    arm_x, arm_y = turned_arm(replace(impact, corner=2), phi)
    normal = contact_force(impact, -(y + arm_y), -(y_rate + spin * arm_x))
    speed = x_rate - spin * arm_y
    drag = normal * speed * smoothed_friction(impact.mu_fence, abs(speed), impact)
    moment = arm_x * normal + arm_y * drag
    acceleration = -drag / impact.mass, normal / impact.mass, moment / impact.moment_of_inertia
    return np.array(acceleration), normal


def pressed(impact, rng, time, modal):
    """polar.PolarState with corner 1 pressed in by 3 to 20 mm and corner 2 somewhere near."""
    fence = Fence(impact, time, modal)
    element = int(rng.integers(0, impact.elements - 8))
    (x, y), q5, _ = fence.point(element, 0.4 * fence.element_length)
    depth = rng.uniform(0.003, 0.02)
    phi = q5 - rng.uniform(-0.03, 0.05)
    arm_x, arm_y = turned_arm(replace(impact, corner=1), phi)
    rates = rng.uniform([-1.0, -1.0, -3.0], [3.0, 1.0, 3.0])
    return polar.polar_state_from_cartesian(
        polar.CartesianState(
            x + depth * np.sin(q5) - arm_x, y - depth * np.cos(q5) - arm_y, phi, *rates
        )
    )


def offset(**changes):
    """A parcel whose centre of gravity is not in the middle."""
    return sorting("two-link", center=(0.03, -0.02), **changes)


def test_two_corners_are_newton_euler():
    impact, rng = offset(), np.random.default_rng(1)
    both = 0
    for _ in range(CASES):
        time, modal = vibrating(impact, rng)
        motion = pressed(impact, rng, time, modal)
        state = np.concatenate([modal, motion])
        ours = in_cartesian(modal, motion, two_corners.derivative(impact, time, state))
        first, second, none = (
            newton_euler(impact, time, modal, motion, corner) for corner in (1, 2, None)
        )
        truth = first + second - none
        truth[-3:] += border_push(impact, motion)[0]
        normals = two_corners.sample(impact, time, state).corner_normals
        both += min(normals) > 0
        np.testing.assert_allclose(ours, truth, rtol=1e-9, atol=1e-9 * np.abs(truth).max())
    assert both >= 3


def test_border_and_fence_is_newton_euler():
    impact, rng = offset(), np.random.default_rng(2)
    pushed = 0
    for _ in range(CASES):
        time, modal = vibrating(impact, rng)
        motion = pressed(impact, rng, time, modal)
        place = polar.cartesian_state_from_polar(motion)
        # Lowered until corner 2 is 1 to 15 mm behind the border; corner 1 then sits deep.
        _, arm_y = turned_arm(replace(impact, corner=2), motion.phi)
        low = -arm_y - rng.uniform(0.001, 0.015)
        motion = polar.polar_state_from_cartesian(place._replace(y=low))
        state = np.concatenate([modal, motion])
        ours = in_cartesian(modal, motion, border_and_fence.derivative(impact, time, state))
        truth = newton_euler(impact, time, modal, motion, 1)
        push, normal = border_push(impact, motion)
        truth[-3:] += push
        pushed += normal > 0
        np.testing.assert_allclose(ours, truth, rtol=1e-9, atol=1e-9 * np.abs(truth).max())
    assert pushed >= 3


def test_free_motion_is_newton_euler():
    impact, rng = offset(), np.random.default_rng(3)
    time, modal = vibrating(impact, rng)
    motion = pressed(impact, rng, time, modal)
    state = np.concatenate([modal, motion])
    ours = in_cartesian(modal, motion, free_motion.derivative(impact, time, state))
    truth = newton_euler(impact, time, modal, motion, None)
    np.testing.assert_allclose(ours, truth, rtol=1e-9, atol=1e-9 * np.abs(truth).max())


def test_along_the_fence_is_newton_euler_with_the_moment_of_the_tie():
    # C_s over corner 1, so that this corner is the foot C: Newton-Euler with phi left free then
    # has the same forces, and lacks of phi'' what the tie's moment gives.
    impact = sorting("two-link", center=(0.2 - 1e-12, -0.02))
    rng = np.random.default_rng(4)
    for _ in range(CASES):
        time, modal = vibrating(impact, rng)
        fence = Fence(impact, time, modal)
        arc = rng.uniform(0.46, 1.1)
        place = np.array([arc * np.cos(fence.angle), arc * np.sin(fence.angle)])
        found = common.foot(impact, fence, *place)
        height = polar.wall_distance(common.parcel_of(impact)) - rng.uniform(0.003, 0.02)
        x = found.point.x - height * np.sin(found.point.q5)
        y = found.point.y + height * np.cos(found.point.q5)
        rates = rng.uniform([-1.0, -1.0], [3.0, 1.0])
        polar_start = polar.polar_state_from_cartesian(polar.CartesianState(x, y, 0, *rates, 0))
        state = sequence.tied(np.concatenate([modal, polar_start]))
        _, motion, _ = along_fence.tie(impact, time, state)
        ours = in_cartesian(modal, motion, along_fence.derivative(impact, time, state))
        truth = newton_euler(impact, time, modal, motion, 1)
        scale = np.abs(truth).max()
        np.testing.assert_allclose(ours, truth[:-1], rtol=1e-9, atol=1e-9 * scale)
        sample = along_fence.sample(impact, time, state)
        lacking = along_fence.tied_acceleration(impact, time, state) - truth[-1]
        assert sample.normal > 1
        assert sample.wall_moment == pytest.approx(
            impact.moment_of_inertia * lacking, rel=1e-8, abs=1e-8
        )


def test_the_tied_rotation_has_the_rate_it_says():
    # phi is read off the fence, phi' from the motion of the foot along it. One is the integral of
    # the other, here to the error of the trapezoidal rule; without the foot's own motion it is
    # not, by some 0.02 rad.
    sliding = staged("one-link").runs[1].samples
    steps = 0.5 * (sliding.spin[1:] + sliding.spin[:-1]) * np.diff(sliding.time)
    drift = sliding.phi - sliding.phi[0] - np.concatenate([[0.0], np.cumsum(steps)])
    assert np.ptp(sliding.phi) > 0.5
    assert np.abs(drift).max() < 3e-5


def test_on_a_rigid_fence_the_tied_rotation_is_the_drive():
    impact = sorting("two-link", E=3e14, modes=1, zeta=0.5, distance=0.8, drive_angle=0.25)
    state = sequence.tied(sequence.on_fence(impact))
    _, motion, _ = along_fence.tie(impact, 0.0, state)
    angle, speed, acceleration = impact.drive(0.0)
    assert motion.phi == pytest.approx(angle, rel=1e-5)
    assert motion.phi_dot == pytest.approx(speed, rel=1e-5)
    assert along_fence.tied_acceleration(impact, 0.0, state) == pytest.approx(
        acceleration, rel=1e-3
    )
    assert along_fence.over_tip(impact, 0.0, state) == pytest.approx(0.4, abs=1e-6)
