"""Newton-Euler for a parcel on the belt, at the fence and at the border: the forces at an instant.

Everything a scene does not hold is `None` or an empty tuple here, and traces to nothing.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from . import contact
from .belt import Belt, Border
from .drive import AbstractDrive, DriveMotion
from .fidelity import Fidelity
from .friction import BeltForce, Friction, Smoothing, belt_friction, corner_friction
from .link import FencePoint, FlexibleLink
from .parcel import Parcel


class Body(NamedTuple):
    """Motion of the parcel: C_s at (x, y) [m], angle phi [rad], and their rates."""

    x: Array
    y: Array
    angle: Array
    x_rate: Array
    y_rate: Array
    spin: Array


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


class Contact(NamedTuple):
    """What happens at one corner, against the fence or the border.

    `normal` N [N]; `friction` F [N] along the tangent; `gap` D [m], positive inside; `gap_rate`
    [m/s]; `place` [m], the arc coordinate on the fence or x on the border; `sliding` w [m/s].
    """

    normal: Array
    friction: Array
    gap: Array
    gap_rate: Array
    place: Array
    sliding: Array


class Touch(NamedTuple):
    """Kinematics of a corner at the fence, with the fence's axes there."""

    gap: Array
    gap_rate: Array
    sliding: Array
    foot_offset: Array
    normal_x: Array
    normal_y: Array
    tangent_x: Array
    tangent_y: Array
    fence_normal_rate: Array
    fence_tangent_rate: Array


class Forces(NamedTuple):
    """Everything that acts on the parcel at an instant, and its acceleration."""

    acceleration: Acceleration
    fence: tuple[Contact, ...]
    touches: tuple[Touch, ...]
    border: tuple[Contact, ...]
    belt: BeltForce | None


def corner_from_arm(body: Body, arm_x: Array, arm_y: Array) -> Corner:
    """Position and velocity of the point of the parcel at `arm` from C_s, in fixed axes."""
    return Corner(
        arm_x,
        arm_y,
        body.x + arm_x,
        body.y + arm_y,
        body.x_rate - body.spin * arm_y,
        body.y_rate + body.spin * arm_x,
    )


def touch(corner: Corner, point: FencePoint, turn: tuple[Array, Array], speed: Array) -> Touch:
    """Gap (2.13), its rate (2.18) and sliding speed of a corner at a point U of the fence.

    D = -(C - U).n, Ddot = -(v_C - v_U).n, w = (v_C - v_U).t; `turn` is (cos, sin) of alpha_w and
    `speed` its rate. `foot_offset` = (C - U).t is how far along the fence the foot of the
    perpendicular lies from U.
    """
    cos_drive, sin_drive = turn
    cos_slope, sin_slope = jnp.cos(point.slope), jnp.sin(point.slope)
    # The corner in the frame that turns with the rigid link.
    x = corner.x * cos_drive + corner.y * sin_drive - point.x
    y = corner.y * cos_drive - corner.x * sin_drive - point.y
    x_rate = corner.x_rate * cos_drive + corner.y_rate * sin_drive
    y_rate = corner.y_rate * cos_drive - corner.x_rate * sin_drive
    fence_x_rate = point.x_rate - speed * point.y
    fence_y_rate = point.y_rate + speed * point.x
    slip_x, slip_y = x_rate - fence_x_rate, y_rate - fence_y_rate
    tangent_x = cos_drive * cos_slope - sin_drive * sin_slope
    tangent_y = sin_drive * cos_slope + cos_drive * sin_slope
    return Touch(
        gap=x * sin_slope - y * cos_slope,
        gap_rate=slip_x * sin_slope - slip_y * cos_slope,
        sliding=slip_x * cos_slope + slip_y * sin_slope,
        foot_offset=x * cos_slope + y * sin_slope,
        normal_x=-tangent_y,
        normal_y=tangent_x,
        tangent_x=tangent_x,
        tangent_y=tangent_y,
        fence_normal_rate=fence_y_rate * cos_slope - fence_x_rate * sin_slope,
        fence_tangent_rate=fence_x_rate * cos_slope + fence_y_rate * sin_slope,
    )


