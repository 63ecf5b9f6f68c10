"""The parcel's motion."""

from typing import NamedTuple

from jaxtyping import Array


class Body(NamedTuple):
    """Motion of the parcel: C_s at (x, y) [m], angle phi [rad], and their rates."""

    x: Array
    y: Array
    angle: Array
    x_rate: Array
    y_rate: Array
    spin: Array
