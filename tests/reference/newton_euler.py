"""Plain vector Newton-Euler of the parcel, at random states, compared with the paper's polar form.

Vectors and cross products, no code shared with `polar.py` but the numbers of a scene.
"""

import numpy as np

from . import polar

STATES = 200
RTOL = 1e-10
CORNERS = (1, 2, 3, 4)
# Border corner for each fence corner: the next one round the parcel, paper 1 and 2 first.
PAIRS = ((1, 2), (2, 1), (3, 4), (4, 3), (1, 3), (4, 2))
V, MU_1, MU_2, GRAVITY, EPSILON = 2.0, 0.65, 0.35, 9.81, 0.01


# --- Random scenes ------------------------------------------------------------------------------


def scene(seed=20100148):
    """States, parcels, fence kinematics and contact forces, drawn at random."""
    rng = np.random.default_rng(seed)

    def draw(low, high):
        return rng.uniform(low, high, STATES)

    length, width = draw(0.2, 0.6), draw(0.15, 0.5)
    mass = draw(1.0, 30.0)
    parcel = polar.Parcel(
        mass,
        mass * (length**2 + width**2) / 12 * draw(0.7, 1.3),
        length,
        width,
        length * draw(0.05, 0.3) * rng.choice([-1, 1], STATES),
        width * draw(0.05, 0.3) * rng.choice([-1, 1], STATES),
    )
    state = polar.PolarState(
        draw(0.3, 1.5), draw(-np.pi, np.pi), draw(-np.pi, np.pi),
        draw(-3.0, 3.0), draw(-4.0, 4.0), draw(-8.0, 8.0),
    )
    fence = {
        "q5": draw(-0.9, 0.9), "q5_dot": draw(-3.0, 3.0), "q5_ddot": draw(-50.0, 50.0),
        "velocity": np.stack([draw(-3, 3), draw(-3, 3), np.zeros(STATES)], axis=1),
        "depth": draw(-0.02, 0.02), "shift": draw(-0.05, 0.05),
    }
    normals = draw(0.0, 2000.0), draw(0.0, 2000.0)
    return state, parcel, fence, normals


# --- Vector Newton-Euler ------------------------------------------------------------------------


def vec(x, y):
    return np.stack(np.broadcast_arrays(x, y, np.zeros(STATES)), axis=1)


def dot(a, b):
    return np.sum(a * b, axis=1)


def times(scalar, vector):
    return scalar[:, None] * vector


def spin(rate, arm):
    """rate z x arm."""
    return np.cross(vec(0.0, 0.0) + times(rate, np.array([[0.0, 0.0, 1.0]])), arm)


def centre(state):
    """Position and velocity of C_s."""
    e_r = vec(np.cos(state.alpha), np.sin(state.alpha))
    position = times(state.r, e_r)
    return position, times(state.r_dot, e_r) + spin(state.alpha_dot, position)


def corner_arm(phi, parcel, j):
    """C_s to corner j, turned by phi."""
    side_x, side_y = {1: (1, -1), 2: (-1, -1), 3: (-1, 1), 4: (1, 1)}[j]
    x = side_x * parcel.length / 2 - parcel.x_p
    y = side_y * parcel.width / 2 - parcel.y_p
    return vec(x * np.cos(phi) - y * np.sin(phi), x * np.sin(phi) + y * np.cos(phi))


def mean_distance_by_quadrature(parcel):
    """Gauss-Legendre in each of the four rectangles round C_s (the kink sits at their corner).

    Polar angle splits every rectangle into two triangles, on which rho^2 integrates exactly.
    """
    nodes, weights = np.polynomial.legendre.leggauss(40)
    total = 0.0
    for a in (parcel.length / 2 - parcel.x_p, parcel.length / 2 + parcel.x_p):
        for b in (parcel.width / 2 - parcel.y_p, parcel.width / 2 + parcel.y_p):
            for near, longer in ((a, b), (b, a)):
                top = np.arctan2(longer, near)[:, None]
                angle = top * (nodes + 1) / 2
                reach = near[:, None] / np.cos(angle)
                total = total + np.sum(top / 2 * weights * reach**3 / 3, axis=1)
    return total / (parcel.length * parcel.width)


