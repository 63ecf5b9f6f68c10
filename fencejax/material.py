"""The material of the fence."""

import equinox as eqx
from jaxtyping import Array, ArrayLike

from . import _check


class Material(eqx.Module):
    """A linear elastic material with stiffness-proportional (Kelvin-Voigt) damping.

    The defaults are those of dry polyamide PA6 (data sheets).
    """

    youngs_modulus: Array
    density: Array
    damping_ratio: Array

    def __init__(
        self,
        youngs_modulus: ArrayLike = 3.0e9,
        density: ArrayLike = 1130.0,
        damping_ratio: ArrayLike = 0.05,
    ):
        """**Arguments:**

        - `youngs_modulus`: E [Pa], above 0.
        - `density`: rho [kg/m^3], above 0.
        - `damping_ratio`: zeta [1] of the first bending mode, at least 0. The damping matrix is
          B = (2 zeta / omega_1) K, so that mode i has the ratio zeta omega_i / omega_1.
        """
        self.youngs_modulus = _check.scalar("youngs_modulus", youngs_modulus, above=0, unit="Pa")
        self.density = _check.scalar("density", density, above=0, unit="kg/m^3")
        self.damping_ratio = _check.scalar("damping_ratio", damping_ratio, least=0)
