"""The contact law of Hunt and Crossley."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ... import _check
from ..._check import Bounds
from .abstract import AbstractContactLaw, NormalForce


class HuntCrossley(AbstractContactLaw):
    """N = k D_r (D / D_r)^n max(0, 1 + (3/2) a Ddot) for D > 0, else 0.

    k [N/m] is the secant stiffness at the reference depth D_r: N = k D_r at rest at D = D_r. With
    D_r = 1 m its number is that of the usual coefficient in N/m^n. The viscous part goes with the
    elastic one, so that the force begins and ends at zero and its loop has no jump.

    A mass that meets a rigid wall at the speed v leaves it at e v, where

        c v (1 + e) = ln((1 + c v) / (1 - c v e)),  c = (3/2) a,

    whatever the mass, k and n; for small a v that is e = 1 - a v. The law is continuously
    differentiable at D = 0 for n > 1.

    K. H. Hunt and F. R. E. Crossley, Coefficient of restitution interpreted as damping in
    vibroimpact, J. Appl. Mech. 42 (1975) 440-445.

    >>> law = fj.contact_laws.HuntCrossley(6.065e5, 0.4947)
    >>> f"{law.wall_force(2.426, mass=15.0):.0f} N", fj.Parcel(contact=law).contact is law
    ('3294 N', True)
    """

    secant_stiffness: Array
    dissipation: Array
    exponent: Array
    reference_depth: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "secant_stiffness": Bounds("N/m", least=0, size=1e6),
        "dissipation": Bounds("s/m", least=0, size=1.0),
        "exponent": Bounds(least=1, size=1.0),
        "reference_depth": Bounds("m", above=0, size=1.0),
    }

    def __init__(
        self,
        secant_stiffness: ArrayLike,
        dissipation: ArrayLike,
        exponent: ArrayLike = 1.5,
        reference_depth: ArrayLike = 1.0,
    ):
        """**Arguments:**

        - `secant_stiffness`: k [N/m], at least 0.
        - `dissipation`: a [s/m], at least 0.
        - `exponent`: n [1], at least 1; 1.5 for a smooth rounded corner on a plane (Hertz).
        - `reference_depth`: D_r [m], above 0.

        `HuntCrossley(6.065e5, 0.4947)` meets a rigid wall at 2.426 m/s with 15 kg as the paper's
        parcel does: with a peak of 3294 N and a restitution of 0.439.
        """
        _check.fields(
            self, secant_stiffness=secant_stiffness, dissipation=dissipation, exponent=exponent,
            reference_depth=reference_depth,
        )  # fmt: skip

    def viscosity(self, mass):
        """c = (3/2) a [s/m]; the law does not depend on the mass."""
        return 1.5 * self.dissipation + 0.0 * mass

    def _elastic(self, gap: Array, more: float) -> Array:
        """(D / D_r)^(n + more) [1], 0 for D <= 0. A power of a number that is not positive has no
        derivative in n, also where it is not used: the depth is D_r there."""
        inside = gap > 0
        ratio = jnp.where(inside, gap / self.reference_depth, 1.0)
        return jnp.where(inside, ratio ** (self.exponent + more), 0.0)

    def force(self, gap, gap_rate, viscosity):
        elastic = self.secant_stiffness * self.reference_depth * self._elastic(gap, 0.0)
        growth = jnp.maximum(1 + viscosity * gap_rate, 0.0)
        slope = self.secant_stiffness * self.exponent * self._elastic(gap, -1.0)
        return NormalForce(
            force=elastic * growth,
            by_gap=slope * growth,
            by_rate=jnp.where(growth > 0, elastic * viscosity, 0.0),
        )

    def stored_energy(self, gap):
        """k D_r^2 (D / D_r)^(n + 1) / (n + 1) [J]."""
        scale = self.secant_stiffness * self.reference_depth**2 / (self.exponent + 1)
        return scale * self._elastic(gap, 1.0)
