"""A flexible shaft between motor and hinge."""

from typing import ClassVar

from jaxtyping import Array, ArrayLike

from .. import _check
from .._check import Bounds
from ..printing import Part


class Shaft(Part):
    """A shaft and gear between the motor, which follows its drive law alpha_w(t), and the hinge:

        T = -k_t theta - c_t theta',

    T [N m] the moment on the fence and theta [rad] the angle of the hinge ahead of the motor, below
    0 under a parcel. The hinge's angle alpha_w + theta is then a state. Without a shaft theta = 0.

    With a slipping clutch between motor and shaft |T| is at most T_c; the angle s [rad] by which it
    has slipped is not part of the twist,

        T = -k_t (theta - s) - c_t (theta' - s'),  s' = 0 where |T| < T_c.

    At the arc coordinate R it adds the compliance R^2 / k_t [m/N] to that of the fence. The motor's
    side of the shaft follows alpha_w whatever the load: its inertia enters the motor's torque alone
    (`fencejax.Motor`).

    >>> fence = fj.Fence(shaft=fj.Shaft(stiffness=2e5, slip_torque=600.0))
    >>> fence.shaft
    Shaft(stiffness=200000 N m/rad, damping=50 N m s/rad, inertia=0 kg m^2, slip_torque=600 N m)
    """

    stiffness: Array
    damping: Array
    inertia: Array
    slip_torque: Array | None

    bounds: ClassVar[dict[str, Bounds]] = {
        "stiffness": Bounds("N m/rad", above=0, size=1e6),
        "damping": Bounds("N m s/rad", least=0, size=100.0),
        "inertia": Bounds("kg m^2", least=0, size=1.0),
        "slip_torque": Bounds("N m", above=0, size=100.0),
    }

    def __init__(
        self,
        stiffness: ArrayLike = 1e5,
        damping: ArrayLike = 50.0,
        inertia: ArrayLike = 0.0,
        slip_torque: ArrayLike | None = None,
    ):
        """**Arguments:**

        - `stiffness`: k_t [N m/rad] of shaft and gear at the hinge, above 0.
        - `damping`: c_t [N m s/rad], at least 0.
        - `inertia`: J_h [kg m^2] of the gear's output and the hub, that turn with the hinge, at
          least 0.
        - `slip_torque`: T_c [N m] at which the clutch slips, above 0; by default there is none.
        """
        _check.fields(self, stiffness=stiffness, damping=damping, inertia=inertia)
        self.slip_torque = None
        if slip_torque is not None:
            self.slip_torque = _check.field(self, "slip_torque", slip_torque)
