"""Contact laws, one a file: the normal force between a corner of the parcel and the body it
touches, as a function of the gap and its rate. `fencejax.Parcel(contact=...)` takes one.

>>> fj.Parcel(contact=fj.contact_laws.HuntCrossley(6.1e5, 0.5)).contact
HuntCrossley(
  secant_stiffness=610000 N/m,
  dissipation=0.5 s/m,
  exponent=1.5,
  reference_depth=1 m,
)
"""

from .abstract import (
    AbstractContactLaw as AbstractContactLaw,
    NormalForce as NormalForce,
)
from .hunt_crossley import HuntCrossley as HuntCrossley
from .kelvin import Kelvin as Kelvin
