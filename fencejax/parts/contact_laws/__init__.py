"""Contact laws, one a file: the normal force between a corner of the parcel and what it presses on,
as a function of the gap and its rate. `fencejax.Parcel(contact=...)` takes one."""

from .abstract import (
    AbstractContactLaw as AbstractContactLaw,
    NormalForce as NormalForce,
)
from .hunt_crossley import HuntCrossley as HuntCrossley
from .kelvin import Kelvin as Kelvin
