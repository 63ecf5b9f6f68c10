"""The mode shapes at one place of the fence."""

from typing import NamedTuple

from jaxtyping import Array

from .mode_shapes import Blocks
from .rest_shape import Rest


class Shape(NamedTuple):
    """The mode shapes at one arc coordinate: deflection [1] and slope [1/m] from the line of the
    rigid link, as blocks; `load` [1], the share of a force there that each mode gets; of the modes
    left out (`None` where there are none) the compliance G at the place itself [m/N], deflection
    sqrt(G) [m/J^0.5] and slope [rad/J^0.5] of the residual mode, and the compliance at the tip
    [m/N]; the `arc` integrals (`None` unless the geometry needs them); and the link's rest shape
    (`None` where it is straight)."""

    deflection: Blocks
    slope: Blocks
    load: Blocks
    residual: Array | None
    residual_mode: tuple[Array, Array] | None
    residual_tip: Array | None
    arc: tuple[tuple[Array, ...], Array] | None
    place: Array
    rest: Rest | None = None

    def from_line(self, bending: Array, rate: Array, slope: Array) -> tuple[Array, Array, Array]:
        """Deflection [m] from the rigid link's line, its rate [m/s] and slope, by that of the
        `bending` [m]."""
        if self.rest is None:
            return bending, rate, slope
        return bending + self.rest.line.deflection, rate, slope + self.rest.line.slope
