"""Newton-Euler for a parcel on the belt, at the fence and at the border: the forces at an instant.

Everything a scene does not hold is `None` or an empty tuple here, and traces to nothing.
"""

from typing import TYPE_CHECKING, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from . import contact
from .drive import AbstractDrive, DriveMotion
from .fidelity import Fidelity
from .friction import Friction, belt_grip, corner_share
from .link import FencePoint, FlexibleLink

if TYPE_CHECKING:
    from .scenes import Scene


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


class BeltForce(NamedTuple):
    """Force [N] and moment [N m] of the belt on the parcel, and what they dissipate [W]."""

    x: Array
    y: Array
    moment: Array
    dissipated: Array


class Touch(NamedTuple):
    """Kinematics of a corner at a surface, with the surface's axes there in fixed axes.

    `foot_offset` [m] is how far along the surface the foot of the corner lies from the point U;
    `normal` and `tangent` are the directions (x, y, moment) in which a unit force acts on the
    parcel; `rates` is the velocity of U along the normal and the tangent [m/s].
    """

    gap: Array
    gap_rate: Array
    sliding: Array
    foot_offset: Array
    normal: tuple[Array, Array, Array]
    tangent: tuple[Array, Array, Array]
    rates: tuple[Array, Array]


class Response(NamedTuple):
    """How a contact answers to a small change: the law's derivatives in D [N/m] and in Ddot
    [N s/m], and that of the friction's share of N in the sliding speed [s/m]."""

    gap: Array
    gap_rate: Array
    sliding: Array
    share: Array


class Forces(NamedTuple):
    """Everything that acts on the parcel at an instant, and its acceleration.

    `laws` are the normal forces [N] that the contact law gives at the fence.
    """

    acceleration: Acceleration
    fence: tuple[Contact, ...]
    touches: tuple[Touch, ...]
    laws: tuple[Array, ...]
    border: tuple[Contact, ...]
    belt: BeltForce | None
    responses: tuple[Response, ...]
    belt_slopes: tuple[Array, Array] | None
    slip: tuple[Array, Array, Array] | None


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


def fence_touch(
    corner: Corner, point: FencePoint, turn: tuple[Array, Array], speed: Array
) -> Touch:
    """Gap (2.13), its rate (2.18) and sliding speed of a corner at a point U of the fence.

    D = -(C - U).n, Ddot = -(v_C - v_U).n, w = (v_C - v_U).t; `turn` is (cos, sin) of alpha_w and
    `speed` its rate [rad/s].
    """
    cosine, sine = turn
    # U and its velocity in fixed axes.
    across_x = point.x_rate - speed * point.y
    across_y = point.y_rate + speed * point.x
    offset_x = corner.x - (cosine * point.x - sine * point.y)
    offset_y = corner.y - (sine * point.x + cosine * point.y)
    fence_x, fence_y = cosine * across_x - sine * across_y, sine * across_x + cosine * across_y
    bend_cosine, bend_sine = jnp.cos(point.slope), jnp.sin(point.slope)
    x = cosine * bend_cosine - sine * bend_sine
    y = sine * bend_cosine + cosine * bend_sine
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


def border_touch(corner: Corner) -> Touch:
    """The same at the border y = 0: D = -y_C, Ddot = -v_C.(0, 1), w = v_C.(1, 0)."""
    zero, one = jnp.zeros_like(corner.x), jnp.ones_like(corner.x)
    return Touch(
        gap=-corner.y,
        gap_rate=-corner.y_rate,
        sliding=corner.x_rate,
        foot_offset=zero,
        normal=(zero, one, corner.arm_x),
        tangent=(one, zero, -corner.arm_y),
        rates=(zero, zero),
    )


def _stop(ahead: Array, square: Array, sliding: Array) -> Array:
    """Share t <= 1 at which s - t d is nearest to rest, given s.d and d.d; 1 where that lies
    beyond the step, or behind, or where s is not `sliding` but all but at rest."""
    turns = sliding & (ahead > 0) & (ahead < square)
    return jnp.where(turns, ahead / jnp.where(turns, square, 1.0), 1.0)


class FenceFrame(NamedTuple):
    """What the contacts need of the fence at an instant: (cos, sin) of alpha_w, its rate [rad/s],
    and for each of `fence_corners` the arc coordinate under it [m] and the share of the contact
    law that acts there [1]."""

    turn: tuple[Array, Array]
    speed: Array
    places: tuple[Array, ...]
    shares: tuple[Array, ...]


