"""Motion of the parcel and of its corners, and how a corner meets the fence or a still surface."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from .._elementary import cos_sin
from ..parts import DriveMotion, SurfacePoint, turned
from ..scenes import Body, Pose
from .fence_geometry import FencePoint


class Acceleration(NamedTuple):
    """Acceleration of C_s [m/s^2] and angular acceleration [rad/s^2]."""

    x: Array
    y: Array
    angle: Array


class Corner(NamedTuple):
    """A corner's place from C_s [m], its position [m] and its velocity [m/s], in fixed axes."""

    arm_x: Array
    arm_y: Array
    x: Array
    y: Array
    x_rate: Array
    y_rate: Array


class TipLoad(NamedTuple):
    """The load of a contact near the tip on the fence: the `share` [1] of its force that bends it,
    and the `shift` [m] from the corner's foot towards the tip of the place where the line of that
    force meets the fence."""

    share: Array
    shift: Array

    def ahead(self, before: "TipLoad", ratio) -> "TipLoad":
        """Linear extrapolation over the next step, `ratio` times as long as the last one."""
        share = self.share + ratio * (self.share - before.share)
        shift = self.shift + ratio * (self.shift - before.shift)
        return TipLoad(jnp.clip(share, -1.0, 1.0), shift)


class Touch(NamedTuple):
    """Kinematics of a corner at a surface, with the surface's axes there in fixed axes.

    `foot_offset` [m] is how far along the surface the foot of the corner lies from the point U;
    `normal` and `tangent` are the directions (x, y, moment) in which a unit force acts on the
    parcel; `rates` is the velocity of U along the normal and the tangent [m/s]. Where the tip may
    carry the contact, `tip_load` says how it loads the fence, and `lasting` [1] is the share of the
    contact law that has not ended at the other end of the parcel's side; `missed` is 1.0 where a
    neighbouring corner that is not among the scene's `fence_corners` is under the fence, `None`
    where both neighbours are among them.
    """

    gap: Array
    gap_rate: Array
    sliding: Array
    foot_offset: Array
    normal: tuple[Array, Array, Array]
    tangent: tuple[Array, Array, Array]
    rates: tuple[Array, Array]
    tip_load: TipLoad | None = None
    lasting: Array | None = None
    missed: Array | None = None

    def remaining(self, share):
        """The part of a `share` [1] of the contact law that has not ended near the tip."""
        if self.lasting is None:
            return share
        return share * self.lasting


def corner_from_arm(body: Body, arm_x: Array, arm_y: Array) -> Corner:
    """Position and velocity of the point of the parcel at `arm` from C_s, in fixed axes.

    Paper: (2.12). There from the polar coordinates of C_s.
    """
    return Corner(
        arm_x,
        arm_y,
        body.x + arm_x,
        body.y + arm_y,
        body.x_rate - body.spin * arm_y,
        body.y_rate + body.spin * arm_x,
    )


def _velocity(point: FencePoint, speed: Array) -> tuple[Array, Array]:
    """Velocity [m/s] of a point U of the fence along and across the rigid link, which turns at
    `speed` [rad/s]."""
    return point.x_rate - speed * point.y, point.y_rate + speed * point.x


def fence_pose(point: FencePoint, drive: DriveMotion) -> Pose:
    """A point U of the fence in fixed axes, with the slope and the normal velocity there."""
    along, across = _velocity(point, drive.speed)
    normal_rate = across * jnp.cos(point.slope) - along * jnp.sin(point.slope)
    x, y = turned((jnp.cos(drive.angle), jnp.sin(drive.angle)), point.x, point.y)
    return Pose(x, y, point.slope, normal_rate, drive)


def fence_touch(
    corner: Corner, point: FencePoint, turn: tuple[Array, Array], speed: Array
) -> Touch:
    """Gap, its rate and sliding speed of a corner at a point U of the fence.

    D = -(C - U).n, Ddot = -(v_C - v_U).n, w = (v_C - v_U).t; `turn` is (cos, sin) of alpha_w and
    `speed` its rate [rad/s]. U is the foot of the perpendicular from C where the foot's offset
    (C - U).t vanishes.

    Paper: (2.11), (2.13), (2.18). There U is at the arc coordinate OC, the same to the first order.
    """
    # U, its velocity and the tangent in fixed axes.
    place_x, place_y = turned(turn, point.x, point.y)
    fence_x, fence_y = turned(turn, *_velocity(point, speed))
    x, y = turned(turn, *cos_sin(point.slope))
    offset_x, offset_y = corner.x - place_x, corner.y - place_y
    slip_x, slip_y = corner.x_rate - fence_x, corner.y_rate - fence_y
    return Touch(
        gap=y * offset_x - x * offset_y,
        gap_rate=y * slip_x - x * slip_y,
        sliding=x * slip_x + y * slip_y,
        foot_offset=x * offset_x + y * offset_y,
        normal=(-y, x, corner.arm_x * x + corner.arm_y * y),
        tangent=(x, y, corner.arm_x * y - corner.arm_y * x),
        rates=(x * fence_y - y * fence_x, x * fence_x + y * fence_y),
    )


def surface_touch(corner: Corner, point: SurfacePoint) -> Touch:
    """Gap, its rate and sliding speed at a still surface: Ddot = -v_C.n, w = v_C.t, t the normal n
    turned by -pi / 2."""
    x, y = point.normal
    zero = jnp.zeros_like(corner.x)
    return Touch(
        gap=point.gap,
        gap_rate=-(x * corner.x_rate + y * corner.y_rate),
        sliding=y * corner.x_rate - x * corner.y_rate,
        foot_offset=zero,
        normal=(x, y, corner.arm_x * y - corner.arm_y * x),
        tangent=(y, -x, -(corner.arm_x * x + corner.arm_y * y)),
        rates=(zero, zero),
    )
