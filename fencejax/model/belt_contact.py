"""The belt under the parcel: the force of Goyal's limit surface."""

from typing import NamedTuple

import equinox as eqx
from jaxtyping import Array

from ..fidelity import Smoothing
from ..parts import AbstractFriction
from ..scenes import Body
from .belt_edge import BeltEdge
from .friction import belt_grip


class BeltForce(NamedTuple):
    """Force [N] and moment [N m] of the belt on the parcel, and what they dissipate [W]."""

    x: Array
    y: Array
    moment: Array
    dissipated: Array


class BeltSlip(NamedTuple):
    """Slip on the belt: the velocity (x, y) relative to it [m/s], where what it carries has its
    middle, and c phidot [m/s]; c [m], and by how much that middle is behind C_s across the belt,
    `lever` [m], `None` where it is under C_s."""

    x: Array
    y: Array
    turning: Array
    arm: Array
    lever: Array | None = None


class BeltContact(eqx.Module):
    """The parcel's contact with the belt: the belt's speed v [m/s], the friction, the weight m_p g
    [N], the mean distance c [m] of the parcel's points from C_s and the belt's edge, if it ends
    under the parcel."""

    speed: Array
    friction: AbstractFriction
    weight: Array
    mean_distance: Array
    edge: BeltEdge | None = None

    def slip(self, body: Body) -> BeltSlip:
        """On the belt."""
        return self._carried(body)[0]

    def _carried(self, body: Body) -> tuple[BeltSlip, Array]:
        """The slip, and the weight [N] that the belt carries."""
        x, y = body.x_rate - self.speed, body.y_rate
        if self.edge is None:
            slip = BeltSlip(x, y, self.mean_distance * body.spin, self.mean_distance)
            return slip, self.weight
        weight, arm, lever = self.edge.carried(body, self.weight)
        return BeltSlip(x + lever * body.spin, y, arm * body.spin, arm, lever), weight

    def grip(self, body: Body, square: Array, smoothing: Smoothing) -> Array:
        """The grip [N s/m] on a parcel that slips at a speed of that `square` [m^2/s^2]."""
        return belt_grip(self.friction, self._carried(body)[1], square, smoothing)[0]

    def force(self, body: Body, smoothing: Smoothing) -> tuple[BeltForce, tuple[Array, Array]]:
        """The belt's force, and (grip, d grip / d s^2) of `belt_grip`."""
        (x, y, turning, arm, lever), weight = self._carried(body)
        square = x**2 + y**2 + turning**2
        grip, bend = belt_grip(self.friction, weight, square, smoothing)
        moment = -grip * arm * turning
        if lever is not None:
            moment = moment - grip * lever * x
        return BeltForce(-grip * x, -grip * y, moment, grip * square), (grip, bend)
