"""Still surfaces that the parcel can touch, one kind a file. A scene holds the border by name and
any others as its `surfaces`; the fence, which moves and bends, is a part of its own."""

from .abstract import (
    AbstractSurface as AbstractSurface,
    SurfacePoint as SurfacePoint,
)
from .border import Border as Border
from .deflector import Deflector as Deflector
