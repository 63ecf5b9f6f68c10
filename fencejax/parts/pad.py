"""An elastic cover of the fence."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from .. import _check
from .._check import Bounds
from ..printing import Part


class Pad(Part):
    """A massless elastic cover on the fence, in series with the contact law of the parcel's corner.

    A corner presses a strip of the length a along the fence and of the fence's width z. The layer
    of the thickness H under it has tangent elasticity, and recovers as a Kelvin-Voigt solid:

        N = (2 F_0 / pi) tan((pi / 2) (e + tau edot)),  F_0 = E a z,

    e [1] its compression over H. So N = E a z e where e is small, and no force closes the layer (e
    < 1). The corner itself is compressed by D - H e, the rest of the gap D, under the same N. H = 0
    is a fence without a cover.

    Each corner presses a strip of its own, which moves along as the corner slides: a compression
    that is left remains until the same corner's next touch. The cover's free surface is the fence's
    line; friction on it is that of the fence; the parcel's other contacts do not involve it.

    R. D. Mindlin, Dynamics of package cushioning, Bell System Tech. J. 24 (1945) 353-461, section
    1.5 (tangent elasticity). There the force over the displacement of a cushion.

    >>> pad = fj.Pad(thickness=0.01, modulus=5e5)
    >>> fence = fj.Fence(pad=pad)
    >>> fence.pad
    Pad(thickness=10 mm, modulus=0.5 MPa, contact_length=50 mm, retardation_time=2 ms)
    """

    thickness: Array
    modulus: Array
    contact_length: Array
    retardation_time: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "thickness": Bounds("m", least=0, size=0.01),
        "modulus": Bounds("Pa", above=0, size=1e6),
        "contact_length": Bounds("m", above=0, size=0.05),
        "retardation_time": Bounds("s", least=0, size=1e-3),
    }

    def __init__(
        self,
        thickness: ArrayLike = 0.01,
        modulus: ArrayLike = 1.9e5,
        contact_length: ArrayLike = 0.05,
        retardation_time: ArrayLike = 2e-3,
    ):
        """**Arguments:**

        - `thickness`: H [m], at least 0.
        - `modulus`: E [Pa] of the cover in compression, above 0. Of cellular rubber of grade 2 of
          ASTM D1056, which takes 35 to 63 kPa at 25 % of compression, it is 1.9e5, by default.
        - `contact_length`: a [m] of the strip that a corner presses, along the fence, above 0.
        - `retardation_time`: tau [s], at least 0: at the angular frequency omega its loss factor is
          omega tau, so 2e-3 gives 0.13 in a blow of 50 ms.
        """
        _check.fields(
            self, thickness=thickness, modulus=modulus, contact_length=contact_length,
            retardation_time=retardation_time,
        )  # fmt: skip

    def force_scale(self, width: Array) -> Array:
        """F_0 = E a z [N] of a fence of the `width` z [m]."""
        return self.modulus * self.contact_length * width

    def strain(self, force: Array, scale: Array) -> Array:
        """e [1] at rest under a `force` [N], of the force scale F_0 [N]: (2 / pi) atan(pi N / (2
        F_0))."""
        return 2 / jnp.pi * jnp.arctan(0.5 * jnp.pi * force / scale)

    def strain_slope(self, force: Array, scale: Array) -> Array:
        """de / dN [1/N] of `strain`."""
        return 1 / (scale * (1 + (0.5 * jnp.pi * force / scale) ** 2))

    def stored_energy(self, strain: Array, scale: Array) -> Array:
        """H times the integral of N over e [J]: -(4 F_0 H / pi^2) ln cos(pi e / 2)."""
        energy = -4 / jnp.pi**2 * scale * self.thickness
        return energy * jnp.log(jnp.cos(0.5 * jnp.pi * strain))
