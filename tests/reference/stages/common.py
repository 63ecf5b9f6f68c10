"""What the stages share: the foot of a point on the fence, the loaded beam, friction, samples."""

from functools import lru_cache
from math import cos, exp, hypot, sin
from typing import NamedTuple

import numpy as np

from .. import polar
from ..impact import GRAVITY, contact_force, fence_load

FREE = ("r", "alpha", "phi", "r_dot", "alpha_dot", "phi_dot")
TIED = ("r", "alpha", "r_dot", "alpha_dot")
STILL = polar.FencePoint(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""A point at rest on the x axis: of the border, or of a fence that carries no force."""


class Foot(NamedTuple):
    """Foot U of the perpendicular from a point to the fence.

    point: polar.FencePoint of U, q5_dot that of the material point. load: modal load per unit N
    at U [kg^-1/2], shape (modes,). arc: sigma [m]. curvature: dq5/dsigma [rad/m].
    advance: (dx_U/dsigma, dy_U/dsigma) [-].
    """

    point: polar.FencePoint
    load: np.ndarray
    arc: float
    curvature: float
    advance: tuple


class Sample(NamedTuple):
    """A stage at one instant.

    time: since the start of the swing [s]. x, y [m], phi [rad]: parcel, and their rates.
    normal: N, all forces of the fence together [N]. friction: F_2 [N], likewise. gap: D [m] and
    arc: sigma [m], of corner 1 or of the foot C of C_s. border_normal: N_2 [N]. tip: deflection
    of the tip from the rigid link's line [m]. wall_moment: moment [N m] of the fence on the
    parcel about C_s beside that of N and F_2 at the point where the stage puts them: the moment
    that ties the rotation, 0 where it is free. corner_normals: (N_1, N_2) of corners 1 and 2 on
    the fence [N], nan where the stage has no such forces.
    """

    time: float
    x: float
    y: float
    phi: float
    x_rate: float
    y_rate: float
    spin: float
    normal: float
    friction: float
    gap: float
    arc: float
    border_normal: float
    tip: float
    wall_moment: float
    corner_normals: tuple


@lru_cache(maxsize=8)
def parcel_of(impact):
    """The parcel as `polar` takes it."""
    return polar.Parcel(impact.mass, impact.moment_of_inertia, *impact.size, *impact.center)


def free_state(impact, state):
    """PolarState of a state vector in the layout `FREE`."""
    count = impact.link.frequency.size
    return polar.PolarState(*state[2 * count :].tolist())


def foot(impact, fence, x, y):
    """`Foot` of the point (x, y) [m] on the fence, (2.14)-(2.17).

    Beyond the tip it is the tip's own point; behind the hinge the rigid link's line goes on.
    """
    element, local = fence.locate((x, y))
    if element < 0:
        cosine, sine = cos(fence.angle), sin(fence.angle)
        point = polar.FencePoint(
            local * cosine,
            local * sine,
            fence.angle,
            -fence.speed * local * sine,
            fence.speed * local * cosine,
            fence.speed,
        )
        unloaded = np.zeros(impact.link.frequency.size)
        return Foot(point, unloaded, local, 0.0, (cosine, sine))
    if element == impact.elements:
        element, local = element - 1, fence.element_length
    (u_x, u_y), q5, (advance_x, advance_y, curvature) = fence.point(element, local)
    _, a1, a2, a3 = fence.cubic(fence.q3_rate, fence.q5_rate, element)
    q5_dot = a1 + local * (2 * a2 + 3 * a3 * local)
    point = polar.FencePoint(u_x, u_y, q5, *fence.velocity(element, local), q5_dot)
    arc = impact.l_s + element * fence.element_length + local
    load = fence_load(impact, element, local)
    return Foot(point, load, arc, curvature, (advance_x, advance_y))


def on_fence(impact, found):
    """Whether a `Foot` lies between hinge and tip, where the fence can carry a force."""
    return 0 <= found.arc < impact.l_s + impact.l_p


def beam_rate(impact, fence, state, load):
    """(eta', eta'') under a modal load [N kg^-1/2], shape (2 modes,).

    eta'' = -c eta' - omega^2 eta - load - p alpha_w''; load = b N with b from (2.8).
    """
    link = impact.link
    count = link.frequency.size
    eta, eta_rate = state[:count], state[count : 2 * count]
    out = np.empty(2 * count)
    out[:count] = eta_rate
    out[count:] = (
        -link.damping * eta_rate
        - link.frequency**2 * eta
        - load
        - fence.acceleration * link.participation
    )
    return out


def state_rate(impact, fence, state, load, motion, moved, layout=FREE):
    """Time derivative of a state vector in the `layout`.

    load: modal, as in `beam_rate`. motion: polar.PolarState. moved: the parcel's accelerations,
    r_ddot, alpha_ddot and, where the rotation is free, phi_ddot.
    """
    places = layout[: len(layout) // 2]
    return np.concatenate(
        [
            beam_rate(impact, fence, state, load),
            [getattr(motion, f"{place}_dot") for place in places],
            [getattr(moved, f"{place}_ddot") for place in places],
        ]
    )


def center(motion):
    """(x, y) [m] of C_s in a PolarState."""
    return motion.r * cos(motion.alpha), motion.r * sin(motion.alpha)


def corner_friction(impact, normal, sliding):
    """F_2 [N] on a corner or on the wall, (2.19)_4 smoothed as in `Impact`."""
    kinetic, static = impact.mu_fence
    return float(
        polar.friction_at_corner(
            normal, sliding, kinetic, static, impact.stribeck, impact.epsilon
        )
    )


def belt_friction(impact, state):
    """polar.BeltFriction, (2.19)_1-3 and (2.20), mu_1 taken at the sliding speed.

    state: PolarState [SI]. mu_1 = mu_k + (mu_s - mu_k) exp(-(V/w_s)^2),
    V^2 = |u|^2 + c^2 phi'^2, u the belt's velocity relative to C_s.
    """
    u_r = impact.belt_speed * cos(state.alpha) - state.r_dot
    u_alpha = -impact.belt_speed * sin(state.alpha) - state.r * state.alpha_dot
    speed = hypot(u_r, u_alpha, impact.mean_distance * state.phi_dot)
    kinetic, static = impact.mu_belt
    mu = kinetic + (static - kinetic) * exp(-((speed / impact.stribeck) ** 2))
    return polar.friction_on_belt(
        state, parcel_of(impact), impact.belt_speed, mu, GRAVITY, impact.epsilon
    )


def at_border(impact, motion, corner):
    """(N_2, F) [N] of a corner on the border y = 0: (2.2) on D = -y_C, (2.34), and friction."""
    touch = motion, STILL, parcel_of(impact), corner
    normal = contact_force(impact, polar.gap(*touch), polar.gap_rate(*touch))
    return normal, corner_friction(impact, normal, polar.sliding_speed(*touch))


def at_fence(impact, fence, motion, corner):
    """(Foot, N, F_2) [N] of a corner on the fence: (2.2) on the gap (2.13), and friction."""
    parcel = parcel_of(impact)
    found = foot(impact, fence, *polar.corner_position(motion, parcel, corner))
    touch = motion, found.point, parcel, corner
    normal = 0.0
    if on_fence(impact, found):
        normal = contact_force(impact, polar.gap(*touch), polar.gap_rate(*touch))
    return found, normal, corner_friction(impact, normal, polar.sliding_speed(*touch))


def contact_law(impact, gap, gap_rate):
    """b_p m_p^0.4 D' D^2 + k_p D^3 |D| [N], (2.2) without its lower bound of zero.

    N is this where it is positive and D > 0; its fall through zero with D > 0 is the end of a
    contact.
    """
    viscous = impact.damping * impact.mass**0.4 * gap_rate
    return gap**2 * (viscous + impact.stiffness * gap * abs(gap))


def tip_deflection(impact, state):
    """Deflection of the tip from the rigid link's line [m]."""
    count = impact.link.frequency.size
    return float(impact.link.displacement[-1] @ state[:count])


def make_sample(impact, time, state, motion, **forces):
    """`Sample` of a PolarState `motion`; forces that are not given are zero, or nan."""
    cartesian = polar.cartesian_state_from_polar(motion)
    given = {
        "normal": 0.0,
        "friction": 0.0,
        "gap": float("nan"),
        "arc": float("nan"),
        "border_normal": 0.0,
        "wall_moment": 0.0,
        "corner_normals": (float("nan"), float("nan")),
        **forces,
    }
    return Sample(
        time, *(float(v) for v in cartesian), tip=tip_deflection(impact, state), **given
    )
