"""Laws of dry friction, one a file: the coefficient between two surfaces as a function of the speed
at which they slide. `Belt`, `Border` and the scenes' `fence_friction` take one.

>>> fj.Belt(friction=fj.friction_laws.Stribeck(0.65, 0.85, stribeck_speed=0.05)).friction
Stribeck(kinetic=0.65, static=0.85, stribeck_speed=0.05 m/s, viscous=0 s/m)
"""

from collections.abc import Mapping

from .abstract import (
    AbstractFriction as AbstractFriction,
    FrictionScales as FrictionScales,
)
from .coulomb import (
    Friction as Friction,
    friction_of as friction_of,
    on_cover as on_cover,
)
from .stribeck import Stribeck as Stribeck

FRICTIONS: Mapping[str, type[AbstractFriction]] = {"coulomb": Friction, "stribeck": Stribeck}
"""The laws by name."""
