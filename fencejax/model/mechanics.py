"""Newton-Euler for a parcel on the belt, at the fence and at still surfaces: the forces at an
instant, and their derivatives.

Parts that a scene does not have are `None` or an empty tuple here, and trace to nothing.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from .._elementary import cos_sin
from ..fidelity import Fidelity
from ..parts import (
    SIDES,
    AbstractContactLaw,
    AbstractDrive,
    AbstractFriction,
    AbstractSurface,
    DriveMotion,
    NormalForce,
    turned,
)
from ..scenes import Body, Scene
from .belt_contact import BeltContact, BeltDefect, BeltForce, BeltSlip
from .fading import fade
from .fence_geometry import FencePoint
from .flexible_link import FlexibleLink
from .friction import corner_share
from .kinematics import Acceleration, TipLoad, Touch, corner_from_arm, fence_touch, surface_touch
from .tip import LEAST_SHARE, Side, around

_PREVIOUS_CORNER = {end: begin for begin, end in SIDES.items()}


class Contact(NamedTuple):
    """The state of one corner at the fence or at a still surface.

    `normal` N [N]; `friction` F [N] along the tangent; `gap` D [m], positive inside; `gap_rate`
    [m/s]; `place` [m], the arc coordinate on the fence, x on the border or the coordinate along
    another surface; `sliding` w [m/s].
    """

    normal: Array
    friction: Array
    gap: Array
    gap_rate: Array
    place: Array
    sliding: Array


class Response(NamedTuple):
    """A contact's derivatives: of the law in D [N/m] and in Ddot [N s/m], and of the friction's
    share of N in the sliding speed [s/m]; and that share [1]."""

    gap: Array
    gap_rate: Array
    sliding: Array
    share: Array


class Meeting(NamedTuple):
    """One corner at one surface: its state, the kinematics, the normal force [N] by the contact
    law, and the derivatives."""

    contact: Contact
    touch: Touch
    law: Array | None
    response: Response | None

    def outcome(self) -> "Meeting":
        """The part that is needed after the step is solved: without derivatives, and with
        directions only where they do not follow from the fence's slope."""
        normal = () if self.touch.tip_load is None else self.touch.normal
        return Meeting(self.contact, self.touch._replace(normal=normal, tangent=()), None, None)


class Forces(NamedTuple):
    """Everything that acts on the parcel at an instant, and its acceleration: by corner at the
    fence, at the border, and at each of the other surfaces."""

    acceleration: Acceleration
    fence: tuple[Meeting, ...]
    border: tuple[Meeting, ...]
    surfaces: tuple[tuple[Meeting, ...], ...]
    belt: BeltForce | None
    belt_slopes: tuple[Array, Array] | None
    slip: BeltSlip | None

    @property
    def still(self) -> tuple[Meeting, ...]:
        """The meetings at still surfaces."""
        return sum(self.surfaces, self.border)

    @property
    def meetings(self) -> tuple[Meeting, ...]:
        """All meetings, in the order of `Mechanics.frictions`."""
        return self.fence + self.still

    def outcome(self) -> "Forces":
        """The part of them that is needed after the step is solved."""
        fence, border, *surfaces = (
            tuple(meeting.outcome() for meeting in group)
            for group in (self.fence, self.border, *self.surfaces)
        )
        return Forces(self.acceleration, fence, border, tuple(surfaces), self.belt, None, None)


class FenceFrame(NamedTuple):
    """The fence at an instant, as the contacts need it: (cos, sin) of alpha_w, its rate [rad/s],
    and for each of `fence_corners` the arc coordinate under it [m], the share of the contact law
    that acts there [1] and, where the tip may carry the contact, the arc [m] from the point where
    the fence is loaded to the tip."""

    turn: tuple[Array, Array]
    speed: Array
    places: tuple[Array, ...]
    shares: tuple[Array, ...]
    edges: tuple[Array, ...]


