"""The material of the fence."""

from typing import ClassVar

from jaxtyping import Array, ArrayLike

from .. import _check
from .._check import Bounds
from ..printing import Part


class Material(Part):
    """A linear elastic material with stiffness-proportional (Kelvin-Voigt) damping.

    The defaults are those of dry polyamide PA6 (data sheets).

    >>> fj.Material(youngs_modulus=2.6e9, density=1140, damping_ratio=0.04)
    Material(youngs_modulus=2.6 GPa, density=1140 kg/m^3, damping_ratio=0.04)
    """

    youngs_modulus: Array
    density: Array
    damping_ratio: Array
    fatigue_exponent: Array | None

    bounds: ClassVar[dict[str, Bounds]] = {
        "youngs_modulus": Bounds("Pa", above=0, size=3e9),
        "density": Bounds("kg/m^3", above=0, size=1e3),
        "damping_ratio": Bounds(least=0, size=0.05),
        "fatigue_exponent": Bounds(above=0, size=10.0),
    }

    def __init__(
        self,
        youngs_modulus: ArrayLike = 3.0e9,
        density: ArrayLike = 1130.0,
        damping_ratio: ArrayLike = 0.05,
        fatigue_exponent: ArrayLike | None = None,
    ):
        """**Arguments:**

        - `youngs_modulus`: E [Pa], above 0.
        - `density`: rho [kg/m^3], above 0.
        - `damping_ratio`: zeta [1] of the first bending mode, at least 0. The damping matrix is
          B = (2 zeta / omega_1) K, so that mode i has the ratio zeta omega_i / omega_1.
        - `fatigue_exponent`: m [1] of Basquin's line, N sigma_a^m = constant, above 0: how fast the
          life falls with the stress. No motion depends on it, the harm of a sort does (see
          `fencejax.design.fatigue`). `None`: not known.
        """
        _check.fields(
            self, youngs_modulus=youngs_modulus, density=density, damping_ratio=damping_ratio,
        )  # fmt: skip
        self.fatigue_exponent = None
        if fatigue_exponent is not None:
            self.fatigue_exponent = _check.field(self, "fatigue_exponent", fatigue_exponent)
