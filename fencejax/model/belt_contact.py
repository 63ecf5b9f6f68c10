"""The belt under the parcel: the force of Goyal's limit surface."""

import functools
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Smoothing
from ..parts import AbstractFriction, Belt, Parcel
from ..scenes import Body
from .belt_edge import BeltEdge
from .friction import belt_grip, belt_slope


class BeltForce(NamedTuple):
    """Force [N] and moment [N m] of the belt on the parcel, and what they dissipate [W]."""

    x: Array
    y: Array
    moment: Array
    dissipated: Array


class BeltSlip(NamedTuple):
    """Slip on the belt: the velocity (x, y) [m/s] relative to it at the middle of the pressure
    under the parcel, and c phidot [m/s]; c [m]; and the distance of that middle behind C_s across
    the belt, `lever` [m], `None` where it is under C_s."""

    x: Array
    y: Array
    turning: Array
    arm: Array
    lever: Array | None = None

    @property
    def squared(self) -> Array:
        """s^2 = |u|^2 + c^2 phidot^2 [m^2/s^2]."""
        return self.x**2 + self.y**2 + self.turning**2


class BeltDefect(NamedTuple):
    """The defect of the belt's friction inside a step: its `deviation` from the straight line over
    the step and its `magnitude`, both squared [N^2]; and the steepest `fall` of friction as the
    slip grows [N s/m]."""

    deviation: Array
    magnitude: Array
    fall: Array


def _product(a: tuple[Array, ...], b: tuple[Array, ...]) -> Array:
    return functools.reduce(jnp.add, map(jnp.multiply, a, b))


class BeltContact(eqx.Module):
    """The parcel's contact with the belt: the belt's speed v [m/s], the friction, the weight m_p g
    [N], the mean distance c [m] of the parcel's points from C_s and the belt's edge, if it ends
    under the parcel."""

    speed: Array
    friction: AbstractFriction
    weight: Array
    mean_distance: Array
    edge: BeltEdge | None = None

    @classmethod
    def of(cls, belt: Belt, parcel: Parcel) -> "BeltContact":
        """The contact of a parcel with a belt."""
        edge = BeltEdge(belt, parcel) if belt.edge else None
        weight = parcel.mass * belt.gravity
        return cls(belt.speed, belt.friction, weight, parcel.mean_distance, edge)

    def slip(self, body: Body) -> BeltSlip:
        """The slip on the belt."""
        return self._carried(body)[0]

    def _carried(self, body: Body) -> tuple[BeltSlip, Array]:
        """The slip, and the weight [N] that the belt carries."""
        x, y = body.x_rate - self.speed, body.y_rate
        if self.edge is None:
            slip = BeltSlip(x, y, self.mean_distance * body.spin, self.mean_distance)
            return slip, self.weight
        weight, arm, lever = self.edge.carried(body, self.weight)
        return BeltSlip(x + lever * body.spin, y, arm * body.spin, arm, lever), weight

    def grip(self, body: Body, square: Array, smoothing: Smoothing) -> tuple[Array, Array]:
        """`belt_grip` of a parcel whose squared slip is `square` [m^2/s^2]."""
        return belt_grip(self.friction, self._carried(body)[1], square, smoothing)

    def force(self, body: Body, smoothing: Smoothing) -> tuple[BeltForce, tuple[Array, Array]]:
        """The belt's force, and (grip, d grip / d s^2) of `belt_grip`."""
        (x, y, turning, arm, lever), weight = self._carried(body)
        square = x**2 + y**2 + turning**2
        grip, grip_slope = belt_grip(self.friction, weight, square, smoothing)
        moment = -grip * arm * turning
        if lever is not None:
            moment = moment - grip * lever * x
        return BeltForce(-grip * x, -grip * y, moment, grip * square), (grip, grip_slope)

    def defect(self, smoothing: Smoothing, was: Body, now: Body) -> BeltDefect:
        """The distance of the friction from its line inside a step in which the slip is linear; a
        moment counts as a force at the distance c.

        Friction turns with the slip where that passes near rest, and falls from static to kinetic,
        and this curve may be as much above its line as below. So it is evaluated at two points,
        half way from rest to either end, or a quarter from each. At theta the slip is (1 - theta)
        s_0 + theta s_1, friction g s, and its distance from the line

            (1 - theta) (g - g_0) s_0 + theta (g - g_1) s_1.
        """
        start, end = (self.slip(body)[:3] for body in (was, now))
        before, _ = self.force(was, smoothing)[1]
        after, grip_slope = self.force(now, smoothing)[1]
        square_0, square_1 = _product(start, start), _product(end, end)
        both = _product(start, end)
        moved = square_0 + square_1 - 2 * both
        passes = (both < square_0) & (both < square_1)
        rest = jnp.where(passes, (square_0 - both) / jnp.where(passes, moved, 1.0), 0.5)
        deviation = magnitude = jnp.zeros_like(square_0)
        fall = jnp.maximum(-belt_slope(after, grip_slope, square_1), 0.0)
        for theta in (0.5 * rest, 0.5 + 0.5 * rest):
            left = 1 - theta
            square = left**2 * square_0 + 2 * theta * left * both + theta**2 * square_1
            grip, grip_slope = self.grip(now, square, smoothing)
            first, second = left * (grip - before), theta * (grip - after)
            of_line = first**2 * square_0 + 2 * first * second * both + second**2 * square_1
            deviation = jnp.maximum(deviation, of_line)
            magnitude = jnp.maximum(magnitude, grip**2 * square)
            fall = jnp.maximum(fall, -belt_slope(grip, grip_slope, square))
        return BeltDefect(deviation, magnitude, fall)
