"""The fence's residual oscillation at the end of a sort."""

import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Fidelity
from ..model import FlexibleLink
from ..parts import AbstractDrive, Fence
from .objectives import RING_ENERGY, Quantity


def ring_amplitude(energy: Array, fence: Fence, drive: AbstractDrive | None = None) -> Array:
    """The tip's amplitude [m] if the first mode had all of an energy [J]: with
    m_0 omega_1^2 eta^2 / 2 = E, a = phi_1(tip) eta. Higher modes move the tip less.

    For a fence on a torque `drive` the first mode is its rotation on the drive's spring; without a
    spring there is no restoring torque, and the amplitude is unbounded.
    """
    link = FlexibleLink(fence, Fidelity(modes=1, static_correction=False), drive)
    square, *others = link.frequency_squared
    alone = (jnp.ones_like(square), *(jnp.zeros_like(other) for other in others))
    tip = link.tip_deflection(alone, (), ())
    if link.hinge is not None:
        tip = tip + link.reach * link.hinge.turn[0]
    # 1e-18 J is negligible and makes the root differentiable at 0.
    eta = jnp.sqrt(2 * (jnp.maximum(energy, 0.0) + 1e-18) / (link.mass_scale * square))
    return jnp.abs(tip) * eta


RING_AMPLITUDE = Quantity(
    "ring_amplitude",
    "m",
    "amplitude of the tip at the end, all that the fence then holds taken for its first mode",
    lambda result, scene: ring_amplitude(
        RING_ENERGY(result, scene), scene.fence, getattr(scene, "drive", None)
    ),
    needs=("fence",),
    fields=RING_ENERGY.fields,
)
"""Ring-down as a quantity, meant for a scene that ends when the next parcel arrives."""
