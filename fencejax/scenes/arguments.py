"""Arguments that several scenes share: their defaults and checks, on the host."""

from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike

from .. import _check
from ..parts import (
    AbstractDrive,
    AbstractSurface,
    AbstractTorqueDrive,
    Belt,
    Border,
    Fence,
    HarmonicDrive,
    Parcel,
    turned,
)
from .start import MOTION_BOUNDS

_CORNERS = (1, 2, 3, 4)
Default = Literal["default"]


def moving(argument: str, value: ArrayLike, field: str) -> Array:
    """Check a number of a parcel's motion, a field of `Body` (see `fencejax._check.scalar`)."""
    return _check.scalar(argument, value, **MOTION_BOUNDS[field]._asdict())


def velocity_of(velocity: tuple[ArrayLike, ArrayLike, ArrayLike]) -> tuple[Array, Array, Array]:
    """Check the velocity of a parcel, (xdot, ydot, phidot) [m/s, m/s, rad/s]."""
    x, y, spin = _check.sequence("velocity", velocity, "numbers (x, y, spin)", 3)
    return (
        moving("velocity x", x, "x_rate"),
        moving("velocity y", y, "y_rate"),
        moving("velocity spin", spin, "spin"),
    )


def corners_of(name: str, corners: tuple[int, ...]) -> tuple[int, ...]:
    found = [_check.count(name, corner) for corner in _check.sequence(name, corners, "corners")]
    for corner in found:
        if corner not in _CORNERS:
            raise ValueError(
                f"Argument `{name}` must hold corners 1 ... 4 (1 leading lower, 2 trailing lower, "
                f"3 trailing upper, 4 leading upper), but holds {corner!r}."
            )
    return tuple(sorted(set(found)))


def corners_with(corner: int, corners: tuple[int, ...] | None) -> tuple[int, ...]:
    """The corners that can touch the fence, `corner` among them; by default it alone."""
    if corners is None:
        return (corner,)
    found = corners_of("fence_corners", corners)
    if corner not in found:
        raise ValueError(
            f"Argument `fence_corners` must hold corner {corner}, which the scene begins with at "
            f"the fence, but is {corners!r}. Write fence_corners={tuple(sorted((*found, corner)))}."
        )
    return found


def fence_of(fence: Fence | None) -> Fence:
    fence = Fence() if fence is None else fence
    return _check.part("fence", fence, Fence, "fence=fj.Fence(thickness=0.045)")


def drive_of(drive: AbstractDrive | None, fence: Fence) -> AbstractDrive:
    drive = HarmonicDrive() if drive is None else drive
    if isinstance(drive, AbstractTorqueDrive) and fence.shaft is not None:
        raise ValueError(
            f"Argument `shaft` of the fence must be None on a {type(drive).__name__}, whose torque "
            "acts on the hinge itself, but is given. Write fj.Fence(shaft=None), and add the "
            "shaft's inertia to the drive's."
        )
    return _check.part("drive", drive, AbstractDrive, "drive=fj.HarmonicDrive(top_speed=1.53)")


def parcel_of(parcel: Parcel | None) -> Parcel:
    parcel = Parcel() if parcel is None else parcel
    return _check.part("parcel", parcel, Parcel, "parcel=fj.Parcel(mass=15.0)")


def border_of(border: Border | None | Default) -> Border | None:
    if border is None:
        return None
    border = Border() if border == "default" else border
    return _check.part("border", border, Border, "border=fj.Border()")


def belt_of(belt: Belt | None | Default) -> Belt | None:
    if belt is None:
        return None
    belt = Belt() if belt == "default" else belt
    return _check.part("belt", belt, Belt, "belt=fj.Belt(speed=2.0)")


def place_of(distance: ArrayLike, fence: Fence) -> Array:
    place = _check.scalar("distance", distance, least=0, size=1.0, unit="m")
    if not traced(place, fence.rigid_length, fence.flexible_length):
        links = _check.on_host((fence.rigid_length, fence.flexible_length))
        _check.scalar(
            "distance",
            place,
            most=float(np.min(sum(links))),
            unit="m",
            remedy="The fence ends at rigid_length + flexible_length.",
        )
    return place


def drive_angle_of(angle: ArrayLike, drive: AbstractDrive, fence: Fence) -> Array:
    checked = _check.scalar("drive_angle", angle, least=-1.5, most=1.5, unit="rad")
    check_motion(drive)
    torque = isinstance(drive, AbstractTorqueDrive)
    if traced(drive, checked) or (torque and traced(fence)):
        return checked
    if type(drive) is HarmonicDrive:
        # In closed form, so that the first scene of a process compiles nothing.
        furthest = _check.on_host(drive).amplitude
        nearest = np.zeros_like(furthest)
    else:
        nearest, furthest = _ends(drive, fence.inertia, checked) if torque else _ends(drive)
    # Inside a traced program they are traced even if their arguments are not.
    if not traced(nearest, furthest):
        _check.scalar(
            "drive_angle",
            checked,
            most=float(np.min(furthest)) + 1e-9,
            unit="rad",
            remedy="The drive turns back there.",
        )
        _check.scalar(
            "drive_angle",
            checked,
            least=float(np.max(nearest)) - 1e-9,
            unit="rad",
            remedy="The drive begins there.",
        )
    return checked


