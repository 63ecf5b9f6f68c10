"""Forces that follow from the state alone: at the start of a scene, and for general integrators."""

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .drive import DriveMotion
from .instant import FenceState
from .kinematics import Body, Lean
from .link import FlexibleLink, Vibration
from .mechanics import Forces, Mechanics


def foot(
    link: FlexibleLink, x: Array, y: Array, vibration: Vibration, drive: DriveMotion
) -> Array:
    """Arc coordinate [m] of the foot of the perpendicular from the point (x, y) [m] to the fence.

    Newton's method from the foot on the straight fence: sigma += (C - U).t, four times; the error
    falls by the factor curvature x gap each time. The last two are differentiated, which leaves
    that factor squared in the derivative.
    """
    cosine, sine = jnp.cos(drive.angle), jnp.sin(drive.angle)
    along, across = x * cosine + y * sine, y * cosine - x * sine

    def closer(given, place):
        link, vibration, along, across = given
        point = link.point(link.shape(place), vibration)
        offset = (along - point.x) * jnp.cos(point.slope)
        return place + offset + (across - point.y) * jnp.sin(point.slope)

    given = (link, vibration, along, across)
    fixed = jax.lax.stop_gradient(given)
    near = jax.lax.fori_loop(0, 2, lambda _, place: closer(fixed, place), fixed[2])
    return closer(given, closer(given, near))


def at_state(
    mechanics: Mechanics, body: Body, vibration: Vibration | None, drive: DriveMotion | None
) -> tuple[Forces, FenceState | None]:
    """Forces on the parcel and the fence's state, every contact force from the contact law.

    The modes left out carry the contact forces without lag.
    """
    link, arms = mechanics.link, mechanics.arms(body.angle)
    if link is None:
        return mechanics.forces(body, arms, None, ()), None
    assert vibration is not None
    assert drive is not None
    corners = [arms[number] for number in mechanics.fence_corners]
    places = tuple(foot(link, body.x + x, body.y + y, vibration, drive) for x, y in corners)

    def forces_at(loaded):
        shapes = tuple(link.shape(place) for place in loaded)
        points = tuple(link.point(shape, vibration) for shape in shapes)
        frame = mechanics.frame(drive, places, loaded)
        return mechanics.forces(body, arms, frame, points), shapes

    forces, shapes = forces_at(places)
    shares = ()
    if mechanics.sides:
        leans = _leans(forces, len(places))
        forces, shapes = forces_at(tuple(map(mechanics.loaded, places, leans)))
        shares = tuple(lean.share for lean in _leans(forces, len(places)))
    still = tuple(jnp.zeros_like(place) for place in places)
    fence = FenceState(drive, vibration, (), shapes, (), still, (), shares)
    loads = fence.loads(forces)
    load = link.loaded(link.inertia_force(drive), shapes, loads)
    return forces, fence._replace(modal_force=load, lagged=loads)


def _leans(forces: Forces, corners: int) -> tuple[Lean, ...]:
    """How the first `corners` load the fence, where its tip may carry a contact."""
    return tuple(touch.lean for touch in forces.touches[:corners] if touch.lean is not None)
