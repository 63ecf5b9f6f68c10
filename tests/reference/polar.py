"""The parcel in polar coordinates (r, alpha_p, phi), the way the source paper writes it.

Source: T. Piatkowski, Active fence with flexible link, J. Theor. Appl. Mech. 48(1), 87-109, 2010.
Equation numbers are the paper's; its misprints are corrected, and each correction sits in a
function of its own (`corner_angle`, `orientation_from_fence_side`, `wall_distance`,
`border_moment`, `corner_rate_term`), so that a test can put the printed form back.

An independent reference: NumPy only, no vectors and no cross products. Forces are projected with
the angles alpha_p and q5, moments are r_Cj N cos(...) and r_Cj F sin(...). Every argument may be a
float or an array; arrays broadcast. Only the corner number j is a plain int.

Conventions
    The hinge of the fence O is the origin; x along the belt, y across it, angles anticlockwise.
    (r, alpha_p): centre of gravity C_s, x = r cos(alpha_p), y = r sin(alpha_p). Singular at r = 0.
    phi: rotation of the parcel, 0 when side A lies along x.
    Corners: 1 leading lower, 2 trailing lower, 3 trailing upper, 4 leading upper.
    r_Cj: distance C_s to corner j. gamma_j: acute angle between side A and the line C_s to corner
    j (for C_s inside the parcel). u_j = -1 for corners 1 and 3, +1 for corners 2 and 4.
    q5: angle between the fence's tangent t = (cos q5, sin q5) and x; n = (-sin q5, cos q5).
    The fence pushes the parcel along +n with N >= 0, the border along +y with N_2 >= 0.
    A friction force is positive when it acts along -t (fence) or -x (border) on the parcel, that
    is, when it opposes a positive sliding speed. The belt's torque T is positive clockwise: it
    opposes a positive phi_dot.
"""

import numpy as np

from .polar_state import (
    AlongFence as AlongFence,
    BeltFriction as BeltFriction,
    BorderAndFence as BorderAndFence,
    BorderForces as BorderForces,
    CartesianState as CartesianState,
    CornerGeometry as CornerGeometry,
    FenceForces as FenceForces,
    FencePoint as FencePoint,
    ObliqueImpact as ObliqueImpact,
    Parcel as Parcel,
    PolarState as PolarState,
    cartesian_acceleration_from_polar as cartesian_acceleration_from_polar,
    cartesian_state_from_polar as cartesian_state_from_polar,
    friction_at_corner as friction_at_corner,
    friction_on_belt as friction_on_belt,
    mean_distance as mean_distance,
    polar_acceleration_from_cartesian as polar_acceleration_from_cartesian,
    polar_state_from_cartesian as polar_state_from_cartesian,
)

# --- Geometry of the parcel ---------------------------------------------------------------------

_U = {1: -1.0, 2: 1.0, 3: -1.0, 4: 1.0}
# Signs of the cosine and the sine in (2.12): the quadrant of the corner in the parcel's frame.
_QUADRANT = {1: (1.0, -1.0), 2: (-1.0, -1.0), 3: (-1.0, 1.0), 4: (1.0, 1.0)}


def corner_geometry(parcel, j):
    """r_Cj, gamma_j and u_j of corner j, under (2.12).

    parcel: Parcel [SI]; j: 1, 2, 3 or 4 [-].
    """
    along = parcel.length / 2 + (-parcel.x_p if j in (1, 4) else parcel.x_p)
    across = parcel.width / 2 + (parcel.y_p if j in (1, 2) else -parcel.y_p)
    return CornerGeometry(np.hypot(along, across), np.arctan2(across, along), _U[j])


def corner_angle(gamma, u, phi):
    """gamma_j + u_j phi [rad], the angle in (2.12). Printed: gamma_j + phi.

    gamma [rad]: gamma_j; u [-]: u_j; phi [rad].
    """
    return gamma + u * phi


def orientation_from_fence_side(phi, j):
    """phi [rad] as (2.5)-(2.7) take it: for corners 3, 4 counted from the parcel turned by pi.

    phi [rad]; j: 1, 2, 3 or 4 [-]. Printed: phi itself for every corner.
    """
    return phi + np.pi if j in (3, 4) else phi


def wall_distance(parcel):
    """B/2 + y_p [m], distance of C_s from the lower wall, (2.30). Printed: (B + y_p)/2.

    parcel: Parcel [SI].
    """
    return parcel.width / 2 + parcel.y_p


# --- Kinematics of a corner ---------------------------------------------------------------------