class Mechanics(eqx.Module):
    """The parts of a scene, made ready for one fidelity."""

    parcel: Parcel
    belt: Belt | None
    link: FlexibleLink | None
    drive: AbstractDrive | None
    fence_friction: Friction | None
    border: Border | None
    fence_corners: tuple[int, ...] = eqx.field(static=True)
    border_corners: tuple[int, ...] = eqx.field(static=True)
    fidelity: Fidelity = eqx.field(static=True)

    @property
    def smoothing(self) -> Smoothing:
        return self.fidelity.smoothing

    def arms(self, angle: Array) -> dict[int, tuple[Array, Array]]:
        """The corners that can touch, from C_s in fixed axes [m], at the parcel's `angle`."""
        cosine, sine = jnp.cos(angle), jnp.sin(angle)
        arms = {}
        for number in sorted({*self.fence_corners, *self.border_corners}):
            x, y = self.parcel.corner(number)
            arms[number] = (cosine * x - sine * y, sine * x + cosine * y)
        return arms

    def fade(self, place: Array) -> Array:
        """Share of the contact law [1] that acts at an arc coordinate: 1 on the fence, 0 off it."""
        assert self.link is not None
        length = self.fidelity.tip_fade
        return contact.fade(place - self.link.reach, length) * contact.fade(-place, length)

    def fence_law(self, parts: Touch, place: Array) -> Array:
        """Normal force [N] of the fence on a corner, ended beyond the fence's two ends."""
        force = contact.normal_force(self.parcel, parts.gap, parts.gap_rate)
        return self.fade(place) * force

    def forces(
        self,
        body: Body,
        arms: dict[int, tuple[Array, Array]],
        drive: DriveMotion | None,
        points: tuple[FencePoint, ...],
        places: tuple[Array, ...],
        normals: tuple[Array, ...] | None = None,
    ) -> Forces:
        """Forces and acceleration at an instant.

        `points` and `places` are those of the fence under each of `fence_corners`. With `normals`
        the forces [N] of the fence are taken from there instead of from the contact law.
        """
        zero = jnp.zeros_like(body.x)
        force_x, force_y, moment = zero, zero, zero
        fence, touches, border = [], [], []

        for k, number in enumerate(self.fence_corners):
            assert drive is not None
            corner = corner_from_arm(body, *arms[number])
            turn = (jnp.cos(drive.angle), jnp.sin(drive.angle))
            parts = touch(corner, points[k], turn, drive.speed)
            normal = self.fence_law(parts, places[k]) if normals is None else normals[k]
            x, y = normal * parts.normal_x, normal * parts.normal_y
            friction = zero
            if self.fence_friction is not None:
                friction = corner_friction(
                    self.fence_friction, normal, parts.sliding, self.smoothing
                )
                x = x + friction * parts.tangent_x
                y = y + friction * parts.tangent_y
            force_x, force_y = force_x + x, force_y + y
            moment = moment + corner.arm_x * y - corner.arm_y * x
            touches.append(parts)
            fence.append(
                Contact(normal, friction, parts.gap, parts.gap_rate, places[k], parts.sliding)
            )

        for number in self.border_corners:
            assert self.border is not None
            corner = corner_from_arm(body, *arms[number])
            normal = contact.normal_force(self.parcel, -corner.y, -corner.y_rate)
            friction = zero
            if self.border.friction is not None:
                friction = corner_friction(
                    self.border.friction, normal, corner.x_rate, self.smoothing
                )
            force_x, force_y = force_x + friction, force_y + normal
            moment = moment + corner.arm_x * normal - corner.arm_y * friction
            border.append(
                Contact(normal, friction, -corner.y, -corner.y_rate, corner.x, corner.x_rate)
            )

        grip = None
        if self.belt is not None:
            grip = belt_friction(
                self.belt.friction,
                self.parcel,
                self.parcel.mass * self.belt.gravity,
                self.belt.speed - body.x_rate,
                -body.y_rate,
                body.spin,
                self.smoothing,
            )
            force_x, force_y = force_x + grip.x, force_y + grip.y
            moment = moment + grip.moment

        mass, inertia = self.parcel.mass, self.parcel.inertia
        return Forces(
            Acceleration(force_x / mass, force_y / mass, moment / inertia),
            tuple(fence),
            tuple(touches),
            tuple(border),
            grip,
        )
