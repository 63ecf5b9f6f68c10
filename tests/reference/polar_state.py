"""State, parcel and forces of the polar form, its laws of friction, and the converters from and to
Cartesian coordinates; conventions in `polar.py`."""

from collections import namedtuple

import numpy as np

PolarState = namedtuple("PolarState", "r alpha phi r_dot alpha_dot phi_dot")
PolarState.__doc__ = """State of the parcel.

r [m], alpha [rad]: polar coordinates of the centre of gravity C_s; phi [rad]: rotation;
r_dot [m/s], alpha_dot [rad/s], phi_dot [rad/s]: their rates.
"""

Parcel = namedtuple("Parcel", "mass inertia length width x_p y_p")
Parcel.__doc__ = """The rigid rectangular parcel.

mass [kg]: m_p; inertia [kg m^2]: I_p about C_s; length [m]: side A, along x at phi = 0;
width [m]: side B; x_p, y_p [m]: offset of C_s from the geometric centre, in the parcel's frame.
"""

FencePoint = namedtuple("FencePoint", "x y q5 x_dot y_dot q5_dot")
FencePoint.__doc__ = """Point U of the fence that faces the corner.

x, y [m]: position of U; q5 [rad]: angle of the fence's tangent at U; x_dot, y_dot [m/s]: velocity
of the fence's material point at U; q5_dot [rad/s]: rate of q5 (used by the paper's foot rate and
by the stage along the fence only).
"""

FenceForces = namedtuple("FenceForces", "normal friction belt_r belt_alpha belt_torque")
FenceForces.__doc__ = """Forces of the stages with the fence alone.

normal [N]: N; friction [N]: F_2, signed, along -t on the parcel; belt_r, belt_alpha [N]: radial
and circumferential component of the belt friction F_1; belt_torque [N m]: T, opposing phi_dot.
"""

BorderForces = namedtuple(
    "BorderForces", FenceForces._fields + ("border_normal", "border_friction")
)
BorderForces.__doc__ = """Forces of the stage with the border: those of FenceForces, and

border_normal [N]: N_2, along +y on the parcel; border_friction [N]: F, signed, along -x.
"""

BeltFriction = namedtuple("BeltFriction", "belt_r belt_alpha belt_torque")
BeltFriction.__doc__ = """Belt friction: belt_r, belt_alpha [N], belt_torque [N m]."""

CornerGeometry = namedtuple("CornerGeometry", "r_c gamma u")
CornerGeometry.__doc__ = """Corner j: r_c [m]: r_Cj; gamma [rad]: gamma_j; u [-]: u_j = -1 or +1."""

ObliqueImpact = namedtuple(
    "ObliqueImpact", "gap gap_rate sliding_speed r_ddot alpha_ddot phi_ddot"
)
ObliqueImpact.__doc__ = """Stage of oblique impact.

gap [m]: D, positive in contact; gap_rate [m/s]; sliding_speed [m/s]: along t; r_ddot [m/s^2],
alpha_ddot [rad/s^2], phi_ddot [rad/s^2].
"""

AlongFence = namedtuple("AlongFence", ObliqueImpact._fields + ("wall_moment",))
AlongFence.__doc__ = """Stage along the fence: the fields of ObliqueImpact, and

wall_moment [N m]: moment that the wall needs, beside N at the foot, to turn with the fence.
"""

BorderAndFence = namedtuple(
    "BorderAndFence",
    "gap gap_rate sliding_speed border_gap border_gap_rate border_sliding_speed "
    "r_ddot alpha_ddot phi_ddot",
)
BorderAndFence.__doc__ = """Stage of border and fence: as ObliqueImpact, and the border's own

border_gap [m]: positive in contact; border_gap_rate [m/s]; border_sliding_speed [m/s]: along x.
"""

CartesianState = namedtuple("CartesianState", "x y phi x_dot y_dot phi_dot")
CartesianState.__doc__ = """x, y [m], phi [rad], x_dot, y_dot [m/s], phi_dot [rad/s]."""


def mean_distance(parcel):
    """c [m], mean distance of the rectangle's points from C_s, so that T_max = c F_max, (2.19).

    Closed form: over a rectangle a x b seen from its corner, the integral of the distance is
    a b d/3 + (a^3 asinh(b/a) + b^3 asinh(a/b))/6 with d^2 = a^2 + b^2. C_s splits the parcel into
    four of these, so C_s must lie inside it.

    parcel: Parcel [SI].
    """
    total = 0.0
    for a in (parcel.length / 2 - parcel.x_p, parcel.length / 2 + parcel.x_p):
        for b in (parcel.width / 2 - parcel.y_p, parcel.width / 2 + parcel.y_p):
            total = total + a * b * np.hypot(a, b) / 3
            total = total + (a**3 * np.arcsinh(b / a) + b**3 * np.arcsinh(a / b)) / 6
    return total / (parcel.length * parcel.width)


