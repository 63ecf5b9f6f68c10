"""The belt the parcel lies on."""

from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, ArrayLike

from .. import _check
from .._check import Bounds
from ..printing import Part
from .friction_laws import AbstractFriction, Friction


class Belt(Part):
    """A belt that runs along +x and carries the parcel by friction.

    With `edge` the belt ends at s under the parcel (see `fencejax.model.belt_edge`); without, it
    carries the parcel beyond s too.

    >>> fj.Belt(speed=2.5, friction=fj.Friction(kinetic=0.6, static=0.8))
    Belt(
      speed=2.5 m/s,
      width=700 mm,
      friction=Friction(kinetic=0.6, static=0.8),
      gravity=9.81 m/s^2,
      edge=False,
    )
    """

    speed: Array
    width: Array
    friction: AbstractFriction
    gravity: Array
    edge: bool = eqx.field(static=True)

    bounds: ClassVar[dict[str, Bounds]] = {
        "speed": Bounds("m/s", least=0, size=1.0),
        "width": Bounds("m", above=0, size=1.0),
        "gravity": Bounds("m/s^2", least=0, size=10.0),
    }

    def __init__(
        self,
        speed: ArrayLike = 2.0,
        width: ArrayLike = 0.7,
        friction: AbstractFriction | None = None,
        gravity: ArrayLike = 9.81,
        edge: bool = False,
    ):
        """**Arguments:**

        - `speed`: v [m/s], at least 0.
        - `width`: s [m] from the border to the chute, above 0.
        - `friction`: default kinetic 0.65, static 0.85.
        - `gravity`: g [m/s^2], at least 0.
        - `edge`: whether the belt ends at its width under the parcel.
        """
        self.edge = _check.flag("edge", edge)
        _check.fields(self, speed=speed, width=width)
        friction = Friction(kinetic=0.65, static=0.85) if friction is None else friction
        example = "friction=fj.Friction(kinetic=0.65, static=0.85)"
        self.friction = _check.part("friction", friction, AbstractFriction, example)
        self.gravity = _check.field(self, "gravity", gravity)
