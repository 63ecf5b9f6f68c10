"""Scenes: which parts act, and how it begins. Each stage of a sort, and the whole of it."""

from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike

from . import _check
from .belt import Belt, Border
from .drive import CYCLE_TIME, AbstractDrive, HarmonicDrive
from .fence import Fence
from .friction import Friction
from .kinematics import Body
from .parcel import Parcel
from .start import (
    AbstractStart,
    AsGiven,
    AtTouch,
    BetweenBorderAndFence,
    FlushOnFence,
    OnBelt,
)

_CORNERS = (1, 2, 3, 4)
Default = Literal["default"]


class Scene(eqx.Module):
    """A parcel and the parts that act on it. A part that is `None` costs nothing.

    Made by the functions of this module; a field is changed with `equinox.tree_at`.
    """

    parcel: Parcel
    start: AbstractStart
    belt: Belt | None
    fence: Fence | None
    drive: AbstractDrive | None
    fence_friction: Friction | None
    border: Border | None
    fence_corners: tuple[int, ...] = eqx.field(static=True)
    border_corners: tuple[int, ...] = eqx.field(static=True)
    duration: float = eqx.field(static=True)
    tip_contact: bool = eqx.field(static=True, default=False)


class NormalScene(eqx.Module):
    """A parcel with one coordinate, against the fence held still or, without one, against an
    undeformable wall of infinite mass; no belt, no friction."""

    parcel: Parcel
    speed: Array
    fence: Fence | None
    distance: Array | None
    duration: float = eqx.field(static=True)


def _corners(name: str, corners: tuple[int, ...]) -> tuple[int, ...]:
    for corner in corners:
        if corner not in _CORNERS:
            raise ValueError(
                f"Argument `{name}` must hold corners 1 ... 4 (1 leading lower, 2 trailing lower, "
                f"3 trailing upper, 4 leading upper), but holds {corner!r}."
            )
    return tuple(sorted(set(corners)))


def _fence_friction(friction: Friction | None | Default) -> Friction | None:
    return Friction(kinetic=0.35, static=0.5) if friction == "default" else friction


def _belt(belt: Belt | None | Default) -> Belt | None:
    return Belt() if belt == "default" else belt


def _place(distance: ArrayLike, fence: Fence) -> Array:
    place = _check.scalar("distance", distance, least=0, size=1.0, unit="m")
    if not isinstance(place + fence.reach, Tracer):
        _check.scalar(
            "distance",
            place,
            most=float(jnp.min(fence.reach)),
            unit="m",
            remedy="The fence ends at rigid_length + flexible_length.",
        )
    return place


def _drive_angle(angle: ArrayLike, drive: AbstractDrive) -> Array:
    checked = _check.scalar("drive_angle", angle, least=-1.5, most=1.5, unit="rad")
    _motion(drive)
    furthest = drive.angle(drive.turning_time)
    nearest = drive.angle(jnp.zeros_like(drive.turning_time))
    if not isinstance(checked + furthest, Tracer):
        _check.scalar(
            "drive_angle",
            checked,
            most=float(jnp.min(furthest)) + 1e-9,
            unit="rad",
            remedy="The drive turns back there.",
        )
        _check.scalar(
            "drive_angle",
            checked,
            least=float(jnp.max(nearest)) - 1e-9,
            unit="rad",
            remedy="The drive begins there.",
        )
    return checked


def _motion(drive: AbstractDrive) -> None:
    """Refuse a drive whose speed or acceleration is not the derivative of its angle, where a class
    gives `motion` in its own way."""
    if type(drive).motion is AbstractDrive.motion or _traced(drive):
        return
    # Off the whole fractions of a cycle, at which laws have their kinks.
    for share in (0.137, 0.371, 0.613, 0.859):
        time = share * drive.cycle
        given, derived = drive.motion(time), AbstractDrive.motion(drive, time)
        for name, a, b in zip(derived._fields, given, derived, strict=True):
            if not np.allclose(a, b, rtol=1e-6, atol=1e-9):
                raise ValueError(
                    f"Argument `drive` must move by its own angle, but its {name} at "
                    f"{float(time):g} [s] is {float(a):g}, the derivative of its angle "
                    f"{float(b):g}. Leave `motion` to AbstractDrive, which differentiates `angle`."
                )


def _traced(*parts) -> bool:
    return any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(parts))


def _clear_of_fence(parcel: Parcel, position, angle, fence: Fence, tilt, remedy: str) -> None:
    """Refuse a parcel of which a corner lies beyond the straight fence, at the angle `tilt` [rad],
    by more than rounding. `position` is that of C_s [m]."""
    if _traced(parcel, position, angle, fence, tilt):
        return
    turn, tilt = np.asarray(angle), np.asarray(tilt)
    for number in _CORNERS:
        x, y = (np.asarray(q) for q in parcel.corner(number))
        place_x = position[0] + np.cos(turn) * x - np.sin(turn) * y
        place_y = position[1] + np.sin(turn) * x + np.cos(turn) * y
        along = place_x * np.cos(tilt) + place_y * np.sin(tilt)
        beyond = place_x * np.sin(tilt) - place_y * np.cos(tilt)
        over = (along >= 0) & (along <= np.asarray(fence.reach))
        size = np.asarray(parcel.length + parcel.breadth)
        if np.any(over & (beyond > 1e-6 * size)):
            raise ValueError(
                f"The parcel must be clear of the fence at the start, but corner {number} is "
                f"{float(np.max(np.where(over, beyond, -np.inf))):g} [m] beyond it. {remedy}"
            )


