"""Shear of the flexible link, in addition to its bending."""

from typing import ClassVar

from jaxtyping import Array, ArrayLike

from .. import _check
from .._check import Bounds
from ..printing import Part


class Shear(Part):
    """The flexible link deforms in shear as well as in bending: a force N at the arc coordinate
    sigma moves its own place by

        c N,  c = integral from l_s to sigma of 1 / (k G z h) dx,  G = E / (2 (1 + nu)),

    with the material's lag, and the tip by as much. The shear under each corner is that by its own
    force; the modes, and with them the inertia, are those of bending alone. For large k the shear
    vanishes.

    G. R. Cowper, The shear coefficient in Timoshenko's beam theory, J. Appl. Mech. 33 (1966)
    335-340: k = 10 (1 + nu) / (12 + 11 nu) of a rectangle, 0.85 at nu = 0.4; E. Reissner's is 5/6.

    >>> fence = fj.Fence(shear=fj.Shear(poissons_ratio=0.35))
    >>> fence.shear
    Shear(poissons_ratio=0.35, coefficient=0.8333)
    """

    poissons_ratio: Array
    coefficient: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "poissons_ratio": Bounds(above=-1, most=0.5),
        "coefficient": Bounds(above=0, size=1.0),
    }

    def __init__(self, poissons_ratio: ArrayLike = 0.4, coefficient: ArrayLike = 5 / 6):
        """**Arguments:**

        - `poissons_ratio`: nu [1], above -1 and at most 0.5; that of polyamide, 0.4, by default.
        - `coefficient`: k [1], above 0, the share of the section that carries the shear evenly.
        """
        _check.fields(self, poissons_ratio=poissons_ratio, coefficient=coefficient)

    def modulus(self, youngs_modulus: Array) -> Array:
        """k G [Pa], by E [Pa]."""
        return self.coefficient * youngs_modulus / (2 * (1 + self.poissons_ratio))
