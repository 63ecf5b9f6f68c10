"""A plain strip."""

from .abstract import AbstractTaper


class Uniform(AbstractTaper):
    """g = 1: a plain strip.

    >>> fence = fj.Fence(taper=fj.Uniform(), thickness=0.03)
    >>> fence.taper
    Uniform()
    """

    def __call__(self, position, tip_distance):
        return tip_distance**0
