"""A pneumatic cylinder that pushes the fence."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ... import _check
from ..._check import Bounds
from .abstract import CYCLE_TIME
from .torque import AT_HINGE, AbstractTorqueDrive


class PneumaticDrive(AbstractTorqueDrive):
    """A single-acting cylinder on a lever, with a return spring:

        T(t) = p(t) A r,  tau p' + p = p_s while the valve is open, 0 <= t < t_v, and = 0 after,

    so that p = p_s (exp(-max(t - t_v, 0) / tau) - exp(-t / tau)). The chamber fills and empties
    with one time constant, whatever the piston does, and the lever is short of its dead centre.

    J. L. Shearer, Study of pneumatic processes in the continuous control of motion with compressed
    air, Trans. ASME 78 (1956) 233-249: linearised, a chamber behind an orifice is a first-order
    lag. There with the piston's speed in it; here its effect is that of the `damping`.

    >>> drive = fj.PneumaticDrive(pressure=5e5, area=2e-3, lever=0.12)
    >>> f"{drive.torque(0.05):.1f} N m of {drive.largest:.1f} N m"
    '75.9 N m of 120.0 N m'
    """

    pressure: Array
    area: Array
    lever: Array
    fill_time: Array
    open_time: Array
    cycle_time: Array
    inertia: Array
    damping: Array
    stiffness: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "pressure": Bounds("Pa", least=0, size=1e5),
        "area": Bounds("m^2", above=0, size=1e-3),
        "lever": Bounds("m", above=0, size=0.1),
        "fill_time": Bounds("s", above=0, size=0.1),
        "open_time": Bounds("s", above=0, size=1.0),
        "cycle_time": Bounds("s", above=0, size=1.0),
        **AT_HINGE,
    }

    def __init__(
        self,
        pressure: ArrayLike = 6e5,
        area: ArrayLike = 2e-3,
        lever: ArrayLike = 0.1,
        fill_time: ArrayLike = 0.05,
        open_time: ArrayLike = 0.5,
        cycle_time: ArrayLike = CYCLE_TIME,
        inertia: ArrayLike = 0.05,
        damping: ArrayLike = 20.0,
        stiffness: ArrayLike = 60.0,
    ):
        """**Arguments:**

        - `pressure`: p_s [Pa] of the supply above that of the air, at least 0.
        - `area`: A [m^2] of the piston, above 0: 2e-3 is a bore of 50 mm.
        - `lever`: r [m] of the rod about the hinge, above 0.
        - `fill_time`: tau [s], above 0.
        - `open_time`: t_v [s], how long the valve is open, above 0.
        - `cycle_time`: t_c [s] until the next parcel, above 0.
        - `inertia`: J_d [kg m^2] of lever and piston, of mass m, m r^2, above 0.
        - `damping`: c [N m s/rad] of the cylinder and its throttle, at least 0.
        - `stiffness`: k [N m/rad] of the return spring, at least 0.
        """
        _check.fields(
            self, pressure=pressure, area=area, lever=lever, fill_time=fill_time,
            open_time=open_time, cycle_time=cycle_time, inertia=inertia, damping=damping,
            stiffness=stiffness,
        )  # fmt: skip

    def torque(self, time: Array) -> Array:
        since = jnp.maximum(time - self.open_time, 0.0)
        share = jnp.exp(-since / self.fill_time) - jnp.exp(-time / self.fill_time)
        return self.largest * share

    @property
    def largest(self) -> Array:
        return self.pressure * self.area * self.lever

    @property
    def cycle(self) -> Array:
        return self.cycle_time

    @property
    def turning_time(self) -> Array:
        return jnp.minimum(self.open_time, self.cycle_time)
