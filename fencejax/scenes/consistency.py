"""Whether the numbers of a scene are within their bounds and consistent, computed in the program,
as traced numbers cannot be refused beforehand."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from .._check import Bounds
from ..parts import AbstractTorqueDrive
from .scene import NormalScene, Scene
from .start import MOTION_BOUNDS, AtTouch, BetweenBorderAndFence

_ROUNDING = 1e-6


def _bounded(part: Any):
    """Whether each field is within the `bounds` of its class, of a part and of the parts in it."""
    if not isinstance(part, eqx.Module):
        return
    for name, bounds in getattr(type(part), "bounds", {}).items():
        value = getattr(part, name)
        if value is not None:
            yield jnp.all(bounds.holds(value))
    for inner in vars(part).values():
        for each in inner if isinstance(inner, tuple) else (inner,):
            yield from _bounded(each)


def _within(value: Array, least: Array | float, most: Array) -> Array:
    """Whether a value is within bounds, up to round-off."""
    slack = _ROUNDING * (jnp.abs(most) + 1e-9)
    return (value >= least - slack) & (value <= most + slack)


def consistent(scene: Scene | NormalScene, start_time: Array | None = None) -> Array:
    """Whether the numbers of a scene are within their bounds and consistent.

    - every field of parcel, belt, friction, fence, material, taper and drive, and the start's;
    - the centre of gravity inside the rectangle, the drive's stroke long enough;
    - the fence's curve at rest no steeper than `RestShape.steepest`;
    - the place of the touch on the fence, and its angle that of the drive at `start_time` [s];
    - a parcel between border and fence long enough to touch both.

    >>> bool(fj.scenes.consistent(fj.scenes.oblique_impact()))
    True
    """
    parcel = scene.parcel
    checks = list(_bounded(scene))
    for offset, side in ((parcel.center_x, parcel.length), (parcel.center_y, parcel.breadth)):
        checks.append(2 * jnp.abs(offset) <= side * (1 + _ROUNDING))
    if isinstance(scene, NormalScene):
        checks.append(Bounds(size=1.0).holds(scene.speed))
        place = scene.distance
    else:
        given = scene.start.motion_given()
        checks += [MOTION_BOUNDS[name].holds(value) for name, value in given.items()]
        place = scene.start.distance()
        wanted = getattr(scene.start, "drive_angle", None)
        if scene.drive is not None:
            feasible = scene.drive.feasible
            checks += [] if feasible is None else [feasible]
            if wanted is not None and start_time is not None:
                if isinstance(scene.drive, AbstractTorqueDrive):
                    assert scene.fence is not None
                    reached = scene.drive.unloaded(start_time, scene.fence.inertia).angle
                else:
                    reached = scene.drive.angle(start_time)
                checks.append(jnp.abs(reached - wanted) <= _ROUNDING * (1 + jnp.abs(wanted)))
        if isinstance(scene.start, AtTouch) and scene.start.parcel_angle is None:
            x, y = parcel.corner(scene.start.corner)
            checks.append((x != 0) | (y != 0))
        if isinstance(scene.start, BetweenBorderAndFence):
            ax, ay = parcel.corner(scene.start.fence_corner)
            bx, by = parcel.corner(scene.start.border_corner)
            assert scene.fence is not None
            rise = scene.fence.height(scene.start.place, scene.start.drive_angle)
            checks.append(rise**2 <= ((ax - bx) ** 2 + (ay - by) ** 2) * (1 + _ROUNDING))
    if scene.fence is not None and scene.fence.rest_shape is not None:
        shape = scene.fence.rest_shape
        checks.append(shape.steepness(scene.fence.flexible_length) <= shape.steepest)
    if place is not None and scene.fence is not None:
        checks.append(_within(place, 0.0, scene.fence.reach))
    every = checks[0]
    for check in checks[1:]:
        every = every & check
    return jax.lax.stop_gradient(every)