def corner_position(state, parcel, j):
    """(x_C, y_C) [m] of corner j, (2.12).

    x_C = r cos(alpha_p) -/+ r_Cj cos(gamma_j + u_j phi), y_C likewise with sin.

    state: PolarState [SI]; parcel: Parcel [SI]; j: 1, 2, 3 or 4 [-].
    """
    r_c, gamma, u = corner_geometry(parcel, j)
    angle = corner_angle(gamma, u, state.phi)
    sign_cos, sign_sin = _QUADRANT[j]
    x_c = state.r * np.cos(state.alpha) + sign_cos * r_c * np.cos(angle)
    y_c = state.r * np.sin(state.alpha) + sign_sin * r_c * np.sin(angle)
    return x_c, y_c


def _levers(q5, phi, parcel, j):
    """Levers [m] of corner j about C_s: of a force along n, and of a force along -t.

    Corner 1: r_C1 cos(q5 + gamma_1 - phi) and -r_C1 sin(q5 + gamma_1 - phi);
    corner 2: -r_C2 cos(q5 - gamma_2 - phi) and r_C2 sin(q5 - gamma_2 - phi); 3 as 1 and 4 as 2,
    with phi counted from the parcel turned by pi.
    """
    r_c, gamma, u = corner_geometry(parcel, j)
    angle = q5 - u * gamma - orientation_from_fence_side(phi, j)
    return -u * r_c * np.cos(angle), u * r_c * np.sin(angle)


def gap(state, fence_point, parcel, j):
    """D [m], indentation of corner j into the fence, positive in contact, (2.13).

    D = (x_C - x_U) sin(q5) - (y_C - y_U) cos(q5).

    state: PolarState [SI]; fence_point: FencePoint [SI]; parcel: Parcel [SI]; j [-].
    """
    x_c, y_c = corner_position(state, parcel, j)
    q5 = fence_point.q5
    return (x_c - fence_point.x) * np.sin(q5) - (y_c - fence_point.y) * np.cos(q5)


def gap_rate(state, fence_point, parcel, j):
    """dD/dt [m/s], (2.18): the speed of U less that of corner j, both along n.

    The corner's is r_dot sin(alpha_p - q5) + r alpha_dot cos(alpha_p - q5) + phi_dot r_Cj cos(...),
    with the cosine of `fence_moment`.

    state: PolarState [SI]; fence_point: FencePoint [SI]; parcel: Parcel [SI]; j [-].
    """
    q5 = fence_point.q5
    lever_n, _ = _levers(q5, state.phi, parcel, j)
    corner = (
        state.r_dot * np.sin(state.alpha - q5)
        + state.r * state.alpha_dot * np.cos(state.alpha - q5)
        + state.phi_dot * lever_n
    )
    return fence_point.y_dot * np.cos(q5) - fence_point.x_dot * np.sin(q5) - corner


def sliding_speed(state, fence_point, parcel, j):
    """w [m/s], speed of corner j relative to the fence's material point U, along t, (2.19)_4.

    w = r_dot cos(alpha_p - q5) - r alpha_dot sin(alpha_p - q5) -/+ phi_dot r_Cj sin(...)
    - (speed of U along t), with the sine of `fence_moment`.

    state: PolarState [SI]; fence_point: FencePoint [SI]; parcel: Parcel [SI]; j [-].
    """
    q5 = fence_point.q5
    _, lever_minus_t = _levers(q5, state.phi, parcel, j)
    corner = (
        state.r_dot * np.cos(state.alpha - q5)
        - state.r * state.alpha_dot * np.sin(state.alpha - q5)
        - state.phi_dot * lever_minus_t
    )
    return corner - fence_point.x_dot * np.cos(q5) - fence_point.y_dot * np.sin(q5)


def corner_rate_term(state, q5, q5_dot, parcel, j):
    """r_C1 (phi_dot - q5_dot) sin(q5 + gamma_1 - phi) [m/s], last term of (2.33)_1.

    Printed: r_C1 (alpha_dot_p - q5_dot) sin(alpha_p + gamma_1 - phi). Here for every corner.

    state: PolarState [SI]; q5 [rad]; q5_dot [rad/s]; parcel: Parcel [SI]; j [-].
    """
    r_c, gamma, u = corner_geometry(parcel, j)
    phi = orientation_from_fence_side(state.phi, j)
    return -u * r_c * (state.phi_dot - q5_dot) * np.sin(q5 - u * gamma - phi)


