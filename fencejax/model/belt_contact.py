"""The belt under the parcel: the force of Goyal's limit surface."""

from typing import NamedTuple

import equinox as eqx
from jaxtyping import Array

from ..fidelity import Smoothing
from ..parts import AbstractFriction
from ..scenes import Body
from .friction import belt_grip


class BeltForce(NamedTuple):
    """Force [N] and moment [N m] of the belt on the parcel, and what they dissipate [W]."""

    x: Array
    y: Array
    moment: Array
    dissipated: Array


class BeltContact(eqx.Module):
    """The parcel's contact with the belt: the belt's speed v [m/s], the friction, the weight m_p g
    [N] and the mean distance c [m] of the parcel's points from C_s."""

    speed: Array
    friction: AbstractFriction
    weight: Array
    mean_distance: Array

    def slip(self, body: Body) -> tuple[Array, Array, Array]:
        """Velocity relative to the belt, (x, y) [m/s] and c phidot [m/s]."""
        return body.x_rate - self.speed, body.y_rate, self.mean_distance * body.spin

    def force(self, body: Body, smoothing: Smoothing) -> tuple[BeltForce, tuple[Array, Array]]:
        """The belt's force, and (grip, d grip / d s^2) of `belt_grip`."""
        x, y, turning = self.slip(body)
        square = x**2 + y**2 + turning**2
        grip, bend = belt_grip(self.friction, self.weight, square, smoothing)
        moment = -grip * self.mean_distance * turning
        return BeltForce(-grip * x, -grip * y, moment, grip * square), (grip, bend)
