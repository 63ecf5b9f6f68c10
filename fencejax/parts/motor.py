"""The motor that swings the fence."""

from typing import ClassVar

from jaxtyping import Array, ArrayLike

from .. import _check
from .._check import Bounds
from ..printing import Part


class Motor(Part):
    """What the drive can give at the fence's hinge, behind its gear. A number that is `None` is not
    known, and bounds nothing."""

    torque: Array | None

    bounds: ClassVar[dict[str, Bounds]] = {"torque": Bounds("N m", above=0, size=100.0)}

    def __init__(self, torque: ArrayLike | None = None):
        """**Arguments:** `torque` [N m]: the largest that it gives, either way, above 0."""
        self.torque = None if torque is None else _check.field(self, "torque", torque)
