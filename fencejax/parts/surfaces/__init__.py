"""Still surfaces that the parcel can touch, one kind a file. A scene holds the border by name and
any others as its `surfaces`; the fence, which moves and bends, is a part of its own.

>>> fj.scenes.passive_sort([fj.surfaces.Deflector(angle=0.6)]).surfaces[0]
Deflector(
  angle=0.6 rad,
  length=1.2 m,
  hinge_x=0 m,
  hinge_y=0 m,
  friction=Friction(kinetic=0.35, static=0.5),
)
"""

from .abstract import (
    AbstractSurface as AbstractSurface,
    SurfacePoint as SurfacePoint,
)
from .border import Border as Border
from .deflector import Deflector as Deflector
