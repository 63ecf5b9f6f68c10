"""The parcel on the belt alone, and a whole sort."""


import jax.numpy as jnp
from jaxtyping import ArrayLike

from .. import _check
from ..parts import (
    CYCLE_TIME,
    AbstractDrive,
    AbstractFriction,
    AbstractSurface,
    AbstractTorqueDrive,
    Belt,
    Border,
    Fence,
    HarmonicDrive,
    Motor,
    Parcel,
    friction_of,
)
from .arguments import (
    Default,
    belt_of,
    border_of,
    check_clear_of_fence,
    check_clear_of_surfaces,
    check_motion,
    corners_of,
    cycle_of,
    drive_of,
    duration_of,
    fence_of,
    moving,
    parcel_of,
    surfaces_of,
    traced,
    velocity_of,
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
    surfaces: tuple[AbstractSurface, ...] = (),
    surface_corners: tuple[int, ...] = (1, 2, 3, 4),
    duration: float | None = None,
) -> Scene:
    """The parcel on the belt alone.

    **Arguments:**

    - `position`: (x, y) of C_s [m]; `angle`: phi [rad].
    - `velocity`: (xdot, ydot, phidot) [m/s, m/s, rad/s].
    - `parcel`, `belt`: by default the paper's; `None` for `belt` leaves it out.
    - `fence`, `drive`: if a fence is given, it swings and rings beside the parcel without contact,
      by default with the paper's drive.
    - `surfaces`: still surfaces that its `surface_corners` can touch.
    - `duration` [s], static, default 0.5.

    Raises `ValueError` where a number is out of its bounds, a corner is none of 1 ... 4, one of
    `surface_corners` lies inside a surface, or there is a drive without a fence; `TypeError` for a
    part of a wrong kind.

    >>> scene = fj.scenes.free_motion(position=(0.0, 0.3), velocity=(0.0, 1.0, 2.0))
    >>> scene.fence is None, scene.duration
    (True, 0.5)
    """
    x, y = _check.sequence("position", position, "numbers (x, y)", 2)
    motion = Body(
        moving("position x", x, "x"),
        moving("position y", y, "y"),
        moving("angle", angle, "angle"),
        *velocity_of(velocity),
    )
    if fence is not None:
        fence = fence_of(fence)
        drive = drive_of(drive, fence)
    elif drive is not None:
        raise ValueError(
            f"Argument `drive` must come with a `fence`, which it swings, but is {drive!r} without "
            "one. Write fence=fj.Fence(), or leave out the drive."
        )
    parcel = parcel_of(parcel)
    surfaces = surfaces_of(surfaces)
    corners = corners_of("surface_corners", surface_corners) if surfaces else ()
    remedy = "Change `position` or `angle`."
    check_clear_of_surfaces(parcel, motion[:2], motion.angle, surfaces, corners, remedy)
    return Scene(
        parcel=parcel,
        start=AsGiven(motion),
        duration=duration_of(duration, 0.5),
        belt=belt_of(belt),
        fence=fence,
        drive=drive,
        surfaces=surfaces,
        surface_corners=corners,
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
    surfaces: tuple[AbstractSurface, ...] = (),
    surface_corners: tuple[int, ...] = (1, 2, 3, 4),
    duration: float | None = None,
    motor: Motor | None = None,
) -> Scene:
    """A whole sort: the drive starts at rest, the parcel rides in, and contacts come and go.

    **Arguments:**

    - `front` [m]: x of the parcel's foremost point when the drive starts; it may be negative.
    - `offset`: Delta s [m] between the border and the parcel's lowest point, at least 0.
    - `angle`: phi [rad].
    - `fence_corners`, `border_corners`: the corners that can touch, static; each one costs. By
      default the two ends of the lower side. They suffice where the parcel comes to lie on that
      side, as the paper's does with its drive for an `angle` of -0.26 rad and more. Where another
      corner comes under the fence, or its side to the tip, `Status.LEFT_OVER_TIP` or `PEAK_AT_TIP`
      says so: write fence_corners=(1, 2, 3, 4).
    - `tip_contact`: as in `oblique_impact`, but by default the tip meets the sides behind
      `fence_corners`, clockwise.
    - `surfaces`: other still surfaces that the parcel's `surface_corners` can touch, such as a wall
      of the chute. `Result.peak_surface_force` is theirs.
    - `fence`, `parcel`, `belt`, `drive`, `fence_friction`, `border`: the parts, by default the
      paper's; `None` for `belt`, `fence_friction` or `border` leaves the part out.
    - `duration` [s], static, by default the drive's cycle.
    - `motor`: what swings the fence, for the limits of `fencejax.design.drivability`.

    Raises `ValueError` where a number is out of its bounds, a corner is none of 1 ... 4, the parcel
    lies beyond the fence or inside a surface when the drive starts, or the drive's speed or
    acceleration is not the derivative of its angle; `TypeError` for a part of a wrong kind.

    >>> scene = fj.scenes.whole_sort(offset=0.1, parcel=fj.Parcel(mass=8.0))
    >>> scene.start, float(scene.parcel.mass)
    (OnBelt(front=100 mm, offset=100 mm, angle=0 rad), 8.0)
    """
    fence = fence_of(fence)
    if motor is not None:
        motor = _check.part("motor", motor, Motor, "motor=fj.Motor(torque=400.0)")
    if drive is None:
        drive, duration = HarmonicDrive(), CYCLE_TIME if duration is None else duration
    drive = drive_of(drive, fence)
    start = OnBelt(front, offset, angle)
    border = border_of(border)
    parcel = parcel_of(parcel)
    surfaces = surfaces_of(surfaces)
    surface_corners = corners_of("surface_corners", surface_corners) if surfaces else ()
    check_motion(drive)
    if not traced(parcel, start, fence, drive):
        body = start.body(parcel, None, None)
        check_clear_of_surfaces(
            parcel, body[:2], body.angle, surfaces, surface_corners, "Lower `front`."
        )
        tilt = jnp.zeros_like(drive.turning_time)
        if not isinstance(drive, AbstractTorqueDrive):
            tilt = drive.angle(tilt)
        remedy = "Raise `offset`, lower `front`, or begin with the fence at rest at 0 rad."
        check_clear_of_fence(parcel, body[:2], body.angle, fence, tilt, remedy)
    return Scene(
        parcel=parcel,
        start=start,
        duration=duration_of(duration, cycle_of(drive) if duration is None else duration),
        belt=belt_of(belt),
        fence=fence,
        drive=drive,
        fence_friction=friction_of("fence_friction", fence_friction),
        border=border,
        fence_corners=corners_of("fence_corners", fence_corners),
        border_corners=() if border is None else corners_of("border_corners", border_corners),
        tip_contact=_check.flag("tip_contact", tip_contact),
        surfaces=surfaces,
        surface_corners=surface_corners,
        motor=motor,
    )


