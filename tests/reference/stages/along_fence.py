"""Along the fence: the lower wall lies on it and turns with it, (2.27)-(2.30).

State vector in the layout `common.TIED`: the rotation is no unknown. (2.27) ties it to the fence's
tangent at the foot C of C_s, phi = q5(C), and its rates follow. With C at the arc coordinate
sigma(t), phi' = q5'|_sigma + kappa sigma', where kappa = dq5/dsigma and sigma' keeps C under C_s.
One force N acts at C, on the parcel along the fence's normal and so without a moment about C_s;
the contact law (2.2) acts on D = B/2 + y_p - (distance of C_s from the fence), (2.30), and the
friction F_2 along the wall. `common.Sample.wall_moment` is the moment I_p phi'' + F_2 (B/2 + y_p)
+ T that the tie has to supply for the parcel to turn so: the two ends of a wall on a fence supply
it by pressing unequally, which this stage does not ask of them.
"""

from typing import NamedTuple

import numpy as np

from .. import polar
from ..impact import Fence, contact_force
from .common import (
    TIED,
    Foot,
    belt_friction,
    contact_law,
    corner_friction,
    foot,
    make_sample,
    on_fence,
    parcel_of,
    state_rate,
)

NAME = "along the fence"


class Wall(NamedTuple):
    """The wall on the fence at one instant.

    motion: polar.PolarState, its phi and phi' those of the tie. found: Foot of C_s, q5_dot in its
    point that of the foot as it follows C_s. moved: polar.AlongFence under the `forces`,
    polar.FenceForces.
    """

    motion: polar.PolarState
    found: Foot
    moved: polar.AlongFence
    forces: polar.FenceForces


def tie(impact, time, state):
    """(Fence, polar.PolarState with phi and phi' of (2.27), Foot of C_s).

    (C_s - U).t = 0 for all time gives sigma' (U_sigma.t - kappa h) = (v_Cs - v_U).t + q5'|_sigma h,
    h = (C_s - U).n the distance of C_s from the fence.
    """
    fence = Fence(impact, time, state)
    r, alpha, r_dot, alpha_dot = state[-len(TIED) :].tolist()
    cos_a, sin_a = np.cos(alpha), np.sin(alpha)
    x, y = r * cos_a, r * sin_a
    found = foot(impact, fence, x, y)
    point = found.point
    cosine, sine = np.cos(point.q5), np.sin(point.q5)
    height = (y - point.y) * cosine - (x - point.x) * sine
    passing_x = r_dot * cos_a - r * alpha_dot * sin_a - point.x_dot
    passing_y = r_dot * sin_a + r * alpha_dot * cos_a - point.y_dot
    ahead = passing_x * cosine + passing_y * sine + point.q5_dot * height
    stretch = found.advance[0] * cosine + found.advance[1] * sine - found.curvature * height
    q5_dot = float(point.q5_dot + found.curvature * ahead / stretch)
    found = found._replace(point=point._replace(q5_dot=q5_dot))
    motion = polar.PolarState(r, alpha, point.q5, r_dot, alpha_dot, q5_dot)
    return fence, motion, found


def wall(impact, motion, found, q5_ddot=0.0):
    """`Wall` with the forces of contact law and friction.

    motion, found: from `tie`. q5_ddot: phi'' [rad/s^2], which only the wall's moment asks for.
    """
    parcel = parcel_of(impact)
    still = polar.FenceForces(0.0, 0.0, 0.0, 0.0, 0.0)
    free = polar.along_fence(motion, found.point, parcel, still, q5_ddot)
    normal = 0.0
    if on_fence(impact, found):
        normal = contact_force(impact, free.gap, free.gap_rate)
    friction = corner_friction(impact, normal, free.sliding_speed)
    acting = polar.FenceForces(normal, friction, *belt_friction(impact, motion))
    moved = polar.along_fence(motion, found.point, parcel, acting, q5_ddot)
    return Wall(motion, found, moved, acting)


def derivative(impact, time, state):
    """Time derivative of the state vector."""
    fence, motion, found = tie(impact, time, state)
    _, _, moved, acting = wall(impact, motion, found)
    return state_rate(impact, fence, state, acting.normal * found.load, motion, moved, TIED)


def tied_acceleration(impact, time, state, step=1e-7):
    """phi'' of (2.27) [rad/s^2]: central difference of phi' along the motion, `step` in [s]."""
    rate = derivative(impact, time, state)
    _, ahead, _ = tie(impact, time + step, state + step * rate)
    _, behind, _ = tie(impact, time - step, state - step * rate)
    return (ahead.phi_dot - behind.phi_dot) / (2 * step)


def sample(impact, time, state):
    """`common.Sample` of the stage."""
    _, motion, found = tie(impact, time, state)
    _, _, moved, acting = wall(impact, motion, found, tied_acceleration(impact, time, state))
    return make_sample(
        impact,
        time,
        state,
        motion,
        normal=acting.normal,
        friction=acting.friction,
        gap=float(moved.gap),
        arc=found.arc,
        wall_moment=float(moved.wall_moment),
    )


def released(impact, time, state):
    """Contact law at C [N] without its bound: falls through zero where the wall leaves."""
    _, motion, found = tie(impact, time, state)
    moved = wall(impact, motion, found).moved
    return contact_law(impact, moved.gap, moved.gap_rate)


def over_tip(impact, time, state):
    """Distance of C from the tip along the fence [m]: falls through zero where C runs over it."""
    return impact.l_s + impact.l_p - tie(impact, time, state)[2].arc


released.direction = -1
over_tip.direction = -1
EVENTS = {"the wall leaves the fence": released, "the foot of C_s runs over the tip": over_tip}
