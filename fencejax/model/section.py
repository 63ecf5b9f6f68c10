"""The flexible link's cross-section at one place: its thickness and its compliance in shear."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from ..parts import Fence
from .mode_shapes import entry

# Least square [1] of the relative thickness: a tip of no thickness counts as 3 % of the root's. A
# link of constant strength is thinner than that over the last thousandth of its length alone.
_LEAST = 1e-3


class SectionTable(eqx.Module):
    """Over the elements (n,): the squares of the relative thickness g at their first and second
    nodes, and the integral of 1 / g dx / l_p up to their first. Inside an element g^2 is taken to
    be straight, which it is in a link of constant strength and in a uniform one."""

    first: Array
    second: Array
    integral: Array
    thickness: Array
    rigid_length: Array
    length: Array
    shear: Array | None

    def __init__(self, fence: Fence, relative_thickness: Any):
        """`relative_thickness` (n,) is g at the nodes but the tip's."""
        elements = relative_thickness.shape[0]
        precision = fence.thickness.dtype
        tip = jnp.asarray(fence.taper(1.0, 0.0), dtype=precision)
        g = jnp.concatenate([jnp.asarray(relative_thickness, dtype=precision), tip[None]])
        self.first, self.second = g[:-1] ** 2, g[1:] ** 2
        parts = 2 / (elements * (g[:-1] + g[1:]))
        self.integral = jnp.concatenate([jnp.zeros_like(parts[:1]), jnp.cumsum(parts)[:-1]])
        self.thickness, self.length = fence.thickness, fence.flexible_length
        self.rigid_length = fence.rigid_length
        self.shear = None
        if fence.shear is not None:
            modulus = fence.shear.modulus(fence.material.youngs_modulus)
            self.shear = 1 / (modulus * fence.width * fence.thickness)

    def _square(self, index: Array, s: Array) -> Array:
        a, b = entry(self.first, index), entry(self.second, index)
        return jnp.maximum(a + s * (b - a), _LEAST)

    def half_thickness(self, index: Array, s: Array) -> tuple[Array, Array]:
        """h / 2 [m] at the nodes, (n + 1,), and in element `index` at its local coordinate s."""
        squares = jnp.concatenate([self.first, self.second[-1:]])
        half = 0.5 * self.thickness
        nodes = half * jnp.sqrt(jnp.maximum(squares, _LEAST))
        return nodes, half * jnp.sqrt(self._square(index, s))

    def shear_compliance(self, place: Array, index: Array, s: Array) -> tuple[Array, Array] | None:
        """c [m/N] at the arc coordinate `place` [m] in the element `index` at its local coordinate
        s, and dc / dsigma [1/N]; `None` for a link that does not yield in shear."""
        if self.shear is None:
            return None
        g = jnp.sqrt(self._square(index, s))
        elements = self.first.shape[0]
        inside = 2 * s / (elements * (jnp.sqrt(entry(self.first, index)) + g))
        slope = jnp.where(place > self.rigid_length, self.shear / g, 0.0)
        return self.shear * self.length * (entry(self.integral, index) + inside), slope