class Mechanics(eqx.Module):
    """The parts of a scene, made ready for one fidelity: what the forces need, worked out once."""

    mass: Array
    inertia: Array
    corners: dict[int, tuple[Array, Array]]
    stiffness: Array
    viscosity: Array
    belt_speed: Array | None
    belt_friction: Friction | None
    weight: Array | None
    mean_distance: Array | None
    size: Array
    link: FlexibleLink | None
    drive: AbstractDrive | None
    fence_friction: Friction | None
    border_friction: Friction | None
    fence_corners: tuple[int, ...] = eqx.field(static=True)
    border_corners: tuple[int, ...] = eqx.field(static=True)
    fidelity: Fidelity = eqx.field(static=True)

    def __init__(self, scene: "Scene", fidelity: Fidelity):
        parcel, belt = scene.parcel, scene.belt
        self.mass, self.inertia = parcel.mass, parcel.inertia
        self.fence_corners, self.border_corners = scene.fence_corners, scene.border_corners
        touching = sorted({*self.fence_corners, *self.border_corners})
        self.corners = {number: parcel.corner(number) for number in touching}
        self.stiffness, self.viscosity = parcel.stiffness, contact.viscosity(parcel)
        self.belt_speed = None if belt is None else belt.speed
        self.belt_friction = None if belt is None else belt.friction
        self.weight = None if belt is None else parcel.mass * belt.gravity
        self.mean_distance = None if belt is None else parcel.mean_distance
        self.size = jnp.sqrt(self.inertia / self.mass)
        self.link = None if scene.fence is None else FlexibleLink(scene.fence, fidelity)
        self.drive = scene.drive
        self.fence_friction = scene.fence_friction
        self.border_friction = None if scene.border is None else scene.border.friction
        self.fidelity = fidelity

    def arms(self, angle: Array) -> dict[int, tuple[Array, Array]]:
        """The corners that can touch, from C_s in fixed axes [m], at the parcel's `angle`."""
        if not self.corners:
            return {}
        cosine, sine = jnp.cos(angle), jnp.sin(angle)
        return {
            number: (cosine * x - sine * y, sine * x + cosine * y)
            for number, (x, y) in self.corners.items()
        }

    def fade(self, place: Array) -> Array:
        """Share of the contact law [1] that acts at an arc coordinate: 1 on the fence, 0 off it."""
        assert self.link is not None
        length = self.fidelity.tip_fade
        return contact.fade(place - self.link.reach, length) * contact.fade(-place, length)

    def frame(self, drive: DriveMotion | None, places: tuple[Array, ...]) -> FenceFrame | None:
        """The fence's frame at the drive's motion, with the corners' feet at `places`."""
        if drive is None:
            return None
        turn = (jnp.cos(drive.angle), jnp.sin(drive.angle))
        return FenceFrame(turn, drive.speed, places, tuple(self.fade(p) for p in places))

    def _contact(self, touch: Touch, friction: Friction | None, place, normal, share):
        """One contact: what it does, the law's normal force and its response.

        `normal` is the force where it is an unknown of its own, else `None`.
        """
        law = contact.kelvin(self.stiffness, self.viscosity, touch.gap, touch.gap_rate)
        if share is not None:
            law = contact.Kelvin(*(share * value for value in law))
        normal = law.force if normal is None else normal
        drag = by_sliding = jnp.zeros_like(normal)
        if friction is not None:
            drag, by_sliding = corner_share(friction, touch.sliding, self.fidelity.smoothing)
        what = Contact(normal, normal * drag, touch.gap, touch.gap_rate, place, touch.sliding)
        return what, law.force, Response(law.by_gap, law.by_rate, by_sliding, drag)

    def forces(
        self,
        body: Body,
        arms: dict[int, tuple[Array, Array]],
        frame: FenceFrame | None,
        points: tuple[FencePoint, ...],
        normals: tuple[Array, ...] | None = None,
    ) -> Forces:
        """Forces and acceleration at an instant.

        `points` are those of the fence under each of `fence_corners`. With `normals` the forces
        [N] of the fence are taken from there instead of from the contact law.
        """
        total = [jnp.zeros_like(body.x)] * 3
        touches, fence, border, laws, responses = [], [], [], [], []

        for k, number in enumerate(self.fence_corners):
            assert frame is not None
            corner = corner_from_arm(body, *arms[number])
            parts = fence_touch(corner, points[k], frame.turn, frame.speed)
            given = None if normals is None else normals[k]
            what, law, response = self._contact(
                parts, self.fence_friction, frame.places[k], given, frame.shares[k]
            )
            touches.append(parts)
            fence.append(what)
            laws.append(law)
            responses.append(response)

        for number in self.border_corners:
            corner = corner_from_arm(body, *arms[number])
            parts = border_touch(corner)
            what, _, response = self._contact(parts, self.border_friction, corner.x, None, None)
            touches.append(parts)
            border.append(what)
            responses.append(response)

        for what, parts in zip((*fence, *border), touches, strict=True):
            total = [
                q + what.normal * n + what.friction * t
                for q, n, t in zip(total, parts.normal, parts.tangent, strict=True)
            ]

        belt, belt_slopes, slip = None, None, None
        if self.belt_friction is not None:
            belt, belt_slopes = self._belt(body)
            slip = (body.x_rate - self.belt_speed, body.y_rate, body.spin)
            total = [q + f for q, f in zip(total, belt[:3], strict=True)]

        return Forces(
            Acceleration(total[0] / self.mass, total[1] / self.mass, total[2] / self.inertia),
            tuple(fence),
            tuple(touches),
            tuple(laws),
            tuple(border),
            belt,
            tuple(responses),
            belt_slopes,
            slip,
        )

    def _belt(self, body: Body):
        """The belt's force, and (grip, d grip / d s^2)."""
        square_arm = self.mean_distance**2
        slip_x, slip_y = self.belt_speed - body.x_rate, -body.y_rate
        square = slip_x**2 + slip_y**2 + square_arm * body.spin**2
        grip, bend = belt_grip(self.belt_friction, self.weight, square, self.fidelity.smoothing)
        force = BeltForce(
            grip * slip_x, grip * slip_y, -grip * square_arm * body.spin, grip * square
        )
        return force, (grip, bend)

    def force_scale(self, forces: Forces) -> Array:
        """Size of the forces at play [N]: the normal ones, and the weight on a belt."""
        scale = jnp.full_like(forces.acceleration.x, 1e-6)
        if self.weight is not None:
            scale = scale + self.weight
        for what, law in zip(forces.fence, forces.laws, strict=True):
            scale = scale + jnp.abs(what.normal) + law
        for what in forces.border:
            scale = scale + what.normal
        return scale

    def reversal(self, forces: Forces, change) -> Array:
        """Share of a change of the velocities, `-change`, up to which no friction passes its jump:
        where a sliding speed, or the slip on the belt, would turn round."""
        share = jnp.ones_like(forces.acceleration.x)
        rest = (0.3 * self.fidelity.slip_speed) ** 2
        for what, parts in zip((*forces.fence, *forces.border), forces.touches, strict=True):
            turn = sum(t * c for t, c in zip(parts.tangent, change, strict=True))
            share = jnp.minimum(share, _stop(what.sliding * turn, turn**2, what.sliding**2 > rest))
        if forces.slip is not None:
            x, y, spin = forces.slip
            square_arm = self.mean_distance**2
            ahead = x * change[0] + y * change[1] + square_arm * spin * change[2]
            square = change[0] ** 2 + change[1] ** 2 + square_arm * change[2] ** 2
            slipping = x**2 + y**2 + square_arm * spin**2 > rest
            share = jnp.minimum(share, _stop(ahead, square, slipping))
        return share

    def rate_matrix(self, body: Body, forces: Forces, step: float, unknown_normals: bool):
        """-d(generalised force)/d(velocities) [N s/m], 3 x 3, at frozen directions and arms, where
        positions follow the velocities by `step` / 3.

        With `unknown_normals` the normal forces at the fence are held.
        """
        zero = jnp.zeros_like(body.x)
        matrix = [[zero] * 3 for _ in range(3)]
        if forces.belt_slopes is not None:
            grip, bend = forces.belt_slopes
            square_arm = self.mean_distance**2
            slip = (body.x_rate - self.belt_speed, body.y_rate, square_arm * body.spin)
            weights = (1.0, 1.0, square_arm)
            for i in range(3):
                for j in range(3):
                    matrix[i][j] = 2 * bend * slip[i] * slip[j]
                matrix[i][i] = matrix[i][i] + grip * weights[i]
        contacts = (*forces.fence, *forces.border)
        for k, (what, parts, response) in enumerate(
            zip(contacts, forces.touches, forces.responses, strict=True)
        ):
            held = unknown_normals and k < len(forces.fence)
            slide = what.normal * response.sliding
            press = response.gap * step / 3 + response.gap_rate
            for i in range(3):
                along = parts.normal[i] + response.share * parts.tangent[i]
                for j in range(3):
                    change = -slide * parts.tangent[i] * parts.tangent[j]
                    if not held:
                        change = change + press * along * parts.normal[j]
                    matrix[i][j] = matrix[i][j] + change
        return matrix
