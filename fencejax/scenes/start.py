"""How a scene begins: the time on the drive's clock, and where the parcel is and how it moves."""

import abc

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..parts import AbstractDrive, Belt, DriveMotion, Parcel
from .body import Body


class Pose(eqx.Module):
    """What a start may use of the fence: the point U at an arc coordinate and the slope there,
    both at the start time, in fixed axes, and the drive's motion."""

    x: Array
    y: Array
    slope: Array
    normal_rate: Array
    drive: DriveMotion


class AbstractStart(eqx.Module):
    """Initial conditions of a scene."""

    def time(self, drive: AbstractDrive | None) -> Array | None:
        """Time [s] on the drive's clock; `None` for 0, where the fence is at rest."""
        del drive
        return None

    def distance(self) -> Array | None:
        """Arc coordinate [m] of the fence's point that the start refers to, or `None`."""
        return None

    @abc.abstractmethod
    def body(self, parcel: Parcel, belt: Belt | None, pose: Pose | None) -> Body:
        """The parcel's motion at the start."""


def _turned(x, y, angle):
    return (
        jnp.cos(angle) * x - jnp.sin(angle) * y,
        jnp.sin(angle) * x + jnp.cos(angle) * y,
    )


class AsGiven(AbstractStart):
    """The parcel's motion written out."""

    motion: Body

    def body(self, parcel, belt, pose):
        del parcel, belt, pose
        return self.motion


class OnBelt(AbstractStart):
    """The parcel rides with the belt: its foremost point at x = `front`, its lowest `offset` from
    the border, turned by `angle`, when the drive starts."""

    front: Array
    offset: Array
    angle: Array

    def body(self, parcel, belt, pose):
        del pose
        corners = [_turned(*parcel.corner(k), self.angle) for k in (1, 2, 3, 4)]
        foremost = jnp.max(jnp.stack([x for x, _ in corners]), axis=0)
        lowest = jnp.min(jnp.stack([y for _, y in corners]), axis=0)
        zero = jnp.zeros_like(foremost + self.front + lowest)
        speed = zero if belt is None else belt.speed + zero
        return Body(
            self.front - foremost + zero,
            self.offset - lowest + zero,
            self.angle + zero,
            speed,
            zero,
            zero,
        )


class AtTouch(AbstractStart):
    """A corner touches the fence (D = 0) at an arc coordinate, on the drive's way out.

    The fence has swung free of contact since t = 0. The parcel rides with the belt (or moves as
    given), turned so that C_s lies on the fence's normal through the corner, or by a given angle.
    """

    place: Array
    drive_angle: Array
    parcel_angle: Array | None
    velocity: tuple[Array, Array, Array] | None
    corner: int = eqx.field(static=True)

    def time(self, drive):
        assert drive is not None
        return drive.time_at(self.drive_angle)

    def distance(self):
        return self.place

    def body(self, parcel, belt, pose):
        assert pose is not None
        arm_x, arm_y = parcel.corner(self.corner)
        tangent = pose.drive.angle + pose.slope
        if self.parcel_angle is None:
            # R(phi)(-arm) points along the normal, tangent + pi / 2.
            angle = tangent + jnp.pi / 2 - jnp.arctan2(-arm_y, -arm_x)
            angle = angle - 2 * jnp.pi * jnp.round(jax.lax.stop_gradient(angle) / (2 * jnp.pi))
        else:
            angle = self.parcel_angle
        x, y = _turned(arm_x, arm_y, angle)
        if self.velocity is None:
            zero = jnp.zeros_like(pose.x)
            velocity = (zero if belt is None else belt.speed, zero, zero)
        else:
            velocity = self.velocity
        return Body(pose.x - x, pose.y - y, angle, *velocity)


class FlushOnFence(AbstractStart):
    """The parcel's lower wall lies on the fence (D = 0), C_s over the arc coordinate `place`.

    It turns and advances with the fence and slides along it with the belt's share.
    """

    place: Array
    drive_angle: Array

    def time(self, drive):
        assert drive is not None
        return drive.time_at(self.drive_angle)

    def distance(self):
        return self.place

    def body(self, parcel, belt, pose):
        assert pose is not None
        angle = pose.drive.angle + pose.slope
        height = parcel.breadth / 2 + parcel.center_y
        normal = (-jnp.sin(angle), jnp.cos(angle))
        along = (0.0 if belt is None else belt.speed) * jnp.cos(angle)
        across = pose.normal_rate
        return Body(
            pose.x + height * normal[0],
            pose.y + height * normal[1],
            angle,
            along * normal[1] + across * normal[0],
            -along * normal[0] + across * normal[1],
            pose.drive.speed,
        )


class BetweenBorderAndFence(AbstractStart):
    """One corner touches the border and another the fence; the parcel rides with the belt."""

    place: Array
    drive_angle: Array
    fence_corner: int = eqx.field(static=True)
    border_corner: int = eqx.field(static=True)

    def time(self, drive):
        assert drive is not None
        return drive.time_at(self.drive_angle)

    def distance(self):
        return self.place

    def body(self, parcel, belt, pose):
        assert pose is not None
        ax, ay = parcel.corner(self.fence_corner)
        bx, by = parcel.corner(self.border_corner)
        # The line between the two corners rises by the height of the fence's point.
        length = jnp.sqrt((ax - bx) ** 2 + (ay - by) ** 2)
        rise = jnp.clip(pose.y / length, -1.0, 1.0)
        angle = jnp.arcsin(rise) - jnp.arctan2(ay - by, ax - bx)
        x, y = _turned(ax, ay, angle)
        zero = jnp.zeros_like(pose.x)
        speed = zero if belt is None else belt.speed
        return Body(pose.x - x, pose.y - y, angle, speed, zero, zero)
