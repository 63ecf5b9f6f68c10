"""The motor that swings the fence."""

from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, ArrayLike

from .. import _check
from .._check import Bounds
from ..printing import Part


class Motor(Part):
    """The motor's limits at the fence's hinge, behind its gear. A number that is `None` is not
    known, and sets no limit.

    >>> motor = fj.Motor(rated_torque=400.0, rotor_inertia=2e-3, gear_ratio=20.0)
    >>> f"{motor.reflected_inertia:.2f} kg m^2"
    '0.80 kg m^2'
    """

    torque: Array | None
    rated_torque: Array | None
    no_load_speed: Array | None
    stall_torque: Array | None
    rotor_inertia: Array | None
    gear_ratio: Array | None
    efficiency: Array | None
    at_shaft: bool = eqx.field(static=True, default=False)

    bounds: ClassVar[dict[str, Bounds]] = {
        "torque": Bounds("N m", above=0, size=100.0),
        "rated_torque": Bounds("N m", above=0, size=100.0),
        "no_load_speed": Bounds("rad/s", above=0, size=10.0),
        "stall_torque": Bounds("N m", above=0, size=100.0),
        "rotor_inertia": Bounds("kg m^2", least=0, size=1e-3),
        "gear_ratio": Bounds(above=0, size=10.0),
        "efficiency": Bounds(above=0, most=1, size=1.0),
    }

    def __init__(
        self,
        torque: ArrayLike | None = None,
        rated_torque: ArrayLike | None = None,
        no_load_speed: ArrayLike | None = None,
        stall_torque: ArrayLike | None = None,
        rotor_inertia: ArrayLike | None = None,
        gear_ratio: ArrayLike | None = None,
        efficiency: ArrayLike | None = None,
        at_shaft: bool = False,
    ):
        """**Arguments.** Torques and speeds are those at the hinge: the motor's torque times the
        gear ratio, its speed divided by it.

        - `torque` [N m]: the largest torque, in either direction, above 0.
        - `rated_torque` [N m]: the largest continuous root mean square of the torque, above 0.
        - `no_load_speed` [rad/s]: omega_0, at which its torque has fallen to 0, above 0.
        - `stall_torque` [N m]: T_s, where the line of torque over speed begins, at standstill, by
          default `torque`: T = T_s (1 - omega / omega_0).
        - `rotor_inertia` [kg m^2]: J of rotor, brake and coupling, at the motor's own shaft, at
          least 0. At the hinge it is J i^2.
        - `gear_ratio` [1]: i, turns of the motor to one of the fence, by default 1.
        - `efficiency` [1] of the gear, above 0, at most 1: the power that it gives out over that
          which it takes in, the same in both directions.
        - `at_shaft`, static: torques and speeds are those of the motor's own shaft, as its data
          sheet has them. Then the gear ratio changes what the motor can do at the hinge, and
          results about torques are those at the shaft.

        Raises `ValueError` where a number is out of its bounds, the rated torque is above the
        largest one, the stall torque is below it, or there is a stall torque without a no-load
        speed or the other way round.
        """
        given = dict(
            torque=torque, rated_torque=rated_torque, no_load_speed=no_load_speed,
            stall_torque=stall_torque, rotor_inertia=rotor_inertia, gear_ratio=gear_ratio,
            efficiency=efficiency,
        )  # fmt: skip
        self.at_shaft = _check.flag("at_shaft", at_shaft)
        for name, value in given.items():
            setattr(self, name, None if value is None else _check.field(self, name, value))
        if self.torque is not None and self.rated_torque is not None:
            remedy = "Give the largest torque as `torque`, that of lasting use as `rated_torque`."
            share = self.rated_torque / self.torque
            _check.scalar("rated_torque / torque", share, most=1, remedy=remedy)
        if self.torque is not None and self.stall_torque is not None:
            remedy = "Give a torque that lasts at standstill as `rated_torque`."
            share = self.stall_torque / self.torque
            _check.scalar("stall_torque / torque", share, least=1, remedy=remedy)
        if self.no_load_speed is not None and self.stall_torque is None and self.torque is None:
            raise ValueError(
                "Argument `stall_torque` [N m] must be given with `no_load_speed`, but is None: "
                "two points make the line of torque over speed. Write stall_torque=600.0."
            )
        if self.stall_torque is not None and self.no_load_speed is None:
            raise ValueError(
                "Argument `no_load_speed` [rad/s] must be given with `stall_torque`, but is None: "
                "two points make the line of torque over speed. Write no_load_speed=8.0."
            )

    @property
    def reflected_inertia(self) -> Array | float:
        """J i^2 [kg m^2]: the rotor's inertia reflected to the hinge; 0 where it is not known."""
        if self.rotor_inertia is None:
            return 0.0
        return self.rotor_inertia * (1.0 if self.gear_ratio is None else self.gear_ratio) ** 2

    @property
    def reduction(self) -> Array | float:
        """Ratio of a torque at the hinge to one of the motor's numbers [1]: i where these are at
        its shaft, 1 where they are at the hinge."""
        return self.gear_ratio if self.at_shaft and self.gear_ratio is not None else 1.0

    @property
    def line(self) -> tuple[Array, Array] | None:
        """Stall torque [N m] and no-load speed [rad/s] as given; `None` where they are not
        known."""
        stall = self.torque if self.stall_torque is None else self.stall_torque
        if stall is None or self.no_load_speed is None:
            return None
        return stall, self.no_load_speed

    @property
    def known(self) -> bool:
        """Whether any of its numbers is known."""
        return any(getattr(self, name) is not None for name in self.bounds)

    @property
    def differs_from_hinge(self) -> bool:
        """Whether the motor's torque differs from the moment at the fence's hinge."""
        more = (self.no_load_speed, self.rotor_inertia, self.efficiency)
        return self.at_shaft or any(number is not None for number in more)
