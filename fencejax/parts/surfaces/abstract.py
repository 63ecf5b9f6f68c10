"""The interface of a still surface."""

import abc
from typing import NamedTuple

import equinox as eqx
from jaxtyping import Array

from ...printing import Part
from ..friction_laws import AbstractFriction


class SurfacePoint(NamedTuple):
    """The position of a point relative to a surface.

    `gap` D [m] is its depth below the surface, negative outside; `place` [m] the coordinate of its
    foot along the surface; `normal` the unit vector (x, y) out of the surface there, so that the
    gradient of D is -`normal`; `beyond` [m] the distance of the foot beyond the end of the surface,
    at most 0 on it, or `None` where the surface does not end.

    >>> point = fj.Border().at(jnp.array(0.3), jnp.array(-0.01))
    >>> f"gap {point.gap:.3f} m at {point.place:.1f} m"
    'gap 0.010 m at 0.3 m'
    """

    gap: Array
    place: Array
    normal: tuple[Array, Array]
    beyond: Array | None


class AbstractSurface(Part):
    """A still, undeformable surface that the parcel's corners touch.

    A surface consists of its geometry, given by one function of a point, and its friction. Contact
    law, sliding speed and the end of a force beyond the surface's end belong to the model. All its
    numbers are array fields, checked against the `bounds` of the class by `fencejax._check.fields`.

    >>> (x, _), (y, _) = fj.surfaces.Deflector(angle=0.5, hinge_y=0.1).line()
    >>> f"({x:.1f}, {y:.1f})"
    '(0.0, 0.1)'
    """

    friction: eqx.AbstractVar[AbstractFriction | None]

    @abc.abstractmethod
    def at(self, x: Array, y: Array) -> SurfacePoint:
        """The position of the point (x, y) [m], in fixed axes, relative to the surface."""

    def line(self) -> tuple[tuple[Array, ...], tuple[Array, ...]] | None:
        """x and y [m] of points along it, for a picture; `None` for a surface that is not drawn."""
        return None
