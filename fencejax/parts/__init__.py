"""The parts of a scene, as a designer writes them: fence, with its material, taper, pad, shaft and
rest shape, drive, parcel, contact law, belt, still surfaces, friction law, and units. Parts do not
depend on a scene or an instant: a contact law here is a function of a gap and its rate, a friction
law one of a speed, a surface one of a point. When they act is decided in the model.

May import: no other room. A new taper, drive, contact law, friction law or surface is a subclass
of `AbstractTaper`, `AbstractDrive`, `AbstractContactLaw`, `AbstractFriction` or `AbstractSurface`
in a file of its own, exported by its folder; every number in it is an array field, with its
`Bounds`.

>>> fj.parts.DRIVES["trapezoid"]()
TrapezoidDrive(end_angle=0.6623 rad, top_speed=1.53 rad/s, acceleration=6 rad/s^2, dwell=0 s)
"""

from . import (
    contact_laws as contact_laws,
    friction_laws as friction_laws,
    materials as materials,
    surfaces as surfaces,
)
from .belt import (
    Belt as Belt,
)
from .contact_laws import (
    AbstractContactLaw as AbstractContactLaw,
    Kelvin as Kelvin,
    NormalForce as NormalForce,
)
from .drives import (
    CYCLE_TIME as CYCLE_TIME,
    DRIVES as DRIVES,
    AbstractDrive as AbstractDrive,
    AbstractTorqueDrive as AbstractTorqueDrive,
    ConstantSpeedDrive as ConstantSpeedDrive,
    DriveMotion as DriveMotion,
    HarmonicDrive as HarmonicDrive,
    HeldDrive as HeldDrive,
    PneumaticDrive as PneumaticDrive,
    SCurveDrive as SCurveDrive,
    SplineDrive as SplineDrive,
    TorqueDrive as TorqueDrive,
    TrapezoidDrive as TrapezoidDrive,
)
from .fence import (
    Fence as Fence,
)
from .friction_laws import (
    FRICTIONS as FRICTIONS,
    AbstractFriction as AbstractFriction,
    Friction as Friction,
    FrictionScales as FrictionScales,
    friction_of as friction_of,
    on_cover as on_cover,
)
from .material import (
    Material as Material,
)
from .materials import (
    ENDURANCE as ENDURANCE,
    EXPONENT as EXPONENT,
    DataSheet as DataSheet,
    basquin_exponent as basquin_exponent,
)
from .motor import (
    Motor as Motor,
)
from .pad import (
    Pad as Pad,
)
from .parcel import (
    SIDES as SIDES,
    Parcel as Parcel,
)
from .rest_shape import (
    RestLine as RestLine,
    RestShape as RestShape,
)
from .rotation import (
    turned as turned,
)
from .second_order import (
    SecondOrderLoads as SecondOrderLoads,
)
from .shaft import (
    Shaft as Shaft,
)
from .shear import (
    Shear as Shear,
)
from .surfaces import (
    AbstractSurface as AbstractSurface,
    Border as Border,
    SurfacePoint as SurfacePoint,
)
from .tapers import (
    TAPERS as TAPERS,
    AbstractTaper as AbstractTaper,
    ConstantStrength as ConstantStrength,
    PowerTaper as PowerTaper,
    ProfileTaper as ProfileTaper,
    SteppedTaper as SteppedTaper,
    Uniform as Uniform,
)
from .units import (
    Dimension as Dimension,
    dimension as dimension,
)