# One program, not one for each operation of the law.
@jax.jit
def _ends(drive: AbstractDrive, inertia: ArrayLike = 0.0, wanted: ArrayLike = 0.0):
    """The angles [rad] at the start and where the drive turns back; for a torque drive where a
    rigid fence of an `inertia` [kg m^2] is as `wanted`, or at the end of the way out."""
    turning = drive.turning_time
    start = jnp.zeros_like(turning)
    if isinstance(drive, AbstractTorqueDrive):
        return start, drive.unloaded(drive.time_at(wanted, inertia), inertia).angle
    return drive.angle(start), drive.angle(turning)


def check_motion(drive: AbstractDrive) -> None:
    """Refuse a drive whose speed or acceleration is not the derivative of its angle, where a class
    overrides `motion`."""
    known = AbstractDrive.motion, AbstractTorqueDrive.motion
    if type(drive).motion in known or traced(drive):
        return
    # Off the whole fractions of a cycle, at which laws have their kinks.
    for share in (0.137, 0.371, 0.613, 0.859):
        time = share * drive.cycle
        given, derived = drive.motion(time), AbstractDrive.motion(drive, time)
        for name in ("angle", "speed", "acceleration"):
            a, b = getattr(given, name), getattr(derived, name)
            if not np.allclose(a, b, rtol=1e-6, atol=1e-9):
                raise ValueError(
                    f"Argument `drive` must move by its own angle, but its {name} at "
                    f"{float(time):g} [s] is {float(a):g}, the derivative of its angle "
                    f"{float(b):g}. Leave `motion` to AbstractDrive, which differentiates `angle`."
                )


def traced(*parts) -> bool:
    return any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(parts))


def check_clear_of_fence(parcel: Parcel, position, angle, fence: Fence, tilt, remedy: str) -> None:
    """Refuse a parcel of which a corner lies beyond the fence at rest, at the angle `tilt` [rad],
    by more than rounding. `position` is that of C_s [m]."""
    if traced(parcel, position, angle, fence, tilt):
        return
    parcel, turn, tilt = _check.on_host((parcel, angle, tilt))
    for number in _CORNERS:
        x, y = turned((np.cos(turn), np.sin(turn)), *parcel.corner(number))
        place_x, place_y = position[0] + x, position[1] + y
        along = place_x * np.cos(tilt) + place_y * np.sin(tilt)
        beyond = place_x * np.sin(tilt) - place_y * np.cos(tilt) + np.asarray(fence.rise(along))
        over = (along >= 0) & (along <= np.asarray(fence.reach))
        size = np.asarray(parcel.length + parcel.breadth)
        if np.any(over & (beyond > 1e-6 * size)):
            raise ValueError(
                f"The parcel must be clear of the fence at the start, but corner {number} is "
                f"{float(np.max(np.where(over, beyond, -np.inf))):g} [m] beyond it. {remedy}"
            )


def check_clear_of_surfaces(
    parcel: Parcel, position, angle, surfaces: tuple[AbstractSurface, ...], corners, remedy: str
) -> None:
    """Refuse a parcel of which one of the `corners` lies beyond a surface by more than rounding.
    `position` is that of C_s [m]."""
    if traced(parcel, position, angle, surfaces):
        return
    for index, surface in enumerate(surfaces):
        for number in corners:
            x, y = turned((jnp.cos(angle), jnp.sin(angle)), *parcel.corner(number))
            point = surface.at(position[0] + x, position[1] + y)
            inside = point.gap
            if point.beyond is not None:
                inside = jnp.where(point.beyond <= 0, inside, 0.0)
            if np.any(np.asarray(inside > 1e-6 * (parcel.length + parcel.breadth))):
                raise ValueError(
                    f"The parcel must be clear of the surfaces at the start, but corner {number} "
                    f"is {float(jnp.max(inside)):g} [m] inside `surfaces[{index}]`. {remedy}"
                )


def surfaces_of(surfaces: tuple[AbstractSurface, ...]) -> tuple[AbstractSurface, ...]:
    if not isinstance(surfaces, (tuple, list)) or not all(
        isinstance(surface, AbstractSurface) for surface in surfaces
    ):
        raise TypeError(
            f"Argument `surfaces` must be a tuple of surfaces, but is {surfaces!r}. Write, for "
            "example, surfaces=(fj.Border(),)."
        )
    return tuple(surfaces)


def duration_of(duration: float | None, default: float) -> float:
    return _check.number("duration", default if duration is None else duration, above=0, unit="s")


def cycle_of(drive: AbstractDrive) -> float:
    cycle = drive.cycle
    if isinstance(cycle, Tracer) or cycle.ndim > 0:
        raise ValueError(
            "Argument `duration` [s] must be given where the drive's cycle time is traced, but is "
            "None. Write, for example, duration=1.36: it sets the number of steps."
        )
    return float(cycle)
