"""Tapers, one a file: the thickness h(x) = h_1 g(x / l_p) along the flexible link."""

from collections.abc import Mapping

from .abstract import AbstractTaper as AbstractTaper
from .constant_strength import ConstantStrength as ConstantStrength
from .power import PowerTaper as PowerTaper
from .profile import ProfileTaper as ProfileTaper
from .stepped import SteppedTaper as SteppedTaper
from .uniform import Uniform as Uniform

TAPERS: Mapping[str, type[AbstractTaper]] = {
    "constant_strength": ConstantStrength,
    "uniform": Uniform,
    "power": PowerTaper,
    "profile": ProfileTaper,
}
"""The tapers by name. `SteppedTaper`, which is made of another one, has none."""
