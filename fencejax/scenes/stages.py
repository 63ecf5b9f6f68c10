"""The stages of a sort, one by one."""


import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike

from .. import _check
from ..parts import (
    AbstractDrive,
    AbstractFriction,
    Belt,
    Border,
    Fence,
    Parcel,
    friction_of,
    turned,
)
from .arguments import (
    Default,
    belt_of,
    border_of,
    check_clear_of_fence,
    corners_of,
    corners_with,
    drive_angle_of,
    drive_of,
    duration_of,
    fence_of,
    moving,
    parcel_of,
    place_of,
    traced,
    velocity_of,
)
from .scene import Scene
from .start import AtTouch, BetweenBorderAndFence, FlushOnFence


def oblique_impact(
    *,
    fence: Fence | None = None,
    distance: ArrayLike = 1.0,
    drive_angle: ArrayLike = 0.30,
    corner: int = 1,
    parcel_angle: ArrayLike | None = None,
    velocity: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
    parcel: Parcel | None = None,
    belt: Belt | None | Default = "default",
    drive: AbstractDrive | None = None,
    fence_friction: AbstractFriction | None | Default = "default",
    tip_contact: bool = False,
    fence_corners: tuple[int, ...] | None = None,
    duration: float | None = None,
) -> Scene:
    """A corner strikes the fence: fence, one corner and belt.

    **Arguments:**

    - `distance`: R [m], arc coordinate of the first contact, from the hinge.
    - `drive_angle`: alpha_w [rad] at that instant, on the way out.
    - `corner`: 1 ... 4.
    - `parcel_angle`: phi [rad]; by default such that C_s lies on the fence's normal through the
      corner.
    - `velocity`: (xdot, ydot, phidot) at that instant [m/s, m/s, rad/s]; by default the belt's.
    - `fence`, `parcel`, `belt`, `drive`, `fence_friction`: the parts, by default the paper's;
      `None` for `belt` or `fence_friction` leaves the part out.
    - `tip_contact`: whether the fence's tip meets the parcel's side, where a corner runs over it or
      the side comes to it first (`fencejax.model.tip`); static. By default it does not: the
      paper's contact ends there, over `Fidelity.tip_fade`, and `Status.LEFT_OVER_TIP` says so, or
      `PEAK_AT_TIP` where the force was largest then. With it they also say where a corner comes
      under the fence that `fence_corners` leave out.
    - `fence_corners`: the corners that can touch the fence, `corner` among them, and with
      `tip_contact` the sides behind them, clockwise; static, each one costs. By default `corner`
      alone, as in the paper: later contacts of other corners are not computed.
    - `duration` [s], static, default 0.25.

    Raises `ValueError` where the distance or the angle is out of the fence's or drive's reach, or
    where the parcel, turned by `parcel_angle`, lies beyond the fence with another corner.

    Paper: (2.25), (2.26). There the conditions that end the stage; here they follow from the
    motion.

    >>> print(fj.simulate(fj.scenes.oblique_impact(distance=0.9, parcel=fj.Parcel(mass=8.0))))
                status  successful
            peak force  874.05 N  at 30.91 ms
               impulse  28.212 N s
               contact  56.44 ms  from 0.00 ms to 56.44 ms
           leaves at x  0.858 m  y 0.584 m (C_s, end of the force)
        tip deflection  34.24 mm  at 30.58 ms
        bending stress  10.88 MPa  at 0.450 m from the hinge
          drive torque  934.93 N m  largest
          border force  0.00 N  largest
         surface force  0.00 N  largest
         pressed in by  26.35 mm
       energy residual  1.63e-02 J
    """
    fence = fence_of(fence)
    drive = drive_of(drive, fence)
    if parcel_angle is not None:
        parcel_angle = moving("parcel_angle", parcel_angle, "angle")
    (number,) = corners_of("corner", (corner,))
    parcel = parcel_of(parcel)
    start = AtTouch(
        place_of(distance, fence), drive_angle_of(drive_angle, drive, fence), parcel_angle,
        None if velocity is None else velocity_of(velocity), number,
    )  # fmt: skip
    _turned_clear(parcel, start, fence)
    return Scene(
        parcel=parcel,
        start=start,
        duration=duration_of(duration, 0.25),
        belt=belt_of(belt),
        fence=fence,
        drive=drive,
        fence_friction=friction_of("fence_friction", fence_friction),
        fence_corners=corners_with(number, fence_corners),
        tip_contact=_check.flag("tip_contact", tip_contact),
    )


def _turned_clear(parcel: Parcel, start: AtTouch, fence: Fence) -> None:
    """Refuse a parcel that touches with one corner and lies beyond the fence with another one, or
    has no direction from C_s to the corner."""
    if traced(parcel.length, parcel.breadth, parcel.center_x, parcel.center_y):
        return
    x, y = _check.on_host(parcel).corner(start.corner)
    if start.parcel_angle is None:
        if np.any((np.asarray(x) == 0) & (np.asarray(y) == 0)):
            raise ValueError(
                f"Argument `parcel_angle` must be given where the centre of gravity is corner "
                f"{start.corner}, but is None: no line goes from one to the other."
            )
        return
    if traced(start, fence):
        return
    turn, tilt, place = _check.on_host((start.parcel_angle, start.drive_angle, start.place))
    x, y = turned((np.cos(turn), np.sin(turn)), x, y)
    foot = turned((np.cos(tilt), np.sin(tilt)), place, fence.rise(start.place))
    position = foot[0] - x, foot[1] - y
    remedy = "Change `parcel_angle`, or name that corner in `corner`."
    check_clear_of_fence(parcel, position, turn, fence, tilt, remedy)


