"""What a scene is made of, as a designer writes it: fence, material, taper, drive, parcel, belt,
border, friction coefficients, and units. Parts know neither time nor forces.

May import: `_check` alone. A new taper or drive law is a subclass of `AbstractTaper` or
`AbstractDrive` in a file of its own, exported here; every number in it is an array field, with its
`Bounds`.
"""

from .belt import (
    Belt as Belt,
    Border as Border,
)
from .drives import (
    CYCLE_TIME as CYCLE_TIME,
    AbstractDrive as AbstractDrive,
    ConstantSpeedDrive as ConstantSpeedDrive,
    DriveMotion as DriveMotion,
    HarmonicDrive as HarmonicDrive,
    HeldDrive as HeldDrive,
    SCurveDrive as SCurveDrive,
    SplineDrive as SplineDrive,
    TrapezoidDrive as TrapezoidDrive,
)
from .fence import (
    Fence as Fence,
)
from .friction import (
    Friction as Friction,
)
from .material import (
    Material as Material,
)
from .parcel import (
    SIDES as SIDES,
    Parcel as Parcel,
)
from .taper import (
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
