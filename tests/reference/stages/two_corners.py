"""The lower wall on the fence with its rotation left free, and on the border where it reaches it.

No stage of the paper. Corners 1 and 2 each carry a force of the fence, corner 2 one of the border
too, and the rotation follows from their moments, so that neither a tie nor a switch is needed. It
differs from `border_and_fence` and `along_fence` by what (2.27) and the switch put in place of
that, and by nothing else: the difference is their effect. State vector in the layout
`common.FREE`. The stage ends where corner 1 runs over the tip.
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

NAME = "two corners"


def forces(impact, time, state):
    """(Fence, PolarState, {corner: (Foot, N, F_2)}, (N_2, F) of the border) at a state."""
    fence = Fence(impact, time, state)
    motion = free_state(impact, state)
    corners = {corner: at_fence(impact, fence, motion, corner) for corner in (1, 2)}
    return fence, motion, corners, at_border(impact, motion, 2)


def derivative(impact, time, state):
    """Time derivative of the state vector."""
    fence, motion, corners, border = forces(impact, time, state)
    parcel = parcel_of(impact)
    first, *pair = corners[1]
    second, *other = corners[2]
    belt = belt_friction(impact, motion)
    # (2.31), (2.32) add up over the forces: those of corner 2 on the fence beside the belt's.
    beside = motion, second.point.q5, *other
    acting = polar.BorderForces(
        *pair,
        belt.belt_r + polar.fence_radial_force(*beside),
        belt.belt_alpha + polar.fence_circumferential_force(*beside),
        belt.belt_torque - polar.fence_moment(*beside, parcel, 2),
        *border,
    )
    moved = polar.border_and_fence(motion, first.point, parcel, acting, 1, 2)
    load = sum(normal * found.load for found, normal, _ in corners.values())
    return state_rate(impact, fence, state, load, motion, moved)


def sample(impact, time, state):
    """`common.Sample`: gap is the mean of the corners' gaps, arc that of the foot of C_s."""
    fence, motion, corners, border = forces(impact, time, state)
    gaps = [
        float(polar.gap(motion, found.point, parcel_of(impact), corner))
        for corner, (found, _, _) in corners.items()
    ]
    normals = tuple(normal for _, normal, _ in corners.values())
    return make_sample(
        impact,
        time,
        state,
        motion,
        normal=sum(normals),
        friction=sum(friction for _, _, friction in corners.values()),
        gap=0.5 * sum(gaps),
        arc=foot(impact, fence, *center(motion)).arc,
        border_normal=border[0],
        corner_normals=normals,
    )


def over_tip(impact, time, state):
    """Distance of corner 1 from the tip along the fence [m]: falls through zero there."""
    found, _, _ = at_fence(impact, Fence(impact, time, state), free_state(impact, state), 1)
    return impact.l_s + impact.l_p - found.arc


over_tip.direction = -1
EVENTS = {"corner 1 runs over the tip": over_tip}