# --- Friction -----------------------------------------------------------------------------------


def friction_at_corner(normal, speed, mu_kinetic, mu_static=None, w_s=None, epsilon=0.0):
    """F_2 [N], signed like the sliding speed (it acts along -t), (2.19)_4.

    F_2 = mu(w) N w / sqrt(w^2 + epsilon^2), mu(w) = mu_k + (mu_s - mu_k) exp(-(w/w_s)^2);
    epsilon = 0 is the sign function, with 0 at w = 0.

    normal [N]: N >= 0; speed [m/s]: w; mu_kinetic [-]: mu_2k; mu_static [-]: mu_2s, or None for
    kinetic friction only; w_s [m/s]: width of the static peak, with mu_static; epsilon [m/s].
    """
    mu = mu_kinetic
    if mu_static is not None:
        mu = mu_kinetic + (mu_static - mu_kinetic) * np.exp(-((speed / w_s) ** 2))
    size = np.sqrt(speed**2 + epsilon**2)
    return mu * normal * speed / np.where(size > 0, size, 1.0)


def friction_on_belt(state, parcel, belt_speed, mu_1, gravity=9.81, epsilon=0.0):
    """Belt friction from Goyal's limit surface in polar components, (2.19)_1-3 and (2.20).

    Relative speed of the belt: u_r = v cos(alpha_p) - r_dot, u_alpha = -v sin(alpha_p)
    - r alpha_dot. F_1 = F_max^2 u/Lambda, T = F_max^2 c^2 phi_dot/Lambda, Lambda^2 =
    F_max^2 (u_r^2 + u_alpha^2 + epsilon^2) + F_max^2 c^2 phi_dot^2, F_max = mu_1 m_p g.
    No force at Lambda = 0 (full stick has no unique one).

    state: PolarState [SI]; parcel: Parcel [SI]; belt_speed [m/s]: v, along +x; mu_1 [-]: the
    coefficient that applies in this state; gravity [m/s^2]; epsilon [m/s].
    """
    f_max = mu_1 * parcel.mass * gravity
    c = mean_distance(parcel)
    u_r = belt_speed * np.cos(state.alpha) - state.r_dot
    u_alpha = -belt_speed * np.sin(state.alpha) - state.r * state.alpha_dot
    spread = np.sqrt(u_r**2 + u_alpha**2 + (c * state.phi_dot) ** 2 + epsilon**2)
    factor = f_max / np.where(spread > 0, spread, 1.0)
    return BeltFriction(factor * u_r, factor * u_alpha, factor * c**2 * state.phi_dot)


# --- Converters: the only place where Cartesian coordinates of C_s appear -----------------------


def polar_state_from_cartesian(cartesian):
    """PolarState [SI] of a CartesianState [SI]; r = sqrt(x^2 + y^2) must not be 0."""
    x, y, phi, x_dot, y_dot, phi_dot = cartesian
    r = np.hypot(x, y)
    r_dot = (x * x_dot + y * y_dot) / r
    alpha_dot = (x * y_dot - y * x_dot) / r**2
    return PolarState(r, np.arctan2(y, x), phi, r_dot, alpha_dot, phi_dot)


def cartesian_state_from_polar(state):
    """CartesianState [SI] of a PolarState [SI]."""
    cos, sin = np.cos(state.alpha), np.sin(state.alpha)
    across = state.r * state.alpha_dot
    return CartesianState(
        state.r * cos,
        state.r * sin,
        state.phi,
        state.r_dot * cos - across * sin,
        state.r_dot * sin + across * cos,
        state.phi_dot,
    )


def cartesian_acceleration_from_polar(state, r_ddot, alpha_ddot):
    """(x_ddot, y_ddot) [m/s^2] of C_s.

    state: PolarState [SI]; r_ddot [m/s^2]; alpha_ddot [rad/s^2].
    """
    radial = r_ddot - state.r * state.alpha_dot**2
    across = state.r * alpha_ddot + 2 * state.r_dot * state.alpha_dot
    cos, sin = np.cos(state.alpha), np.sin(state.alpha)
    return radial * cos - across * sin, radial * sin + across * cos


def polar_acceleration_from_cartesian(state, x_ddot, y_ddot):
    """(r_ddot [m/s^2], alpha_ddot [rad/s^2]) of C_s; state.r must not be 0.

    state: PolarState [SI]; x_ddot, y_ddot [m/s^2].
    """
    cos, sin = np.cos(state.alpha), np.sin(state.alpha)
    radial = x_ddot * cos + y_ddot * sin
    across = y_ddot * cos - x_ddot * sin
    r_ddot = radial + state.r * state.alpha_dot**2
    alpha_ddot = (across - 2 * state.r_dot * state.alpha_dot) / state.r
    return r_ddot, alpha_ddot
