"""A link whose sections all carry the same stress under a force at the tip."""

from .abstract import AbstractTaper


class ConstantStrength(AbstractTaper):
    """g = sqrt(1 - x / l_p): under a force at the tip every section carries the same bending
    stress. The thickness at the tip is zero.

    Paper: (2.1).

    >>> fj.ConstantStrength()(0.75, 0.25)
    0.5
    """

    def __call__(self, position, tip_distance):
        return tip_distance**0.5
