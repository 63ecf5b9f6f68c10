"""A thickness that goes with a power of the distance from the tip."""

from typing import ClassVar

from jaxtyping import Array, ArrayLike

from ... import _check
from ..._check import Bounds
from .abstract import AbstractTaper


class PowerTaper(AbstractTaper):
    """g = (1 - x / l_p)^p with a traced exponent p [1], 0 <= p < 1.

    Above p = 1 the tip is so slender that its curvature is no longer square integrable.

    >>> fence = fj.Fence(taper=fj.PowerTaper(0.3))
    >>> fence.taper
    PowerTaper(exponent=0.3)
    """

    exponent: Array

    bounds: ClassVar[dict[str, Bounds]] = {"exponent": Bounds(least=0, most=0.99)}

    def __init__(self, exponent: ArrayLike):
        """**Arguments:** `exponent`: p [1], at least 0 and at most 0.99.

        Raises `ValueError` where it is out of these bounds.
        """
        self.exponent = _check.field(self, "exponent", exponent)

    def __call__(self, position, tip_distance):
        return tip_distance**self.exponent
