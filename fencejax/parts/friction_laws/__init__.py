"""Laws of dry friction, one a file: the coefficient between two surfaces as a function of the speed
at which they slide. `Belt`, `Border` and the scenes' `fence_friction` take one."""

from collections.abc import Mapping

from .abstract import (
    AbstractFriction as AbstractFriction,
    FrictionScales as FrictionScales,
)
from .coulomb import Friction as Friction
from .stribeck import Stribeck as Stribeck

FRICTIONS: Mapping[str, type[AbstractFriction]] = {"coulomb": Friction, "stribeck": Stribeck}
"""The laws by name."""