def foot_rate(state, fence_point, parcel, j):
    """Rate [m/s] of the coordinate of corner j along a straight fence through O, (2.33)_1.

    d/dt (x_C cos q5 + y_C sin q5) = r_dot cos(alpha_p - q5)
    - r (alpha_dot_p - q5_dot) sin(alpha_p - q5) + r_C1 (phi_dot - q5_dot) sin(q5 + gamma_1 - phi).

    This is the speed of the foot of the perpendicular and not that of two material points: on a
    rigid fence turning about O it is `sliding_speed` - D q5_dot.

    state: PolarState [SI]; fence_point: FencePoint [SI], of which q5 and q5_dot; parcel: Parcel
    [SI]; j [-].
    """
    q5, q5_dot = fence_point.q5, fence_point.q5_dot
    return (
        state.r_dot * np.cos(state.alpha - q5)
        - state.r * (state.alpha_dot - q5_dot) * np.sin(state.alpha - q5)
        + corner_rate_term(state, q5, q5_dot, parcel, j)
    )


# --- Forces to accelerations --------------------------------------------------------------------


def fence_radial_force(state, q5, normal, friction):
    """N sin(alpha_p - q5) - F_2 cos(alpha_p - q5) [N], radial, as in (2.5)_1.

    state: PolarState [SI]; q5 [rad]; normal [N]; friction [N].
    """
    return normal * np.sin(state.alpha - q5) - friction * np.cos(state.alpha - q5)


def fence_circumferential_force(state, q5, normal, friction):
    """N cos(alpha_p - q5) + F_2 sin(alpha_p - q5) [N], circumferential, as in (2.5)_2.

    state: PolarState [SI]; q5 [rad]; normal [N]; friction [N].
    """
    return normal * np.cos(state.alpha - q5) + friction * np.sin(state.alpha - q5)


def fence_moment(state, q5, normal, friction, parcel, j):
    """Moment [N m] of N and F_2 at corner j about C_s, (2.5)-(2.7).

    Corner 1: r_C1 [N cos(q5 + gamma_1 - phi) - F_2 sin(q5 + gamma_1 - phi)];
    corner 2: -r_C2 [N cos(q5 - gamma_2 - phi) - F_2 sin(q5 - gamma_2 - phi)];
    3 as 1 and 4 as 2, with phi counted from the parcel turned by pi.

    state: PolarState [SI]; q5 [rad]; normal [N]; friction [N]; parcel: Parcel [SI]; j [-].
    """
    lever_n, lever_minus_t = _levers(q5, state.phi, parcel, j)
    return normal * lever_n + friction * lever_minus_t


def border_moment(state, normal, friction, parcel, j):
    """Moment [N m] of N_2 and F at corner j on the border, (2.31)_4 and (2.32)_3.

    Corner 2: -r_C2 [N_2 cos(gamma_2 + phi) + F sin(gamma_2 + phi)]. Printed in (2.31)_4 with +.
    Corner 1: r_C1 [N_2 cos(gamma_1 - phi) - F sin(gamma_1 - phi)]; 3 as 1 and 4 as 2, with phi
    counted from the parcel turned by pi.

    state: PolarState [SI]; normal [N]; friction [N]; parcel: Parcel [SI]; j [-].
    """
    r_c, gamma, u = corner_geometry(parcel, j)
    angle = gamma + u * orientation_from_fence_side(state.phi, j)
    return -r_c * (u * normal * np.cos(angle) + friction * np.sin(angle))


def _polar_acceleration(state, parcel, force_r, force_alpha):
    """(r_ddot [m/s^2], alpha_ddot [rad/s^2]) of the forces [N].

    r_ddot - r alpha_dot^2 = F_r/m, r alpha_ddot + 2 r_dot alpha_dot = F_alpha/m.
    """
    r_ddot = force_r / parcel.mass + state.r * state.alpha_dot**2
    alpha_ddot = (force_alpha / parcel.mass - 2 * state.r_dot * state.alpha_dot) / state.r
    return r_ddot, alpha_ddot


# --- Stages -------------------------------------------------------------------------------------


def oblique_impact(state, fence_point, parcel, forces, j):
    """Oblique impact: the fence at corner j, and the belt, (2.3)-(2.7), (2.12), (2.13), (2.18).

    r_ddot - r alpha_dot^2 = F_r/m, r alpha_ddot + 2 r_dot alpha_dot = F_alpha/m,
    I_p phi_ddot = moment of N and F_2 - T.

    state: PolarState [SI]
    fence_point: FencePoint [SI], the point U that faces corner j
    parcel: Parcel [SI]
    forces: FenceForces [SI], taken as given; no contact law is applied here
    j: 1, 2, 3 or 4 [-]
    returns: ObliqueImpact [SI]
    """
    q5 = fence_point.q5
    pair = forces.normal, forces.friction
    force_r = fence_radial_force(state, q5, *pair) + forces.belt_r
    force_alpha = fence_circumferential_force(state, q5, *pair) + forces.belt_alpha
    moment = fence_moment(state, q5, *pair, parcel, j) - forces.belt_torque
    r_ddot, alpha_ddot = _polar_acceleration(state, parcel, force_r, force_alpha)
    return ObliqueImpact(
        gap(state, fence_point, parcel, j),
        gap_rate(state, fence_point, parcel, j),
        sliding_speed(state, fence_point, parcel, j),
        r_ddot,
        alpha_ddot,
        moment / parcel.inertia,
    )


