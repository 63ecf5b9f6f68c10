"""The thickness of the flexible link along its length, h(x) = h_1 g(x / l_p)."""

import abc
from typing import Any

from ...printing import Part


class AbstractTaper(Part):
    """A profile g of the thickness over the relative position x / l_p in [0, 1].

    Any fixed g is self-similar: the mass and stiffness matrices of the link scale with
    rho z h_1 l_p and E z h_1^3 / l_p^3, so one dimensionless eigen-solve, done before the program
    is traced, serves every design. A profile with parameters of its own (array leaves) puts the
    eigen-solve into the program, where it is differentiated.

    >>> class Wedge(fj.AbstractTaper):
    ...     def __call__(self, position, tip_distance):
    ...         return 0.3 + 0.7 * tip_distance
    >>> fence = fj.Fence(taper=Wedge())
    >>> fence.taper
    Wedge()
    """

    @abc.abstractmethod
    def __call__(self, position: Any, tip_distance: Any) -> Any:
        """g(x / l_p) [1] at `position` = x / l_p, of any shape.

        `tip_distance` = 1 - x / l_p is given beside it, free of cancellation. The array functions
        used are those that NumPy and JAX share.
        """

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions x / l_p [1] between root and tip, in order, at which g has a kink or a step:
        integrals of g are taken piece by piece. By default there are none."""
        return ()
