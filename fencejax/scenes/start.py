"""The start of a scene: the time on the drive's clock, and the parcel's position and velocity."""

import abc
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from .. import _check
from .._check import Bounds
from ..parts import (
    AbstractDrive,
    AbstractTorqueDrive,
    Belt,
    DriveMotion,
    Fence,
    Parcel,
    turned,
)
from ..printing import Part
from .body import Body
from .names import BY_PATH

MOTION_BOUNDS = {
    "x": Bounds("m", size=1.0),
    "y": Bounds("m", size=1.0),
    "angle": Bounds("rad", size=10.0),
    "x_rate": Bounds("m/s", size=1.0),
    "y_rate": Bounds("m/s", size=1.0),
    "spin": Bounds("rad/s", size=1.0),
}
"""The bounds of a parcel's motion at the start, by the fields of `Body`."""


class Pose(eqx.Module):
    """The fence at the start time, as a start may use it: the point U at an arc coordinate and the
    slope there, in fixed axes, and the drive's motion.

    >>> motion = fj.HarmonicDrive().motion(0.2)
    >>> fj.scenes.Pose(x=1.0, y=0.3, slope=0.3, normal_rate=1.5, drive=motion).slope
    0.3
    """

    x: Array
    y: Array
    slope: Array
    normal_rate: Array
    drive: DriveMotion


class AbstractStart(Part):
    """Initial conditions of a scene.

    >>> scene = fj.scenes.whole_sort()
    >>> isinstance(scene.start, fj.scenes.AbstractStart)
    True
    """

    def _unit(self, name):
        found = BY_PATH.get(f"start.{name}")
        return super()._unit(name) if found is None else found.unit

    def time(self, drive: AbstractDrive | None, fence: Fence | None = None) -> Array | None:
        """Time [s] on the drive's clock; `None` for 0, where the fence is at rest. The time on a
        torque drive depends on the `fence`."""
        del drive, fence
        return None

    def distance(self) -> Array | None:
        """Arc coordinate [m] of the fence's point that the start refers to, or `None`."""
        return None

    def motion_given(self) -> dict[str, Array]:
        """What is given of the parcel's motion as numbers, by the fields of `Body`."""
        return {}

    @abc.abstractmethod
    def body(self, parcel: Parcel, belt: Belt | None, pose: Pose | None) -> Body:
        """The parcel's motion at the start."""


class AsGiven(AbstractStart):
    """The parcel's motion, given explicitly.

    >>> scene = fj.scenes.free_motion(velocity=(0.0, 0.5, 0.0))
    >>> f"{scene.start.motion.y_rate:.1f} m/s"
    '0.5 m/s'
    """

    motion: Body

    def motion_given(self):
        return self.motion._asdict()

    def body(self, parcel, belt, pose):
        del parcel, belt, pose
        return self.motion


class OnBelt(AbstractStart):
    """The parcel rides with the belt: its foremost point at x = `front`, its lowest `offset` from
    the border, turned by `angle`, when the drive starts.

    >>> scene = fj.scenes.whole_sort(front=0.15, offset=0.1)
    >>> scene.start
    OnBelt(front=150 mm, offset=100 mm, angle=0 rad)
    """

    front: Array
    offset: Array
    angle: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "front": Bounds("m", size=1.0),
        "offset": Bounds("m", least=0, size=1.0),
        "angle": Bounds("rad", size=10.0),
    }

    def __init__(self, front: ArrayLike, offset: ArrayLike, angle: ArrayLike):
        """**Arguments:** `front` [m]; `offset` [m], at least 0; `angle` [rad]."""
        _check.fields(self, front=front, offset=offset, angle=angle)

    def body(self, parcel, belt, pose):
        del pose
        turn = jnp.cos(self.angle), jnp.sin(self.angle)
        corners = [turned(turn, *parcel.corner(k)) for k in (1, 2, 3, 4)]
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


