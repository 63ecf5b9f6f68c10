"""The mode shapes at one place of the fence."""

from typing import NamedTuple

from jaxtyping import Array

from .mode_shapes import Blocks
from .rest_shape import Rest
from .second_order import Following


class Shape(NamedTuple):
    """The mode shapes at one arc coordinate.

    - `deflection` [1] and `slope` [1/m] from the line of the rigid link, as blocks; `load` [1],
      each mode's share of a force there.
    - Of the modes left out (`None` where there are none): the compliance G at the place itself,
      `residual` [m/N]; deflection sqrt(G) [m/J^0.5] and slope [rad/J^0.5] of the residual mode; and
      the compliance at the tip, `residual_tip` [m/N]. All of these include the yielding of the link
      in shear; `left_out` [m/N] is G without it.
    - The `arc` integrals (`None` unless the geometry needs them), the `place` [m] and the link's
      rest shape (`None` where it is straight).
    - `following`: a normal force that follows the bent fence, with `load` by its virtual work; and
      the same of `friction`, per newton of its own.
    """

    deflection: Blocks
    slope: Blocks
    load: Blocks
    residual: Array | None
    residual_mode: tuple[Array, Array] | None
    residual_tip: Array | None
    arc: tuple[tuple[Array, ...], Array] | None
    place: Array
    rest: Rest | None = None
    left_out: Array | None = None
    following: Following | None = None
    friction: tuple[Following, Blocks] | None = None

    @property
    def arm(self) -> Array:
        """Arm of a unit load about the hinge [m]."""
        return self.place if self.following is None else self.following.arm

    def with_friction(self, ratio: Array) -> "Shape":
        """The shape for a load by the normal force and by friction of a `ratio` [1] to it."""
        if self.following is None or self.friction is None:
            return self
        more, load = self.friction
        what = (a + ratio * b for a, b in zip(self.following, more, strict=True))
        load = tuple(a + ratio * b for a, b in zip(self.load, load, strict=True))
        return self._replace(following=Following(*what), load=load, friction=None)

    def from_line(self, bending: Array, rate: Array, slope: Array) -> tuple[Array, Array, Array]:
        """Deflection [m] from the rigid link's line, its rate [m/s] and slope, by that of the
        `bending` [m]."""
        if self.rest is None:
            return bending, rate, slope
        return bending + self.rest.line.deflection, rate, slope + self.rest.line.slope
