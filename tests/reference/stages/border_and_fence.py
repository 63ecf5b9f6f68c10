"""Border and fence: corner 1 on the fence, corner 2 on the border, and the belt, (2.31)-(2.34).

State vector in the layout `common.FREE`. The contact law (2.2) acts on the gap (2.13) of corner 1
and on the gap -y_C (2.34) of corner 2; the fence does not act on corner 2. The wall comes to lie
on the fence where it has turned parallel to the tangent at the foot C of C_s, `flush`, or, on a
parcel that is not pressed in, at the same moment where corner 2 gets to the hinge, `past_hinge`.
"""

from .. import polar
from ..impact import Fence
from .common import (
    at_border,
    at_fence,
    belt_friction,
    center,
    foot,
    free_state,
    make_sample,
    parcel_of,
    state_rate,
)

NAME = "border and fence"
FENCE_CORNER, BORDER_CORNER = 1, 2


def forces(impact, fence, motion):
    """(Foot of corner 1, polar.BorderForces) of a PolarState `motion`."""
    found, *pair = at_fence(impact, fence, motion, FENCE_CORNER)
    border = at_border(impact, motion, BORDER_CORNER)
    return found, polar.BorderForces(*pair, *belt_friction(impact, motion), *border)


def derivative(impact, time, state):
    """Time derivative of the state vector."""
    fence = Fence(impact, time, state)
    motion = free_state(impact, state)
    found, acting = forces(impact, fence, motion)
    moved = polar.border_and_fence(
        motion, found.point, parcel_of(impact), acting, FENCE_CORNER, BORDER_CORNER
    )
    return state_rate(impact, fence, state, acting.normal * found.load, motion, moved)


def sample(impact, time, state):
    """`common.Sample` of the stage."""
    motion = free_state(impact, state)
    found, acting = forces(impact, Fence(impact, time, state), motion)
    return make_sample(
        impact,
        time,
        state,
        motion,
        normal=acting.normal,
        friction=acting.friction,
        gap=float(polar.gap(motion, found.point, parcel_of(impact), FENCE_CORNER)),
        arc=found.arc,
        border_normal=acting.border_normal,
        corner_normals=(acting.normal, 0.0),
    )


def flush(impact, time, state):
    """phi - q5(C) [rad], C the foot of C_s: rises through zero where the wall lies parallel."""
    motion = free_state(impact, state)
    found = foot(impact, Fence(impact, time, state), *center(motion))
    return motion.phi - found.point.q5


def past_hinge(impact, time, state):
    """Arc coordinate of the foot of corner 2 [m]: rises through zero where it leaves the border
    for the fence."""
    found, _, _ = at_fence(impact, Fence(impact, time, state), free_state(impact, state), 2)
    return found.arc


flush.direction = 1
past_hinge.direction = 1
FLUSH, PAST_HINGE = "the wall lies parallel to the fence", "corner 2 passes the hinge"
EVENTS = {FLUSH: flush, PAST_HINGE: past_hinge}
