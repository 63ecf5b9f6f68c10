"""Flexible links of one fence, and states in which they vibrate."""

import jax
import jax.numpy as jnp
import numpy as np

from fencejax import Fence, Fidelity, Material
from fencejax.model import FlexibleLink, Vibration

EPS = np.finfo(float).eps
ELEMENTS = 20
FENCE = Fence(
    rigid_length=0.3, flexible_length=0.8, width=0.12, thickness=0.05,
    material=Material(youngs_modulus=2.2e9, density=980.0, damping_ratio=0.07),
)
LENGTH, RIGID = 0.8, 0.3
ROOT_STIFFNESS = 2.2e9 * 0.12 * 0.05**3 / 12  # E I_1


def make(modes=3, fence=FENCE, **changes):
    return FlexibleLink(fence, Fidelity(modes=modes, elements=ELEMENTS, **changes))


shape_at = jax.jit(lambda link, place: link.shape(place))


def static_amplitude(link, place, load):
    """eta_i = phi_i(sigma) P / (m_0 omega_i^2)."""
    shape = shape_at(link, place)
    return tuple(
        phi * load / (link.mass_scale * value)
        for phi, value in zip(shape.load, link.frequency_squared, strict=True)
    ), shape


def vibration(link, scale=1.0, seed=3):
    """A state with random amplitudes and rates that fall off with the frequency."""
    rng = np.random.default_rng(seed)
    parts = []
    for size in (0.02, 1.0):
        parts.append(
            tuple(
                scale * size * rng.uniform(0.5, 1, np.shape(value))
                * jnp.sqrt(link.eigenvalues[0] / value)
                for value in link.frequency_squared
            )
        )
    return Vibration(*parts)
