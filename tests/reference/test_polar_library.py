"""The library's Newton-Euler mechanics against the paper's polar equations, written independently.

Both are exact descriptions of one rigid body, so they must agree to round-off; 1e-10 relative (of
the largest value of each kind) leaves room for the cancellation in r'' - r alpha'^2.
"""

import jax.numpy as jnp
import numpy as np
import pytest
from reference import polar

import fencejax as fj
from fencejax.model import FencePoint, Mechanics
from fencejax.parts import DriveMotion
from fencejax.scenes import Body

COUNT = 200
PARCEL = {"mass": 11.0, "length": 0.43, "breadth": 0.31, "center_x": 0.04, "center_y": -0.05}
INERTIA = 0.37


def library_parcel():
    return fj.Parcel(**PARCEL, inertia=INERTIA)


def polar_parcel():
    return polar.Parcel(
        PARCEL["mass"], INERTIA, PARCEL["length"], PARCEL["breadth"],
        PARCEL["center_x"], PARCEL["center_y"],
    )


def random_states(corner, seed):
    """Random motions of parcel, drive and fence point, with the corner pressed in by 3-30 mm."""
    rng = np.random.default_rng(seed)
    uniform = lambda low, high: rng.uniform(low, high, COUNT)  # noqa: E731
    body = Body(
        uniform(0.2, 1.5), uniform(-0.3, 1.0), uniform(-3, 3),
        uniform(-2, 3), uniform(-2, 2), uniform(-6, 6),
    )
    drive = DriveMotion(uniform(-0.2, 0.9), uniform(-2, 2), uniform(-5, 5))
    slope = uniform(-0.3, 0.3)
    arm_x, arm_y = (float(v) for v in library_parcel().corner(corner))
    cosine, sine = np.cos(body.angle), np.sin(body.angle)
    corner_x = body.x + cosine * arm_x - sine * arm_y
    corner_y = body.y + sine * arm_x + cosine * arm_y
    q5 = drive.angle + slope
    depth = uniform(0.003, 0.03)
    x = corner_x - depth * np.sin(q5)
    y = corner_y + depth * np.cos(q5)
    # The same point in the frame that turns with the drive, with a velocity of its own there.
    turned_x = x * np.cos(drive.angle) + y * np.sin(drive.angle)
    turned_y = y * np.cos(drive.angle) - x * np.sin(drive.angle)
    point = FencePoint(turned_x, turned_y, uniform(-0.1, 0.1), uniform(-2, 2), slope)
    return body, drive, point


def in_fixed_axes(drive, point):
    """The fence point as the polar equations take it."""
    cosine, sine = np.cos(drive.angle), np.sin(drive.angle)
    rate_x = point.x_rate - drive.speed * point.y
    rate_y = point.y_rate + drive.speed * point.x
    return polar.FencePoint(
        cosine * point.x - sine * point.y, sine * point.x + cosine * point.y,
        drive.angle + point.slope,
        cosine * rate_x - sine * rate_y, sine * rate_x + cosine * rate_y,
        np.zeros(COUNT),
    )


def polar_state(body):
    x, y = body.x, body.y
    r, alpha = np.hypot(x, y), np.arctan2(y, x)
    r_dot = (x * body.x_rate + y * body.y_rate) / r
    alpha_dot = (x * body.y_rate - y * body.x_rate) / r**2
    return polar.PolarState(r, alpha, body.angle, r_dot, alpha_dot, body.spin)


def kelvin(gap, gap_rate):
    """(2.2), written out again."""
    force = 3.3e5 * PARCEL["mass"] ** 0.4 * gap_rate * gap**2 + 1.72e9 * gap**4
    return np.where(gap > 0, np.maximum(force, 0.0), 0.0)


def belt_forces(state, smoothing):
    """Goyal's limit surface with mu taken at sqrt(|u|^2 + c^2 phidot^2)."""
    parcel = polar_parcel()
    x, y = state.r * np.cos(state.alpha), state.r * np.sin(state.alpha)
    x_rate = state.r_dot * np.cos(state.alpha) - state.alpha_dot * y
    y_rate = state.r_dot * np.sin(state.alpha) + state.alpha_dot * x
    c = polar.mean_distance(parcel)
    square = (2.0 - x_rate) ** 2 + y_rate**2 + (c * state.phi_dot) ** 2
    mu = 0.65 + 0.2 * np.exp(-square / smoothing.static_speed**2)
    return polar.friction_on_belt(state, parcel, 2.0, mu, epsilon=smoothing.slip_speed)


def assert_close(ours, theirs):
    theirs = np.asarray(theirs)
    scale = np.max(np.abs(theirs))
    np.testing.assert_allclose(np.asarray(ours), theirs, rtol=1e-10, atol=1e-10 * scale)


