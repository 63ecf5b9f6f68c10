"""The line of a flexible link that is curved without load."""

from typing import ClassVar, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from .. import _check
from .._check import Bounds
from ..printing import Part


class RestLine(NamedTuple):
    """A rest shape at one place: w_0 [m], its slope w_0' [rad], and the displacements of the point
    towards the hinge [m] and down [m], the integrals of w_0'^2 / 2 and of w_0'^3 / 6."""

    deflection: Array
    slope: Array
    short: Array
    lower: Array


class RestShape(Part):
    """A flexible link made with a curve: a cubic Bézier line over its length l_p,

        w_0(s) = 3 d_2 s^2 (1 - s) + d_3 s^3,  s = x / l_p,

    with the control points (0, 0), (l_p / 3, 0), (2 l_p / 3, d_2) and (l_p, d_3): it goes on
    straight from the rigid link. d_2 = d_3 / 3 is a parabola. Above 0 it is curved towards the
    parcels.

    The deflection from the rigid link's straight line is w_0 + w, w that of the bending: positions,
    slopes and the corners' feet are those of the curved line. The modes of w, its stress and the
    tip's deflection, which counts from the rest shape, are those of a straight link: slopes are
    small, and the link is thin against the radius of its curve. With d_2 = d_3 = 0 it is straight.

    G. Farin, Curves and Surfaces for CAGD, 5th ed., Morgan Kaufmann 2002, section 5.1 (Bézier
    curves). There as a curve in a parameter; here the abscissae are evenly spaced, so that x is
    l_p s.

    >>> shape = fj.RestShape(tip=0.06, middle=0.02)
    >>> fence = fj.Fence(rest_shape=shape)
    >>> fence.rest_shape, f"{shape.at(1.0, fence.flexible_length).slope:.2f} rad"
    (RestShape(tip=60 mm, middle=20 mm), '0.16 rad')
    """

    tip: Array
    middle: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "tip": Bounds("m", size=0.1),
        "middle": Bounds("m", size=0.1),
    }

    steepest: ClassVar[float] = 0.5
    """Largest value of |3 d_2| / l_p and 3 |d_3 - d_2| / l_p, which bound all slopes [rad]: then
    the arc geometry, of the third order in the slope, is within l_p / 1900 of a parabola."""

    def __init__(self, tip: ArrayLike = 0.0, middle: ArrayLike = 0.0):
        """**Arguments:**

        - `tip`: d_3 [m], the distance of the tip from the rigid link's line.
        - `middle`: d_2 [m], the control point at two thirds of the link.

        A `fencejax.Fence` raises `ValueError` where the slope would be above 0.5.
        """
        _check.fields(self, tip=tip, middle=middle)

    def steepness(self, length: ArrayLike) -> Array:
        """The larger of |3 d_2| / l_p and 3 |d_3 - d_2| / l_p [rad], at least the largest slope of
        a link of the `length` l_p [m]."""
        ends = jnp.maximum(jnp.abs(self.middle), jnp.abs(self.tip - self.middle))
        return 3 * ends / length

    def at(self, share: ArrayLike, length: ArrayLike) -> RestLine:
        """The line at the `share` s [1] of a link of the `length` l_p [m]; straight beyond the
        tip."""
        s = jnp.clip(share, 0.0, 1.0)
        a, b = 3 * self.middle, self.tip - 3 * self.middle
        slope = s * (2 * a + 3 * b * s) / length
        # Of w_0' = (2 a s + 3 b s^2) / l_p.
        square = 4 * a**2 / 3 + s * (3 * a * b + s * (9 * b**2 / 5))
        cube = 2 * a**3 + s * (36 * a**2 * b / 5 + s * (9 * a * b**2 + s * (27 * b**3 / 7)))
        return RestLine(
            s**2 * (a + b * s) + (share - s) * length * slope,
            slope,
            0.5 * s**3 * square / length,
            s**4 * cube / (6 * length**2),
        )
