"""The equations (2.1)-(2.34) at one instant, each in one place: beam, modes, geometry of the bent
fence, kinematics of the corners, contact and friction laws, and the balance of forces.

May import: `scenes`, `parts`. Nothing here advances in time.

>>> link = fj.model.FlexibleLink(fj.Fence(), fj.Fidelity(modes=2))
>>> [f"{value**0.5 / (2 * np.pi):.1f} Hz" for value in link.eigenvalues]
['27.5 Hz', '114.4 Hz']
"""

from . import beam as beam, belt_edge as belt_edge
from .beam import (
    hermite as hermite,
    hermite_slope as hermite_slope,
)
from .belt_contact import (
    BeltContact as BeltContact,
    BeltDefect as BeltDefect,
    BeltForce as BeltForce,
)
from .belt_edge import (
    BeltEdge as BeltEdge,
    strip_mean_distance as strip_mean_distance,
)
from .fading import (
    fade as fade,
)
from .fence_geometry import (
    Arc as Arc,
    FencePoint as FencePoint,
    arc_point as arc_point,
    small_point as small_point,
)
from .fence_state import (
    FenceState as FenceState,
    ResidualMode as ResidualMode,
    bending_loads as bending_loads,
)
from .flexible_link import (
    FlexibleLink as FlexibleLink,
)
from .friction import (
    Coefficient as Coefficient,
    belt_grip as belt_grip,
    belt_slope as belt_slope,
    corner_share as corner_share,
    mean_coefficient as mean_coefficient,
)
from .hinge import (
    ClutchState as ClutchState,
    Hinge as Hinge,
)
from .kinematics import (
    Acceleration as Acceleration,
    TipLoad as TipLoad,
    corner_from_arm as corner_from_arm,
    fence_pose as fence_pose,
    fence_touch as fence_touch,
)
from .mechanics import (
    Contact as Contact,
    FenceFrame as FenceFrame,
    Forces as Forces,
    Mechanics as Mechanics,
    Meeting as Meeting,
    force_tolerance as force_tolerance,
)
from .mode_shapes import (
    Blocks as Blocks,
)
from .pad import (
    Cover as Cover,
    PadState as PadState,
)
from .propagation import (
    Propagator as Propagator,
    propagator as propagator,
    relaxation as relaxation,
)
from .shape import Shape as Shape
from .state import NormalState as NormalState, SceneState as SceneState
from .swing import (
    SWING_STEPS as SWING_STEPS,
    swung as swung,
)
from .tip import (
    Side as Side,
    around as around,
)
from .vibration import (
    Vibration as Vibration,
    blocks as blocks,
    dot as dot,
    propagate as propagate,
    total as total,
)
