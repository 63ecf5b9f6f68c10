"""Coefficients of dry friction between two surfaces."""

from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, ArrayLike

from .. import _check
from .._check import Bounds


class Friction(eqx.Module):
    """Coefficients of a pair of surfaces, kinetic and static."""

    kinetic: Array
    static: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "kinetic": Bounds(least=0, size=1.0),
        "static": Bounds(least=0, size=1.0),
    }

    def __init__(self, kinetic: ArrayLike, static: ArrayLike):
        """**Arguments:** `kinetic`: mu_k [1], at least 0. `static`: mu_s [1], at least 0."""
        self.kinetic = _check.field(self, "kinetic", kinetic)
        self.static = _check.field(self, "static", static)