def along_fence(state, fence_point, parcel, forces, q5_ddot):
    """Along the fence: the lower wall lies on it, N acts at the foot C of C_s, (2.27)-(2.30).

    The rotation is tied to the fence, phi = q5, phi_dot = q5_dot, phi_ddot = q5_ddot; state.phi
    and state.phi_dot are not read. C is at the distance B/2 + y_p from C_s along -n:
    D = B/2 + y_p - r sin(alpha_p - q5) + y_U cos(q5) - x_U sin(q5); N has no moment about C_s and
    F_2 turns the parcel by -F_2 (B/2 + y_p).

    state: PolarState [SI]
    fence_point: FencePoint [SI], the point U that faces the foot C
    parcel: Parcel [SI]
    forces: FenceForces [SI], taken as given
    q5_ddot: [rad/s^2] second rate of the tangent angle that the parcel follows
    returns: AlongFence [SI]
    """
    q5, q5_dot = fence_point.q5, fence_point.q5_dot
    height = wall_distance(parcel)
    angle = state.alpha - q5
    u_n = fence_point.y_dot * np.cos(q5) - fence_point.x_dot * np.sin(q5)
    u_t = fence_point.x_dot * np.cos(q5) + fence_point.y_dot * np.sin(q5)
    pair = forces.normal, forces.friction
    force_r = fence_radial_force(state, q5, *pair) + forces.belt_r
    force_alpha = fence_circumferential_force(state, q5, *pair) + forces.belt_alpha
    r_ddot, alpha_ddot = _polar_acceleration(state, parcel, force_r, force_alpha)
    return AlongFence(
        height
        - state.r * np.sin(angle)
        + fence_point.y * np.cos(q5)
        - fence_point.x * np.sin(q5),
        u_n - state.r_dot * np.sin(angle) - state.r * state.alpha_dot * np.cos(angle),
        state.r_dot * np.cos(angle)
        - state.r * state.alpha_dot * np.sin(angle)
        + q5_dot * height
        - u_t,
        r_ddot,
        alpha_ddot,
        q5_ddot,
        parcel.inertia * q5_ddot + forces.friction * height + forces.belt_torque,
    )


def border_and_fence(state, fence_point, parcel, forces, j, border_j):
    """Border and fence: the fence at corner j, the border y = 0 at another, belt, (2.31)-(2.34).

    The border adds N_2 sin(alpha_p) - F cos(alpha_p) radially, N_2 cos(alpha_p)
    + F sin(alpha_p) circumferentially and `border_moment`; its gap is -y_C, (2.34).

    state: PolarState [SI]
    fence_point: FencePoint [SI], the point U that faces corner j
    parcel: Parcel [SI]
    forces: BorderForces [SI], taken as given
    j, border_j: corners at the fence and at the border (paper: 1 and 2) [-]
    returns: BorderAndFence [SI]
    """
    q5 = fence_point.q5
    at_fence = forces.normal, forces.friction
    at_border = forces.border_normal, forces.border_friction
    force_r = (
        fence_radial_force(state, q5, *at_fence)
        + forces.border_normal * np.sin(state.alpha)
        - forces.border_friction * np.cos(state.alpha)
        + forces.belt_r
    )
    force_alpha = (
        fence_circumferential_force(state, q5, *at_fence)
        + forces.border_normal * np.cos(state.alpha)
        + forces.border_friction * np.sin(state.alpha)
        + forces.belt_alpha
    )
    moment = (
        fence_moment(state, q5, *at_fence, parcel, j)
        + border_moment(state, *at_border, parcel, border_j)
        - forces.belt_torque
    )
    r_ddot, alpha_ddot = _polar_acceleration(state, parcel, force_r, force_alpha)
    border_line = FencePoint(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return BorderAndFence(
        gap(state, fence_point, parcel, j),
        gap_rate(state, fence_point, parcel, j),
        sliding_speed(state, fence_point, parcel, j),
        gap(state, border_line, parcel, border_j),
        gap_rate(state, border_line, parcel, border_j),
        sliding_speed(state, border_line, parcel, border_j),
        r_ddot,
        alpha_ddot,
        moment / parcel.inertia,
    )
