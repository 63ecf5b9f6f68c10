"""Free motion: the parcel on the belt alone, the fence ringing beside it.

State vector in the layout `common.FREE`. `common.Sample.normal` is what the contact law would give
at corners 1 and 2 if they were still in contact: zero says that the stage holds.
"""

from .. import polar
from ..impact import Fence
from .common import (
    STILL,
    at_fence,
    belt_friction,
    free_state,
    make_sample,
    parcel_of,
    state_rate,
)

NAME = "free motion"
EVENTS = {}


def derivative(impact, time, state):
    """Time derivative of the state vector."""
    fence = Fence(impact, time, state)
    motion = free_state(impact, state)
    acting = polar.FenceForces(0.0, 0.0, *belt_friction(impact, motion))
    moved = polar.oblique_impact(motion, STILL, parcel_of(impact), acting, 1)
    return state_rate(impact, fence, state, 0.0, motion, moved)


def sample(impact, time, state):
    """`common.Sample` of the stage."""
    fence = Fence(impact, time, state)
    motion = free_state(impact, state)
    normals = tuple(at_fence(impact, fence, motion, corner)[1] for corner in (1, 2))
    return make_sample(
        impact, time, state, motion, normal=sum(normals), corner_normals=normals
    )