def along_fence(
    *,
    fence: Fence | None = None,
    distance: ArrayLike = 0.8,
    drive_angle: ArrayLike = 0.25,
    parcel: Parcel | None = None,
    belt: Belt | None | Default = "default",
    drive: AbstractDrive | None = None,
    fence_friction: AbstractFriction | None | Default = "default",
    tip_contact: bool = False,
    fence_corners: tuple[int, ...] = (1, 2),
    duration: float | None = None,
) -> Scene:
    """The parcel's lower side lies flat on the fence and slides along it.

    The two corners of that side carry the contact, so that the rotation is free and follows the
    fence by their forces; the paper ties it to the fence.

    **Arguments:**

    - `distance`: arc coordinate [m] under C_s, from the hinge.
    - `drive_angle`: alpha_w [rad] at the start, on the way out.
    - `fence_corners`: the corners that can touch the fence, and with `tip_contact` the sides behind
      them, clockwise; static, each one costs. By default the two of the lower side.
    - `fence`, `parcel`, `belt`, `drive`, `fence_friction`, `tip_contact`: as in `oblique_impact`.
    - `duration` [s], static, default 0.25.

    Raises `ValueError` where a number is out of its bounds, the distance is beyond the fence, the
    drive does not reach the angle, or a corner is none of 1 ... 4; `TypeError` for a part of a
    wrong kind.

    Paper: (2.27)-(2.30). There phi is the fence's slope, and one force acts at the foot of C_s.

    >>> scene = fj.scenes.along_fence(distance=0.7, drive_angle=0.2)
    >>> scene.start
    FlushOnFence(place=700 mm, drive_angle=0.2 rad)
    """
    fence = fence_of(fence)
    drive = drive_of(drive, fence)
    start = FlushOnFence(place_of(distance, fence), drive_angle_of(drive_angle, drive, fence))
    return Scene(
        parcel=parcel_of(parcel),
        start=start,
        duration=duration_of(duration, 0.25),
        belt=belt_of(belt),
        fence=fence,
        drive=drive,
        fence_friction=friction_of("fence_friction", fence_friction),
        fence_corners=corners_of("fence_corners", fence_corners),
        tip_contact=_check.flag("tip_contact", tip_contact),
    )


def border_and_fence(
    *,
    fence: Fence | None = None,
    distance: ArrayLike = 1.0,
    drive_angle: ArrayLike = 0.10,
    fence_corner: int = 1,
    border_corner: int = 2,
    parcel: Parcel | None = None,
    belt: Belt | None | Default = "default",
    drive: AbstractDrive | None = None,
    fence_friction: AbstractFriction | None | Default = "default",
    border: Border | None = None,
    tip_contact: bool = False,
    fence_corners: tuple[int, ...] | None = None,
    duration: float | None = None,
) -> Scene:
    """One corner on the fence and another on the border: the stage (2.31)-(2.34).

    **Arguments:**

    - `distance`: arc coordinate [m] of the corner on the fence, from the hinge.
    - `drive_angle`: alpha_w [rad] at the start, on the way out.
    - `fence_corner`, `border_corner`: the corner on the fence and the one on the border, two of
      1 ... 4.
    - `border`: by default the paper's. A border without friction is `fencejax.Border(None)`.
    - `fence_corners`: the corners that can touch the fence, `fence_corner` among them, and with
      `tip_contact` the sides behind them, clockwise; static, each one costs. By default
      `fence_corner` alone. The border is touched by `border_corner` alone.
    - `fence`, `parcel`, `belt`, `drive`, `fence_friction`, `tip_contact`: as in `oblique_impact`.
    - `duration` [s], static, default 0.25.

    Raises `ValueError` where a number is out of its bounds, the distance is beyond the fence, the
    drive does not reach the angle, both corners are the same or one of them is none of 1 ... 4, or
    the two corners are closer together than the fence is high there; `TypeError` for a part of a
    wrong kind.

    >>> scene = fj.scenes.border_and_fence(distance=0.9, fence_corner=1, border_corner=2)
    >>> scene.fence_corners, scene.border_corners
    ((1,), (2,))
    """
    fence = fence_of(fence)
    drive = drive_of(drive, fence)
    parcel = parcel_of(parcel)
    (first,) = corners_of("fence_corner", (fence_corner,))
    (second,) = corners_of("border_corner", (border_corner,))
    if first == second:
        raise ValueError(
            f"Arguments `fence_corner` and `border_corner` must differ, but both are {first}."
        )
    place = place_of(distance, fence)
    angle = drive_angle_of(drive_angle, drive, fence)
    ax, ay = parcel.corner(first)
    bx, by = parcel.corner(second)
    _check.scalar(
        "height of the fence at `distance` / distance of the corners",
        fence.height(place, angle) / jnp.sqrt((ax - bx) ** 2 + (ay - by) ** 2),
        most=1,
        remedy="The parcel does not span from the border to that point of the fence.",
    )
    return Scene(
        parcel=parcel,
        start=BetweenBorderAndFence(place, angle, first, second),
        duration=duration_of(duration, 0.25),
        belt=belt_of(belt),
        fence=fence,
        drive=drive,
        fence_friction=friction_of("fence_friction", fence_friction),
        border=border_of("default" if border is None else border),
        fence_corners=corners_with(first, fence_corners),
        border_corners=(second,),
        tip_contact=_check.flag("tip_contact", tip_contact),
    )
