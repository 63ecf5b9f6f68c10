"""A scene: the parts that act, and the start."""


import equinox as eqx
from jaxtyping import Array

from ..parts import (
    AbstractDrive,
    AbstractFriction,
    AbstractSurface,
    Belt,
    Border,
    Fence,
    Motor,
    Parcel,
)
from ..printing import Part
from .names import BY_PATH
from .start import AbstractStart


class Scene(Part):
    """A parcel and the parts that act on it. A part that is `None` costs nothing.

    Made by the functions of `stages` and `sorts`; a field is changed with `equinox.tree_at`. The
    `motor` does not change the motion: only `fencejax.design.drivability` uses its numbers.

    >>> scene = fj.scenes.oblique_impact(distance=0.9)
    >>> scene.start, scene.duration
    (AtTouch(place=900 mm, drive_angle=0.3 rad, corner=1), 0.25)
    """

    parcel: Parcel
    start: AbstractStart
    duration: float = eqx.field(static=True)
    belt: Belt | None = None
    fence: Fence | None = None
    drive: AbstractDrive | None = None
    fence_friction: AbstractFriction | None = None
    border: Border | None = None
    fence_corners: tuple[int, ...] = eqx.field(static=True, default=())
    border_corners: tuple[int, ...] = eqx.field(static=True, default=())
    tip_contact: bool = eqx.field(static=True, default=False)
    surfaces: tuple[AbstractSurface, ...] = ()
    surface_corners: tuple[int, ...] = eqx.field(static=True, default=())
    motor: Motor | None = None

    def _unit(self, name):
        return "s" if name == "duration" else super()._unit(name)


class NormalScene(Part):
    """A parcel with one coordinate, against a fence whose root is at rest or, without one, against
    a rigid wall of infinite mass; no belt, no friction.

    >>> scene = fj.scenes.normal_impact(speed=2.0)
    >>> float(scene.speed), scene.duration
    (2.0, 0.25)
    """

    parcel: Parcel
    speed: Array
    fence: Fence | None
    distance: Array | None
    duration: float = eqx.field(static=True)

    def _unit(self, name):
        return "s" if name == "duration" else BY_PATH[name].unit