def passive_sort(
    surfaces: tuple[AbstractSurface, ...],
    *,
    front: ArrayLike = 0.1,
    offset: ArrayLike = 0.2,
    angle: ArrayLike = 0.0,
    parcel: Parcel | None = None,
    belt: Belt | None | Default = "default",
    border: Border | None | Default = "default",
    border_corners: tuple[int, ...] = (1, 2),
    surface_corners: tuple[int, ...] = (1, 2, 3, 4),
    duration: float = CYCLE_TIME,
) -> Scene:
    """A sort without a fence: the parcel rides with the belt into still surfaces, such as a
    deflector, which push it aside. `Result.peak_surface_force` is their largest force.

    **Arguments:**

    - `surfaces`: the still surfaces besides the border.
    - `front` [m]: x of the parcel's foremost point at the start; it may be negative.
    - `offset` [m] between the border and the parcel's lowest point, at least 0.
    - `angle`: phi [rad].
    - `surface_corners`, `border_corners`: the corners that can touch, static; each one costs.
    - `duration` [s], static.

    Raises `ValueError` where a corner lies inside a surface at the start.

    >>> scene = fj.scenes.passive_sort([fj.surfaces.Deflector(angle=0.6)])
    >>> scene.fence is None, len(scene.surfaces)
    (True, 1)
    """
    surfaces = surfaces_of(surfaces)
    start = OnBelt(front, offset, angle)
    parcel = parcel_of(parcel)
    corners = corners_of("surface_corners", surface_corners)
    if not traced(parcel, start, surfaces):
        body = start.body(parcel, None, None)
        remedy = "Lower `front`, or move the surface."
        check_clear_of_surfaces(parcel, body[:2], body.angle, surfaces, corners, remedy)
    border = border_of(border)
    return Scene(
        parcel=parcel,
        start=start,
        duration=duration_of(duration, CYCLE_TIME),
        belt=belt_of(belt),
        border=border,
        border_corners=() if border is None else corners_of("border_corners", border_corners),
        surfaces=surfaces,
        surface_corners=corners if surfaces else (),
    )
