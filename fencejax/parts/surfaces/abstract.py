"""What a still surface is."""

import abc
from typing import NamedTuple

import equinox as eqx
from jaxtyping import Array

from ...printing import Part
from ..friction_laws import AbstractFriction


class SurfacePoint(NamedTuple):
    """How a point lies to a surface.

    `gap` D [m] is its distance from the surface, positive where it has gone in; `place` [m] the
    coordinate of its foot along the surface; `normal` the unit vector (x, y) out of the surface
    there, so that the gradient of D is -`normal`; `beyond` [m] how far the foot lies beyond the end
    of the surface, at most 0 on it, or `None` where the surface does not end.
    """

    gap: Array
    place: Array
    normal: tuple[Array, Array]
    beyond: Array | None


class AbstractSurface(Part):
    """A still, undeformable surface that the parcel's corners touch.

    A surface is geometry, told by one function of a point, and the friction on it. Contact law,
    sliding speed and the end of a force beyond the surface's end are the model's. All its numbers
    are array fields, checked against the `bounds` of the class by `fencejax._check.fields`.
    """

    friction: eqx.AbstractVar[AbstractFriction | None]

    @abc.abstractmethod
    def at(self, x: Array, y: Array) -> SurfacePoint:
        """How the point (x, y) [m], in fixed axes, lies to the surface."""

    def line(self) -> tuple[tuple[Array, ...], tuple[Array, ...]] | None:
        """x and y [m] of points along it, for a picture; `None` for what need not be drawn."""
        return None
