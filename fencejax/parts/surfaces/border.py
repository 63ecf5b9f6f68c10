"""The conveyor's border."""

from typing import Literal

import jax.numpy as jnp

from ..friction_laws import AbstractFriction, friction_of
from .abstract import AbstractSurface, SurfacePoint


class Border(AbstractSurface):
    """The conveyor border: a still wall along y = 0 with the normal (0, 1): D = -y.

    Paper: (2.34).

    >>> scene = fj.scenes.border_and_fence(border=fj.Border(friction=fj.Friction(0.2, 0.3)))
    >>> scene.border
    Border(friction=Friction(kinetic=0.2, static=0.3))
    """

    friction: AbstractFriction | None

    def __init__(self, friction: AbstractFriction | None | Literal["default"] = "default"):
        """**Arguments:** `friction`: default kinetic 0.35, static 0.5; `None` for none."""
        self.friction = friction_of("friction", friction)

    def at(self, x, y):
        return SurfacePoint(-y, x, (jnp.zeros_like(x), jnp.ones_like(x)), None)