class AbstractStartAtFence(AbstractStart):
    """A start with the parcel on the fence at the arc coordinate `place` [m], when the drive is at
    `drive_angle` [rad] on its way out. The fence has swung free of contact since t = 0. On a torque
    drive this is the time at which a rigid fence would be at the angle."""

    place: eqx.AbstractVar[Array]
    drive_angle: eqx.AbstractVar[Array]

    def time(self, drive, fence=None):
        assert drive is not None
        if isinstance(drive, AbstractTorqueDrive):
            assert fence is not None
            return drive.time_at(self.drive_angle, fence.inertia)
        return drive.time_at(self.drive_angle)

    def distance(self):
        return self.place

    @staticmethod
    def _touching(pose: Pose, arm: tuple[Array, Array], angle: Array, velocity) -> Body:
        """The parcel at an angle and a velocity with the corner at `arm` on the fence's point."""
        x, y = turned((jnp.cos(angle), jnp.sin(angle)), *arm)
        return Body(pose.x - x, pose.y - y, angle, *velocity)


def _riding(belt: Belt | None, pose: Pose):
    """The velocity of a parcel that rides with the belt."""
    zero = jnp.zeros_like(pose.x)
    return zero if belt is None else belt.speed, zero, zero


class AtTouch(AbstractStartAtFence):
    """A corner touches the fence (D = 0) at an arc coordinate, on the drive's way out.

    The parcel rides with the belt (or moves as given), turned so that C_s lies on the fence's
    normal through the corner, or by a given angle.

    >>> scene = fj.scenes.oblique_impact(distance=0.9)
    >>> scene.start
    AtTouch(place=900 mm, drive_angle=0.3 rad, corner=1)
    """

    place: Array
    drive_angle: Array
    parcel_angle: Array | None
    velocity: tuple[Array, Array, Array] | None
    corner: int = eqx.field(static=True)

    def motion_given(self):
        given = {} if self.parcel_angle is None else {"angle": self.parcel_angle}
        if self.velocity is not None:
            given |= dict(zip(("x_rate", "y_rate", "spin"), self.velocity, strict=True))
        return given

    def body(self, parcel, belt, pose):
        assert pose is not None
        arm = parcel.corner(self.corner)
        tangent = pose.drive.angle + pose.slope
        if self.parcel_angle is None:
            # R(phi)(-arm) points along the normal, tangent + pi / 2.
            angle = tangent + jnp.pi / 2 - jnp.arctan2(-arm[1], -arm[0])
            angle = angle - 2 * jnp.pi * jnp.round(jax.lax.stop_gradient(angle) / (2 * jnp.pi))
        else:
            angle = self.parcel_angle
        velocity = _riding(belt, pose) if self.velocity is None else self.velocity
        return self._touching(pose, arm, angle, velocity)


class FlushOnFence(AbstractStartAtFence):
    """The parcel's lower side lies on the fence (D = 0), C_s over the arc coordinate `place`.

    It turns and advances with the fence, and slides along it at the component of the belt's
    velocity in that direction.

    >>> scene = fj.scenes.along_fence(distance=0.7)
    >>> scene.start
    FlushOnFence(place=700 mm, drive_angle=0.25 rad)
    """

    place: Array
    drive_angle: Array

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


class BetweenBorderAndFence(AbstractStartAtFence):
    """One corner touches the border and another the fence; the parcel rides with the belt.

    >>> scene = fj.scenes.border_and_fence(distance=0.9)
    >>> scene.start
    BetweenBorderAndFence(place=900 mm, drive_angle=0.1 rad, fence_corner=1, border_corner=2)
    """

    place: Array
    drive_angle: Array
    fence_corner: int = eqx.field(static=True)
    border_corner: int = eqx.field(static=True)

    def body(self, parcel, belt, pose):
        assert pose is not None
        ax, ay = parcel.corner(self.fence_corner)
        bx, by = parcel.corner(self.border_corner)
        # The line between the two corners rises by the height of the fence's point.
        length = jnp.sqrt((ax - bx) ** 2 + (ay - by) ** 2)
        rise = jnp.clip(pose.y / length, -1.0, 1.0)
        angle = jnp.arcsin(rise) - jnp.arctan2(ay - by, ax - bx)
        return self._touching(pose, (ax, ay), angle, _riding(belt, pose))
