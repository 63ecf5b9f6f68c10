"""A rigid passive deflector."""

from typing import ClassVar, Literal

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ... import _check
from ..._check import Bounds
from ..friction_laws import AbstractFriction, friction_of
from .abstract import AbstractSurface, SurfacePoint


class Deflector(AbstractSurface):
    """A rigid straight wall across the belt that stands still: it begins at the hinge point O and
    goes on for its length L at the angle a from x, t = (cos a, sin a).

    A point C is inside by D = -(C - O).n, n = (-sin a, cos a), at the place (C - O).t along the
    wall. The wall has one side, the one that n points to, where the parcel comes from: what is
    behind its line, between its ends, is inside it. The corners of the parcel touch it; its free
    end does not touch the parcel's sides.

    >>> fj.surfaces.Deflector(angle=0.6, length=1.0)
    Deflector(
      angle=0.6 rad,
      length=1 m,
      hinge_x=0 m,
      hinge_y=0 m,
      friction=Friction(kinetic=0.35, static=0.5),
    )
    """

    angle: Array
    length: Array
    hinge_x: Array
    hinge_y: Array
    friction: AbstractFriction | None

    bounds: ClassVar[dict[str, Bounds]] = {
        "angle": Bounds("rad", size=1.0),
        "length": Bounds("m", above=0, size=1.0),
        "hinge_x": Bounds("m", size=1.0),
        "hinge_y": Bounds("m", size=1.0),
    }

    def __init__(
        self,
        angle: ArrayLike,
        length: ArrayLike = 1.2,
        hinge_x: ArrayLike = 0.0,
        hinge_y: ArrayLike = 0.0,
        friction: AbstractFriction | None | Literal["default"] = "default",
    ):
        """**Arguments:**

        - `angle`: a [rad] from x.
        - `length`: L [m], above 0, by default the reach of the paper's fence.
        - `hinge_x`, `hinge_y`: the point O [m].
        - `friction`: default kinetic 0.35, static 0.5, as of the fence; `None` for none.
        """
        _check.fields(self, angle=angle, length=length, hinge_x=hinge_x, hinge_y=hinge_y)
        self.friction = friction_of("friction", friction)

    def at(self, x, y):
        x, y = x - self.hinge_x, y - self.hinge_y
        cosine, sine = jnp.cos(self.angle), jnp.sin(self.angle)
        place = cosine * x + sine * y
        return SurfacePoint(
            gap=sine * x - cosine * y,
            place=place,
            normal=(-sine, cosine),
            beyond=jnp.maximum(-place, place - self.length),
        )

    def line(self):
        end_x = self.hinge_x + self.length * jnp.cos(self.angle)
        end_y = self.hinge_y + self.length * jnp.sin(self.angle)
        return (self.hinge_x, end_x), (self.hinge_y, end_y)