def assert_same_acceleration(acceleration, state, theirs):
    r, alpha = state.r, state.alpha
    radial = theirs.r_ddot - r * state.alpha_dot**2
    around = r * theirs.alpha_ddot + 2 * state.r_dot * state.alpha_dot
    assert_close(acceleration.x, radial * np.cos(alpha) - around * np.sin(alpha))
    assert_close(acceleration.y, radial * np.sin(alpha) + around * np.cos(alpha))
    assert_close(acceleration.angle, theirs.phi_ddot)


@pytest.mark.parametrize("corner", [1, 2, 3, 4])
def test_oblique_impact(corner):
    fidelity = fj.Fidelity.standard()
    scene = fj.scenes.oblique_impact(corner=corner, parcel=library_parcel())
    mechanics = Mechanics(scene, fidelity)
    body, drive, point = random_states(corner, seed=corner)
    frame = mechanics.frame(drive, (jnp.full(COUNT, 0.9),))
    forces = mechanics.forces(body, mechanics.arms(body.angle), frame, (point,))

    state, fence_point = polar_state(body), in_fixed_axes(drive, point)
    smoothing = fidelity.smoothing
    args = (state, fence_point, polar_parcel(), corner)
    gap, gap_rate, sliding = polar.gap(*args), polar.gap_rate(*args), polar.sliding_speed(*args)
    normal = kelvin(gap, gap_rate)
    friction = polar.friction_at_corner(
        normal, sliding, 0.35, 0.5, smoothing.static_speed, smoothing.slip_speed
    )
    belt = belt_forces(state, smoothing)
    theirs = polar.oblique_impact(
        state, fence_point, polar_parcel(), polar.FenceForces(normal, friction, *belt), corner
    )
    ((contact, *_),) = forces.fence
    assert_close(contact.gap, gap)
    assert_close(contact.gap_rate, gap_rate)
    assert_close(contact.sliding, sliding)
    assert_close(contact.normal, normal)
    assert_close(contact.friction, -friction)
    assert_same_acceleration(forces.acceleration, state, theirs)


@pytest.mark.parametrize(("corner", "border_corner"), [(1, 2), (4, 1), (3, 2), (2, 3)])
def test_border_and_fence(corner, border_corner):
    fidelity = fj.Fidelity.standard()
    scene = fj.scenes.border_and_fence(
        parcel=library_parcel(), fence_corner=corner, border_corner=border_corner
    )
    mechanics = Mechanics(scene, fidelity)
    body, drive, point = random_states(corner, seed=10 + corner)
    # Lower the parcel and the fence with it until the border corner is in by 1 to 20 mm.
    arm_x, arm_y = (float(v) for v in library_parcel().corner(border_corner))
    height = body.y + np.sin(body.angle) * arm_x + np.cos(body.angle) * arm_y
    drop = height + np.random.default_rng(3).uniform(0.001, 0.02, COUNT)
    body = body._replace(y=body.y - drop)
    turned = (point.x - np.sin(drive.angle) * drop, point.y - np.cos(drive.angle) * drop)
    point = point._replace(x=turned[0], y=turned[1])
    frame = mechanics.frame(drive, (jnp.full(COUNT, 0.9),))
    forces = mechanics.forces(body, mechanics.arms(body.angle), frame, (point,))

    state, fence_point = polar_state(body), in_fixed_axes(drive, point)
    smoothing = fidelity.smoothing
    args = (state, fence_point, polar_parcel(), corner)
    normal = kelvin(polar.gap(*args), polar.gap_rate(*args))
    friction = polar.friction_at_corner(
        normal, polar.sliding_speed(*args), 0.35, 0.5, smoothing.static_speed,
        smoothing.slip_speed,
    )
    # The border's forces follow from its gap and sliding speed, which the stage also returns.
    blank = polar.BorderForces(normal, friction, *belt_forces(state, smoothing), 0.0, 0.0)
    stage = polar.border_and_fence(
        state, fence_point, polar_parcel(), blank, corner, border_corner
    )
    border_normal = kelvin(stage.border_gap, stage.border_gap_rate)
    border_friction = polar.friction_at_corner(
        border_normal, stage.border_sliding_speed, 0.35, 0.5, smoothing.static_speed,
        smoothing.slip_speed,
    )
    theirs = polar.border_and_fence(
        state, fence_point, polar_parcel(),
        blank._replace(border_normal=border_normal, border_friction=border_friction),
        corner, border_corner,
    )
    ((border, *_),) = forces.border
    assert_close(border.gap, stage.border_gap)
    assert_close(border.gap_rate, stage.border_gap_rate)
    assert_close(border.sliding, stage.border_sliding_speed)
    assert_close(border.normal, border_normal)
    assert np.count_nonzero(border_normal) > COUNT // 4
    assert_same_acceleration(forces.acceleration, state, theirs)
