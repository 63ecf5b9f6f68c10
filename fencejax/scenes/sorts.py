"""The parcel on the belt alone, and a whole sort."""


import jax.numpy as jnp
from jaxtyping import ArrayLike

from .. import _check
from ..parts import (
    CYCLE_TIME,
    AbstractDrive,
    AbstractFriction,
    Belt,
    Border,
    Fence,
    HarmonicDrive,
    Parcel,
)
from .arguments import (
    Default,
    belt_of,
    check_clear_of_fence,
    check_motion,
    corners_of,
    cycle_of,
    duration_of,
    fence_friction_of,
    traced,
)
from .body import Body
from .scene import Scene
from .start import AsGiven, OnBelt


def free_motion(
    *,
    position: tuple[ArrayLike, ArrayLike] = (0.0, 0.35),
    angle: ArrayLike = 0.0,
    velocity: tuple[ArrayLike, ArrayLike, ArrayLike] = (0.0, 1.0, 2.0),
    parcel: Parcel | None = None,
    belt: Belt | None | Default = "default",
    fence: Fence | None = None,
    drive: AbstractDrive | None = None,
    duration: float | None = None,
) -> Scene:
    """The parcel on the belt alone.

    **Arguments:**

    - `position`: (x, y) of C_s [m]; `angle`: phi [rad].
    - `velocity`: (xdot, ydot, phidot) [m/s, m/s, rad/s].
    - `fence`, `drive`: if given, the fence swings and rings beside the parcel without contact.
    - `duration` [s], static, default 0.5.
    """
    numbers = {
        "position x": (position[0], "m"),
        "position y": (position[1], "m"),
        "angle": (angle, "rad"),
        "velocity x": (velocity[0], "m/s"),
        "velocity y": (velocity[1], "m/s"),
        "spin": (velocity[2], "rad/s"),
    }
    motion = Body(
        *(_check.scalar(k, value, size=10.0, unit=unit) for k, (value, unit) in numbers.items())
    )
    if fence is not None and drive is None:
        drive = HarmonicDrive()
    return Scene(
        Parcel() if parcel is None else parcel,
        AsGiven(motion),
        belt_of(belt),
        fence,
        drive if fence is not None else None,
        None,
        None,
        (),
        (),
        duration_of(duration, 0.5),
    )


def whole_sort(
    *,
    front: ArrayLike = 0.1,
    offset: ArrayLike = 0.0,
    angle: ArrayLike = 0.0,
    fence: Fence | None = None,
    parcel: Parcel | None = None,
    belt: Belt | None | Default = "default",
    drive: AbstractDrive | None = None,
    fence_friction: AbstractFriction | None | Default = "default",
    border: Border | None | Default = "default",
    fence_corners: tuple[int, ...] = (1, 2),
    border_corners: tuple[int, ...] = (1, 2),
    tip_contact: bool = True,
    duration: float | None = None,
) -> Scene:
    """A whole sort: the drive starts at rest, the parcel rides in, and contacts come and go.

    **Arguments:**

    - `front` [m]: x of the parcel's foremost point when the drive starts; it may be negative.
    - `offset`: Delta s [m] between the border and the parcel's lowest point, at least 0.
    - `angle`: phi [rad].
    - `fence_corners`, `border_corners`: the corners that can touch, static; each one costs. By
      default the two of the lower wall.
    - `tip_contact`: as in `oblique_impact`, but by default the tip carries on.
    - `duration` [s], static, by default the drive's cycle.
    """
    fence = Fence() if fence is None else fence
    if drive is None:
        drive, duration = HarmonicDrive(), CYCLE_TIME if duration is None else duration
    start = OnBelt(
        _check.scalar("front", front, size=1.0, unit="m"),
        _check.scalar("offset", offset, least=0, size=1.0, unit="m"),
        _check.scalar("angle", angle, size=10.0, unit="rad"),
    )
    border = Border() if border == "default" else border
    parcel = Parcel() if parcel is None else parcel
    check_motion(drive)
    if not traced(parcel, start, fence, drive):
        body = start.body(parcel, None, None)
        tilt = drive.angle(jnp.zeros_like(drive.turning_time))
        remedy = "Raise `offset`, lower `front`, or begin with the fence at rest at 0 rad."
        check_clear_of_fence(parcel, body[:2], body.angle, fence, tilt, remedy)
    return Scene(
        parcel,
        start,
        belt_of(belt),
        fence,
        drive,
        fence_friction_of(fence_friction),
        border,
        corners_of("fence_corners", fence_corners),
        () if border is None else corners_of("border_corners", border_corners),
        duration_of(duration, cycle_of(drive) if duration is None else duration),
        _check.flag("tip_contact", tip_contact),
    )