class Mechanics(eqx.Module):
    """The parts of a scene, prepared for one fidelity: all that the forces need, computed once."""

    mass: Array
    inertia: Array
    corners: dict[int, tuple[Array, Array]]
    sides: dict[int, Array]
    before: dict[int, Array]
    edge_radius: Array | None
    law: AbstractContactLaw
    viscosity: Array
    belt: BeltContact | None
    size: Array
    link: FlexibleLink | None
    drive: AbstractDrive | None
    fence_friction: AbstractFriction | None
    border: AbstractSurface | None
    surfaces: tuple[AbstractSurface, ...]
    fence_corners: tuple[int, ...] = eqx.field(static=True)
    border_corners: tuple[int, ...] = eqx.field(static=True)
    surface_corners: tuple[int, ...] = eqx.field(static=True)
    fidelity: Fidelity = eqx.field(static=True)

    def __init__(self, scene: Scene, fidelity: Fidelity):
        parcel, belt = scene.parcel, scene.belt
        self.mass, self.inertia = parcel.mass, parcel.inertia
        self.fence_corners, self.border_corners = scene.fence_corners, scene.border_corners
        self.surface_corners = scene.surface_corners if scene.surfaces else ()
        self.sides, self.before, self.edge_radius = {}, {}, None
        if scene.tip_contact:
            self.edge_radius = None if scene.fence is None else scene.fence.edge_radius
            self.sides = {number: parcel.side(number) for number in self.fence_corners}
            alone = (n for n in self.fence_corners if _PREVIOUS_CORNER[n] not in self.fence_corners)
            self.before = {number: parcel.side(_PREVIOUS_CORNER[number]) for number in alone}
        behind = {SIDES[number] for number in self.sides}
        still = {*self.border_corners, *self.surface_corners}
        touching = sorted({*self.fence_corners, *still, *behind})
        self.corners = {number: parcel.corner(number) for number in touching}
        self.law = parcel.contact_law
        self.viscosity = self.law.viscosity(parcel.mass)
        self.belt = None if belt is None else BeltContact.of(belt, parcel)
        self.size = jnp.sqrt(self.inertia / self.mass)
        self.link = None
        if scene.fence is not None:
            self.link = FlexibleLink(scene.fence, fidelity, scene.drive)
        self.drive = scene.drive
        self.fence_friction = scene.fence_friction
        self.border, self.surfaces = scene.border, scene.surfaces
        self.fidelity = fidelity

    @property
    def frictions(self) -> tuple[AbstractFriction | None, ...]:
        """The friction of each contact, in the order of `Forces.meetings`."""
        found = (self.fence_friction,) * len(self.fence_corners)
        if self.border is not None:
            found += (self.border.friction,) * len(self.border_corners)
        for surface in self.surfaces:
            found += (surface.friction,) * len(self.surface_corners)
        return found

    def arms(self, angle: Array) -> dict[int, tuple[Array, Array]]:
        """The corners that can touch, from C_s in fixed axes [m], at the parcel's `angle`."""
        if not self.corners:
            return {}
        turn = cos_sin(angle)
        return {number: turned(turn, x, y) for number, (x, y) in self.corners.items()}

    def fade(self, place: Array) -> Array:
        """Share of the contact law [1] that acts at an arc coordinate: 1 on the fence, 0 off it.
        Where the tip may carry the contact, it does not end at the tip."""
        assert self.link is not None
        length = self.fidelity.tip_fade
        on_link = fade(-place, length)
        return on_link if self.sides else fade(place - self.link.reach, length) * on_link

    def frame(
        self,
        drive: DriveMotion | None,
        places: tuple[Array, ...],
        loaded: tuple[Array, ...] | None = None,
        gone: tuple[Array, ...] = (),
    ) -> FenceFrame | None:
        """The fence's frame at the drive's motion, with the corners' feet at `places`.

        The fence is loaded there or, where the tip may carry a contact, at the places `loaded`.
        `gone`, if given, is 1 for a corner that has left over the tip and does not meet the fence
        from behind, else 0.
        """
        if drive is None:
            return None
        shares = tuple(self.fade(p) for p in places)
        if gone:
            shares = tuple(share * (1 - g) for share, g in zip(shares, gone, strict=True))
        edges = ()
        if self.sides:
            assert self.link is not None
            edges = tuple(self.link.reach - p for p in (places if loaded is None else loaded))
        return FenceFrame(cos_sin(drive.angle), drive.speed, places, shares, edges)

    def loaded(self, place: Array, tip_load: TipLoad) -> Array:
        """Arc coordinate [m] at which a contact loads the fence, of a corner's foot at `place`."""
        assert self.link is not None
        last = self.link.reach
        if self.edge_radius is not None:
            last = last + self.edge_radius / LEAST_SHARE
        return jnp.minimum(place + tip_load.shift, last)

    def belt_defect(self, was: Body, now: Body) -> BeltDefect | None:
        """The result of `BeltContact.defect`; `None` without a belt."""
        return None if self.belt is None else self.belt.defect(self.fidelity.smoothing, was, now)

    def drag(self, sliding: Array) -> Array:
        """Friction on the fence along its tangent, over N [1], of a corner that slides there at a
        speed [m/s]."""
        if self.fence_friction is None:
            return jnp.zeros_like(sliding)
        return -corner_share(self.fence_friction, sliding, self.fidelity.smoothing)[0]

    def gone(self, before: Array, place: Array, touch: Touch) -> Array:
        """Whether a corner has left over the tip: from where its force has faded, until it is no
        longer behind the fence's line."""
        assert self.link is not None
        over = place > self.link.reach + self.fidelity.tip_fade
        if touch.lasting is not None:
            over = touch.remaining(1.0) <= 0
        return jnp.where(touch.gap <= 0, 0.0, jnp.where(over, 1.0, before))

    def ends(self, k: int, what: Contact, touch: Touch) -> Array:
        """Whether the force of the k-th corner at the fence ends beyond the tip, and nothing in the
        scene takes over from it."""
        assert self.link is not None
        if touch.lasting is None:
            return (what.place > self.link.reach) & (what.gap > 0) & (what.normal > 0)
        if SIDES[self.fence_corners[k]] in self.fence_corners:
            return jnp.zeros_like(what.normal, dtype=bool)
        return (what.normal > 0) & (touch.lasting < 1)

    def _side(self, number: int, arms: dict[int, tuple[Array, Array]]) -> Side:
        (x, y), (end_x, end_y) = arms[number], arms[SIDES[number]]
        length = self.sides[number]
        return Side(
            (end_x - x) / length,
            (end_y - y) / length,
            length,
            SIDES[number] in self.fence_corners,
            self.before.get(number),
        )

    def _meeting(
        self, touch: Touch, friction: AbstractFriction | None, place, normal, share
    ) -> Meeting:
        """One contact. `normal` is the force where it is an unknown of its own, else `None`."""
        law = self.law.force(touch.gap, touch.gap_rate, self.viscosity)
        if share is not None:
            law = NormalForce(*(share * value for value in law))
        normal = law.force if normal is None else normal
        drag = by_sliding = jnp.zeros_like(normal)
        if friction is not None:
            drag, by_sliding = corner_share(friction, touch.sliding, self.fidelity.smoothing)
        what = Contact(normal, normal * drag, touch.gap, touch.gap_rate, place, touch.sliding)
        response = Response(law.by_gap, law.by_rate, by_sliding, drag)
        return Meeting(what, touch, law.force, response)

    def _at_surface(
        self,
        surface: AbstractSurface,
        corners: tuple[int, ...],
        body: Body,
        arms: dict[int, tuple[Array, Array]],
    ) -> tuple[Meeting, ...]:
        """The meetings at a still surface. Beyond its end the contact law ends as at the fence's
        hinge."""
        found = []
        for number in corners:
            corner = corner_from_arm(body, *arms[number])
            point = surface.at(corner.x, corner.y)
            share = None
            if point.beyond is not None:
                share = fade(point.beyond, self.fidelity.tip_fade)
            touch = surface_touch(corner, point)
            found.append(self._meeting(touch, surface.friction, point.place, None, share))
        return tuple(found)

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

        Newton-Euler in fixed axes: m_p (xddot, yddot) = sum of N n + F t over the corners, plus
        the belt's force; I_p phiddot = sum of their moments about C_s. It holds for any corners at
        the fence and at the border.

        Paper: (2.3)-(2.7), (2.31)-(2.33). There in polar coordinates about the hinge, stage by
        stage and corner by corner.
        """
        total = [jnp.zeros_like(body.x)] * 3
        fence = []

        for k, number in enumerate(self.fence_corners):
            assert frame is not None
            corner = corner_from_arm(body, *arms[number])
            parts = fence_touch(corner, points[k], frame.turn, frame.speed)
            share = frame.shares[k]
            if self.sides:
                side, length = self._side(number, arms), self.fidelity.tip_fade
                parts = around(
                    parts, body.spin, side, frame.edges[k], length, self.edge_radius
                )
                share = parts.remaining(share)
            given = None if normals is None else normals[k]
            meeting = self._meeting(parts, self.fence_friction, frame.places[k], given, share)
            fence.append(meeting)

        border = ()
        if self.border is not None:
            border = self._at_surface(self.border, self.border_corners, body, arms)
        surfaces = tuple(
            self._at_surface(surface, self.surface_corners, body, arms) for surface in self.surfaces
        )
        for what, parts, _, _ in (*fence, *border, *sum(surfaces, ())):
            total = [
                q + what.normal * n + what.friction * t
                for q, n, t in zip(total, parts.normal, parts.tangent, strict=True)
            ]

        belt, belt_slopes, slip = None, None, None
        if self.belt is not None:
            belt, belt_slopes = self.belt.force(body, self.fidelity.smoothing)
            slip = self.belt.slip(body)
            total = [q + f for q, f in zip(total, belt[:3], strict=True)]

        return Forces(
            self.acceleration(*total),
            tuple(fence),
            border,
            surfaces,
            belt,
            belt_slopes,
            slip,
        )

    def acceleration(self, x: Array, y: Array, moment: Array) -> Acceleration:
        """The parcel's acceleration by a force [N] and its moment about C_s [N m]."""
        # The compiler divides once, and multiplies wherever an inverse stands.
        return Acceleration(x * (1 / self.mass), y * (1 / self.mass), moment * (1 / self.inertia))

    def force_scale(self, forces: Forces) -> Array:
        """Size of the forces [N], never 0: of the normal forces, and of the weight on a belt."""
        scale = jnp.full_like(forces.acceleration.x, 1e-6)
        if self.belt is not None:
            scale = scale + self.belt.weight
        for meeting in forces.meetings:
            scale = scale + jnp.abs(meeting.contact.normal)
        for meeting in forces.fence:
            if meeting.law is not None:
                scale = scale + meeting.law
        return scale

    def lightness(self, parts: Touch, other: Touch | None = None) -> Array:
        """A corner's acceleration by a unit force along its surface, there or at an `other`
        [1/kg]."""
        x, y, turn = parts.tangent
        forced = parts.tangent if other is None else other.tangent
        pushed = (x * forced[0] + y * forced[1]) * (1 / self.mass)
        return pushed + turn * forced[2] * (1 / self.inertia)


def force_tolerance(dtype) -> float:
    """Tolerated unbalanced force over the forces: 5e-7 in double precision, 2e-3 in single."""
    return float(jnp.finfo(dtype).eps) ** 0.4