def belt_force_and_torque(velocity, phi_dot, parcel):
    """Goyal's limit surface in Cartesian components, smoothed."""
    f_max = MU_1 * parcel.mass * GRAVITY
    c = mean_distance_by_quadrature(parcel)
    u = vec(V, 0.0) - velocity
    lam = np.sqrt(f_max**2 * (dot(u, u) + EPSILON**2) + f_max**2 * c**2 * phi_dot**2)
    return times(f_max**2 / lam, u), -(f_max**2) * c**2 * phi_dot / lam


def newton_euler(parcel, contacts, belt):
    """Acceleration of C_s and angular acceleration: contacts = [(arm, force), ...]."""
    force, torque = belt
    for arm, push in contacts:
        force = force + push
        torque = torque + np.cross(arm, push)[:, 2]
    return times(1 / parcel.mass, force), torque / parcel.inertia


def contact(position, velocity, phi_dot, arm, point, point_velocity, t, n):
    """Gap, gap rate, sliding speed of the point at `arm` against a line through `point`."""
    offset = position + arm - point
    relative = velocity + spin(phi_dot, arm) - point_velocity
    return -dot(offset, n), -dot(relative, n), dot(relative, t)


def friction(normal, w):
    return MU_2 * normal * w / np.sqrt(w**2 + EPSILON**2)


# --- The comparisons ----------------------------------------------------------------------------


def assert_same(actual, expected, name):
    scale = np.max(np.abs(expected))
    np.testing.assert_allclose(actual, expected, rtol=RTOL, atol=1e-12 * scale, err_msg=name)


def assert_same_accelerations(state, result, acceleration, phi_ddot):
    e_r = vec(np.cos(state.alpha), np.sin(state.alpha))
    e_a = vec(-np.sin(state.alpha), np.cos(state.alpha))
    # a = (r_ddot - r alpha_dot^2) e_r + (r alpha_ddot + 2 r_dot alpha_dot) e_alpha
    r_ddot = dot(acceleration, e_r) + state.r * state.alpha_dot**2
    alpha_ddot = (dot(acceleration, e_a) - 2 * state.r_dot * state.alpha_dot) / state.r
    assert_same(result.r_ddot, r_ddot, "r_ddot")
    assert_same(result.alpha_ddot, alpha_ddot, "alpha_ddot")
    assert_same(result.phi_ddot, phi_ddot, "phi_ddot")


def fence_frame(fence):
    q5 = fence["q5"]
    return vec(np.cos(q5), np.sin(q5)), vec(-np.sin(q5), np.cos(q5))


def place_fence(fence, corner):
    """A point U at the given depth off the corner, shifted along t off the exact foot as well."""
    t, n = fence_frame(fence)
    point = corner + times(fence["depth"], n) + times(fence["shift"], t)
    velocity = fence["velocity"]
    return point, polar.FencePoint(
        point[:, 0], point[:, 1], fence["q5"], velocity[:, 0], velocity[:, 1], fence["q5_dot"]
    )


def struck(state, parcel, fence, normal, arm):
    """One force of the fence at the end of an arm: the fence's point there as the polar form has
    it; the gap, its rate and the sliding speed; the friction; the accelerations."""
    t, n = fence_frame(fence)
    position, velocity = centre(state)
    point, fence_point = place_fence(fence, position + arm)
    touch = contact(position, velocity, state.phi_dot, arm, point, fence["velocity"], t, n)
    f_2 = friction(normal, touch[2])
    push = times(normal, n) - times(f_2, t)
    belt = belt_force_and_torque(velocity, state.phi_dot, parcel)
    return fence_point, touch, f_2, newton_euler(parcel, [(arm, push)], belt)


def assert_same_contact(result, touch):
    for name, expected in zip(("gap", "gap_rate", "sliding_speed"), touch, strict=True):
        assert_same(getattr(result, name), expected, name)