def _duration(duration: float | None, default: float) -> float:
    return _check.number("duration", default if duration is None else duration, above=0, unit="s")


def _cycle(drive: AbstractDrive) -> float:
    cycle = drive.cycle
    if isinstance(cycle, Tracer) or cycle.ndim > 0:
        raise ValueError(
            "Argument `duration` [s] must be given where the drive's cycle time is traced, but is "
            "None. Write, for example, duration=1.36: it sets the number of steps."
        )
    return float(cycle)


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
    fence_friction: Friction | None | Default = "default",
    tip_contact: bool = False,
    duration: float | None = None,
) -> Scene:
    """A corner strikes the fence: stage (2.3)-(2.26), fence, one corner and belt.

    **Arguments:**

    - `distance`: R [m], arc coordinate of the first touch, from the hinge.
    - `drive_angle`: alpha_w [rad] at that moment, on the way out.
    - `corner`: 1 ... 4.
    - `parcel_angle`: phi [rad]; by default such that C_s lies on the fence's normal through the
      corner.
    - `velocity`: (xdot, ydot, phidot) at that moment [m/s, m/s, rad/s]; by default the belt's.
    - `fence`, `parcel`, `belt`, `drive`, `fence_friction`: the parts, by default the paper's;
      `None` for `belt` or `fence_friction` leaves the part out.
    - `tip_contact`: whether the fence's tip carries the contact on, against the parcel's side,
      where the corner runs over it (`fencejax.tip`); static. By default it does not: the paper's
      contact ends there, over `Fidelity.tip_fade`, and `Status.LEFT_OVER_TIP` says so, or
      `PEAK_AT_TIP` where the force was largest then.
    - `duration` [s], static, default 0.25.

    Raises `ValueError` where the distance or the angle is out of the fence's or drive's reach, or
    where the parcel, turned by `parcel_angle`, lies beyond the fence with another corner.
    """
    fence = Fence() if fence is None else fence
    drive = HarmonicDrive() if drive is None else drive
    if parcel_angle is not None:
        parcel_angle = _check.scalar("parcel_angle", parcel_angle, size=10.0, unit="rad")
    moving = None
    if velocity is not None:
        x, y, spin = (_check.scalar("velocity", v, size=1.0, unit="m/s") for v in velocity)
        moving = (x, y, spin)
    (number,) = _corners("corner", (corner,))
    parcel = Parcel() if parcel is None else parcel
    start = AtTouch(
        _place(distance, fence), _drive_angle(drive_angle, drive), parcel_angle, moving, number
    )
    _turned_clear(parcel, start, fence)
    return Scene(
        parcel,
        start,
        _belt(belt),
        fence,
        drive,
        _fence_friction(fence_friction),
        None,
        (number,),
        (),
        _duration(duration, 0.25),
        _check.flag("tip_contact", tip_contact),
    )


def _turned_clear(parcel: Parcel, start: AtTouch, fence: Fence) -> None:
    """Refuse a parcel that touches with one corner and lies beyond the fence with another one, or
    has no direction from C_s to the corner."""
    x, y = parcel.corner(start.corner)
    if _traced(x, y):
        return
    if start.parcel_angle is None:
        if np.any((np.asarray(x) == 0) & (np.asarray(y) == 0)):
            raise ValueError(
                f"Argument `parcel_angle` must be given where the centre of gravity is corner "
                f"{start.corner}, but is None: no line goes from one to the other."
            )
        return
    if _traced(start, fence):
        return
    turn, tilt = start.parcel_angle, start.drive_angle
    position = (
        start.place * jnp.cos(tilt) - (jnp.cos(turn) * x - jnp.sin(turn) * y),
        start.place * jnp.sin(tilt) - (jnp.sin(turn) * x + jnp.cos(turn) * y),
    )
    remedy = "Change `parcel_angle`, or name that corner in `corner`."
    _clear_of_fence(parcel, position, turn, fence, tilt, remedy)


