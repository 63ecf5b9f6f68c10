"""The state of a fence that has swung without contact."""

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..parts import AbstractDrive
from .flexible_link import FlexibleLink
from .propagation import Propagator
from .vibration import Vibration, blocks, flat, propagate

SWING_STEPS = 64


def swung(link: FlexibleLink, drive: AbstractDrive, step: Array, maps: Propagator) -> Vibration:
    """The state after `SWING_STEPS` steps of a fence that has swung free of contact from rest
    at t = 0; `maps` are those of all modes over one of them, (m,).

    Each step takes the linear acceleration that has the drive's own change of speed and of
    angle over it, so that the error is of the fourth order and jumps of the acceleration do
    no harm. Of a torque it takes both integrals by Simpson's rule, to the same order.
    """
    if not link.swing:
        return link.rest()
    swing = -flat(link.swing)
    if link.hinge is not None and link.hinge.driven:
        swing = link.hinge.driving

    def advance(carry, index):
        state, before = carry
        after = drive.motion((index + 1) * step)
        mean = (after.speed - before.speed) / step
        moment = (after.angle - before.angle - step * before.speed) / step**2
        if before.torque is not None and after.torque is not None:
            middle = drive.motion((index + 0.5) * step).torque
            assert middle is not None
            mean = (before.torque + 4 * middle + after.torque) / 6
            moment = (before.torque + 2 * middle) / 6
        start, end = 6 * moment - 2 * mean, 4 * mean - 6 * moment
        forces = (swing * start,), (swing * end,)
        if link.hinge is not None:
            (coupling,) = link.hinge.coupling(state.rate)
            forces = (forces[0][0] + coupling,), forces[1]
        state = propagate((maps,), state, *forces)
        if link.hinge is not None:
            state = link.hinge.coupled((maps,), state)
        return (state, after), None

    zero = (jnp.zeros_like(link.eigenvalues),)
    indices = jnp.arange(SWING_STEPS, dtype=step.dtype)
    begin = (Vibration(zero, zero), drive.motion(jnp.zeros_like(step)))
    (state, _), _ = jax.lax.scan(advance, begin, indices)
    return Vibration(blocks(state.amplitude[0]), blocks(state.rate[0]))