def compare_oblique_impact(j):
    state, parcel, fence, (normal, _) = scene()
    arm = corner_arm(state.phi, parcel, j)
    fence_point, touch, _, accelerations = struck(state, parcel, fence, normal, arm)

    w_polar = polar.sliding_speed(state, fence_point, parcel, j)
    forces = polar.FenceForces(
        normal,
        polar.friction_at_corner(normal, w_polar, MU_2, epsilon=EPSILON),
        *polar.friction_on_belt(state, parcel, V, MU_1, GRAVITY, EPSILON),
    )
    result = polar.oblique_impact(state, fence_point, parcel, forces, j)
    assert_same_contact(result, touch)
    assert_same_accelerations(state, result, *accelerations)


def compare_border_and_fence(j, border_j):
    state, parcel, fence, (normal, normal_2) = scene()
    t, n = fence_frame(fence)
    position, velocity = centre(state)
    arm, arm_2 = (corner_arm(state.phi, parcel, k) for k in (j, border_j))
    point, fence_point = place_fence(fence, position + arm)
    at_fence = contact(position, velocity, state.phi_dot, arm, point, fence["velocity"], t, n)
    zero, x, y = vec(0.0, 0.0), vec(1.0, 0.0), vec(0.0, 1.0)
    at_border = contact(position, velocity, state.phi_dot, arm_2, zero, zero, x, y)
    push = times(normal, n) - times(friction(normal, at_fence[2]), t)
    push_2 = times(normal_2, y) - times(friction(normal_2, at_border[2]), x)
    belt = belt_force_and_torque(velocity, state.phi_dot, parcel)
    acceleration, phi_ddot = newton_euler(parcel, [(arm, push), (arm_2, push_2)], belt)

    forces = polar.BorderForces(
        normal,
        friction(normal, at_fence[2]),
        *polar.friction_on_belt(state, parcel, V, MU_1, GRAVITY, EPSILON),
        normal_2,
        friction(normal_2, at_border[2]),
    )
    result = polar.border_and_fence(state, fence_point, parcel, forces, j, border_j)
    for name, expected in zip(result._fields[:6], at_fence + at_border, strict=True):
        assert_same(getattr(result, name), expected, name)
    assert_same_accelerations(state, result, acceleration, phi_ddot)


def compare_along_fence():
    state, parcel, fence, (normal, _) = scene()
    state = state._replace(phi=fence["q5"], phi_dot=fence["q5_dot"])
    # Foot of C_s on the lower wall, the line through corners 1 and 2.
    arm_1, arm_2 = (corner_arm(state.phi, parcel, k) for k in (1, 2))
    wall = arm_2 - arm_1
    arm = arm_1 - times(dot(arm_1, wall) / dot(wall, wall), wall)
    fence_point, touch, f_2, (acceleration, phi_ddot_free) = struck(
        state, parcel, fence, normal, arm
    )

    forces = polar.FenceForces(
        normal, f_2, *polar.friction_on_belt(state, parcel, V, MU_1, GRAVITY, EPSILON)
    )
    result = polar.along_fence(state, fence_point, parcel, forces, fence["q5_ddot"])
    assert_same_contact(result, touch)
    assert_same_accelerations(state, result, acceleration, fence["q5_ddot"])
    missing = parcel.inertia * (fence["q5_ddot"] - phi_ddot_free)
    assert_same(result.wall_moment, missing, "wall_moment")


def compare_foot_rate(j):
    """(2.33)_1 against d/dt (C . t) = v_C . t + q5_dot C . n."""
    state, parcel, fence, _ = scene()
    t, n = fence_frame(fence)
    position, velocity = centre(state)
    arm = corner_arm(state.phi, parcel, j)
    corner_velocity = velocity + spin(state.phi_dot, arm)
    expected = dot(corner_velocity, t) + fence["q5_dot"] * dot(position + arm, n)
    _, fence_point = place_fence(fence, position + arm)
    assert_same(polar.foot_rate(state, fence_point, parcel, j), expected, "foot_rate")