def along_fence(
    *,
    fence: Fence | None = None,
    distance: ArrayLike = 0.8,
    drive_angle: ArrayLike = 0.25,
    parcel: Parcel | None = None,
    belt: Belt | None | Default = "default",
    drive: AbstractDrive | None = None,
    fence_friction: Friction | None | Default = "default",
    tip_contact: bool = False,
    duration: float | None = None,
) -> Scene:
    """The parcel's lower wall lies on the fence and slides along it: stage (2.27)-(2.30).

    The two corners of that wall carry the contact, so that the rotation is free and follows the
    fence by their forces; the paper ties it to the fence. `distance` [m] is the arc coordinate
    under C_s; the other arguments are those of `oblique_impact`; `duration` is 0.25 s by default.
    """
    fence = Fence() if fence is None else fence
    drive = HarmonicDrive() if drive is None else drive
    start = FlushOnFence(_place(distance, fence), _drive_angle(drive_angle, drive))
    return Scene(
        Parcel() if parcel is None else parcel,
        start,
        _belt(belt),
        fence,
        drive,
        _fence_friction(fence_friction),
        None,
        (1, 2),
        (),
        _duration(duration, 0.25),
        _check.flag("tip_contact", tip_contact),
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
    fence_friction: Friction | None | Default = "default",
    border: Border | None = None,
    tip_contact: bool = False,
    duration: float | None = None,
) -> Scene:
    """One corner on the fence and another on the border: stage (2.31)-(2.34).

    `distance` [m] is the arc coordinate of the corner on the fence, at the angle `drive_angle`
    [rad]; the other arguments are those of `oblique_impact`; `duration` is 0.25 s by default.

    Raises `ValueError` where the two corners are closer together than the fence is high there.
    """
    fence = Fence() if fence is None else fence
    drive = HarmonicDrive() if drive is None else drive
    parcel = Parcel() if parcel is None else parcel
    (first,) = _corners("fence_corner", (fence_corner,))
    (second,) = _corners("border_corner", (border_corner,))
    if first == second:
        raise ValueError(
            f"Arguments `fence_corner` and `border_corner` must differ, but both are {first}."
        )
    place = _place(distance, fence)
    angle = _drive_angle(drive_angle, drive)
    ax, ay = parcel.corner(first)
    bx, by = parcel.corner(second)
    _check.scalar(
        "distance x sin(drive_angle) / distance of the corners",
        place * jnp.sin(angle) / jnp.sqrt((ax - bx) ** 2 + (ay - by) ** 2),
        most=1,
        remedy="The parcel does not span from the border to that point of the fence.",
    )
    return Scene(
        parcel,
        BetweenBorderAndFence(place, angle, first, second),
        _belt(belt),
        fence,
        drive,
        _fence_friction(fence_friction),
        Border() if border is None else border,
        (first,),
        (second,),
        _duration(duration, 0.25),
        _check.flag("tip_contact", tip_contact),
    )


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
        _belt(belt),
        fence,
        drive if fence is not None else None,
        None,
        None,
        (),
        (),
        _duration(duration, 0.5),
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
    fence_friction: Friction | None | Default = "default",
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
    _motion(drive)
    if not _traced(parcel, start, fence, drive):
        body = start.body(parcel, None, None)
        tilt = drive.angle(jnp.zeros_like(drive.turning_time))
        remedy = "Raise `offset`, lower `front`, or begin with the fence at rest at 0 rad."
        _clear_of_fence(parcel, body[:2], body.angle, fence, tilt, remedy)
    return Scene(
        parcel,
        start,
        _belt(belt),
        fence,
        drive,
        _fence_friction(fence_friction),
        border,
        _corners("fence_corners", fence_corners),
        () if border is None else _corners("border_corners", border_corners),
        _duration(duration, _cycle(drive) if duration is None else duration),
        _check.flag("tip_contact", tip_contact),
    )


def normal_impact(
    *,
    fence: Fence | None = None,
    distance: ArrayLike | None = None,
    speed: ArrayLike = 2.426,
    parcel: Parcel | None = None,
    duration: float | None = None,
) -> NormalScene:
    """A parcel strikes the fence held still, along its normal: the smallest scene with a fence.

    **Arguments:**

    - `distance`: arc coordinate [m] from the hinge where it strikes, by default R_z - 0.2 l_p.
    - `speed`: the normal approach speed v_n [m/s].
    - `fence`, `parcel`: by default the paper's.
    - `duration` [s], static, default 0.25.

    Raises `ValueError` where the distance is out of the fence's reach.
    """
    fence = Fence() if fence is None else fence
    if distance is None:
        distance = fence.reach - 0.2 * fence.flexible_length
    return NormalScene(
        Parcel() if parcel is None else parcel,
        _check.scalar("speed", speed, size=1.0, unit="m/s"),
        fence,
        _place(distance, fence),
        _duration(duration, 0.25),
    )


def rigid_wall(
    *, speed: ArrayLike = 2.426, parcel: Parcel | None = None, duration: float | None = None
) -> NormalScene:
    """A parcel strikes an undeformable wall of infinite mass: N_stiff, one coordinate.

    `speed` is the normal approach speed v_n [m/s]; `duration` [s] is static, default 0.1.
    """
    return NormalScene(
        Parcel() if parcel is None else parcel,
        _check.scalar("speed", speed, size=1.0, unit="m/s"),
        None,
        None,
        _duration(duration, 0.1),
    )
