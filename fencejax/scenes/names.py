"""The table of a scene's numbers: path, name, unit, default bounds of each.

Everything that speaks of a number by name reads this table: design variables, sweeps,
sensitivities, identification and the choice of a fidelity. Units and signs are those of the parts'
own `bounds`.
"""

import re
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple, Protocol

from .._check import Bounds
from ..parts import (
    AbstractContactLaw,
    AbstractFriction,
    AbstractSurface,
    Belt,
    ConstantSpeedDrive,
    Fence,
    Friction,
    HarmonicDrive,
    HeldDrive,
    Material,
    Parcel,
    SCurveDrive,
    SplineDrive,
    TrapezoidDrive,
)


class Number(NamedTuple):
    """A number of a scene.

    **Fields:**

    - `path`: where a scene holds it, such as `"fence.material.density"`; of a vector, the path of
      the whole. What is made of several numbers (see `DERIVED`) has its name instead.
    - `unit`: in the SI.
    - `name`: what it is called beside its path. Two numbers that no scene has at once may share it.
    - `lower`, `upper`: default bounds [`unit`] of designs and sweeps, if it has any, with their
      `scaling` (see `fencejax.DesignVariable`).
    - `sign`: what the part that holds it asks for: `"above 0"`, `"at least 0"` or nothing.
    """

    path: str
    unit: str
    name: str | None = None
    lower: float | None = None
    upper: float | None = None
    scaling: str = "logarithmic"
    sign: str = ""


ABOVE, LEAST = "above 0", "at least 0"
"""What a sign may be."""
_LINE = "linear"
DERIVED = ("reach", "length_ratio")
"""Names of what is not a number of the scene itself, but of both lengths of the fence: l_s + l_p at
a constant l_s / l_p, and l_s / l_p at a constant l_s + l_p."""


class _Part(Protocol):
    bounds: ClassVar[dict[str, Bounds]]


def _of(
    part: type[_Part],
    path: str,
    name: str | None = None,
    lower: float | None = None,
    upper: float | None = None,
    scaling: str = "logarithmic",
    *,
    field: str | None = None,
) -> Number:
    """A number with the unit and the sign of a part's `field`, by default the end of the path."""
    bounds = part.bounds[field or path.rpartition(".")[2]]
    sign = ABOVE if bounds.above == 0 else LEAST if bounds.least == 0 else ""
    return Number(path, bounds.unit, name, lower, upper, scaling, sign)


# The flexible link is at least half of the reach; the moduli run from polyethylene to glass-filled
# polyamide.
FENCE = (
    _of(Fence, "fence.thickness", "thickness", 0.01, 0.09),
    Number("length_ratio", "1", "length_ratio", 0.0, 1.0, _LINE, LEAST),
    Number("reach", "m", "reach", 0.9, 1.8, sign=ABOVE),
    _of(Fence, "fence.width", "width", 0.03, 0.40),
    _of(Material, "fence.material.youngs_modulus", "youngs_modulus", 0.5e9, 10e9),
    _of(Material, "fence.material.density", "density", 900.0, 2000.0),
    _of(Material, "fence.material.damping_ratio", "damping_ratio", 0.005, 0.20),
    _of(Fence, "fence.rigid_length", "rigid_length"),
    _of(Fence, "fence.flexible_length", "flexible_length"),
)
# Of several drives with such a number, the one that asks for least.
DRIVE = (
    _of(HarmonicDrive, "drive.top_speed", "top_speed", 0.5, 4.0),
    _of(HarmonicDrive, "drive.cycle_time", "cycle_time", 0.5, 4.0),
    _of(ConstantSpeedDrive, "drive.speed", "speed", 0.5, 4.0),
    _of(HeldDrive, "drive.held_angle", "held_angle", -1.0, 1.0, _LINE),
    _of(ConstantSpeedDrive, "drive.end_angle", "end_angle", 0.3, 1.2),
    _of(TrapezoidDrive, "drive.acceleration", "acceleration", 2.0, 60.0),
    _of(SCurveDrive, "drive.jerk", "jerk", 20.0, 2000.0),
    _of(TrapezoidDrive, "drive.dwell", "dwell", 0.0, 1.0, _LINE),
    _of(SplineDrive, "drive.control_angles", "control_angles", -0.2, 1.2, _LINE),
    _of(HeldDrive, "drive.hold_time", "hold_time"),
    _of(SplineDrive, "drive.turn", "turn"),
)
# Parcels as a sorter meets them.
PARCEL = (
    _of(Parcel, "parcel.mass", "mass", 0.2, 30.0),
    _of(Parcel, "parcel.length", "length", 0.1, 0.8),
    _of(Parcel, "parcel.breadth", "breadth", 0.1, 0.6),
    _of(Parcel, "parcel.center_x", "center_x", -0.05, 0.05, _LINE),
    _of(Parcel, "parcel.center_y", "center_y", -0.05, 0.05, _LINE),
    _of(Parcel, "parcel.given_inertia", "inertia", 0.01, 2.0, field="inertia"),
    _of(Parcel, "parcel.stiffness", "stiffness", 1e8, 1e10),
    _of(Parcel, "parcel.damping", "damping", 1e5, 1e6),
)
BELT = (
    _of(Belt, "belt.speed", "belt_speed", 0.5, 3.0),
    _of(Belt, "belt.width", "belt_width", 0.5, 1.0),
    _of(Belt, "belt.gravity", "gravity", 1.0, 10.0),
)
FRICTION = (
    _of(Friction, "belt.friction.kinetic", "belt_kinetic_friction", 0.2, 0.9, _LINE),
    _of(Friction, "belt.friction.static", "belt_static_friction", 0.3, 1.0, _LINE),
    _of(Friction, "fence_friction.kinetic", "fence_kinetic_friction", 0.1, 0.6, _LINE),
    _of(Friction, "fence_friction.static", "fence_static_friction", 0.2, 0.8, _LINE),
    _of(Friction, "border.friction.kinetic", "border_kinetic_friction", 0.1, 0.6, _LINE),
    _of(Friction, "border.friction.static", "border_static_friction", 0.2, 0.8, _LINE),
)
# How the scene begins; `distance` is where the parcel touches.
START = (
    Number("start.place", "m", "distance", 0.5, 1.1, _LINE, LEAST),
    Number("start.drive_angle", "rad", "drive_angle", 0.1, 0.5, _LINE),
    Number("start.parcel_angle", "rad", "parcel_angle", -0.5, 0.5, _LINE),
    Number("start.front", "m", "front", -0.5, 0.5, _LINE),
    Number("start.offset", "m", "offset", 0.0, 0.3, _LINE, LEAST),
    Number("start.angle", "rad", "angle", -0.5, 0.5, _LINE),
    Number("start.velocity[0]", "m/s"),
    Number("start.velocity[1]", "m/s"),
    Number("start.velocity[2]", "rad/s"),
    Number("start.motion.x", "m"),
    Number("start.motion.y", "m"),
    Number("start.motion.angle", "rad"),
    Number("start.motion.x_rate", "m/s"),
    Number("start.motion.y_rate", "m/s"),
    Number("start.motion.spin", "rad/s"),
)
# A scene with one coordinate holds these itself.
NORMAL = (
    Number("speed", "m/s", "speed"),
    Number("distance", "m", "distance", sign=LEAST),
)
NUMBERS = (*FENCE, *DRIVE, *PARCEL, *BELT, *FRICTION, *START, *NORMAL)
"""All of them. Numbers of a taper are not named: all are ratios [1]."""

PATHS: Mapping[str, tuple[str, ...]] = {
    name: tuple(number.path for number in NUMBERS if number.name == name)
    for name in dict.fromkeys(number.name for number in NUMBERS)
    if name is not None
}
"""Paths of a name; a scene has one of them at most."""

_BY_PATH = {number.path: number for number in NUMBERS}
_TAPER = "fence.taper."
# Where a scene holds a law that has numbers of its own.
_LAWS: Mapping[
    str, type[AbstractContactLaw] | type[AbstractFriction] | type[AbstractSurface]
] = {
    "parcel.contact": AbstractContactLaw,
    "belt.friction": AbstractFriction,
    "fence_friction": AbstractFriction,
    "border.friction": AbstractFriction,
    "surfaces": AbstractSurface,
    "surfaces.friction": AbstractFriction,
}


def _of_law(path: str) -> Number | None:
    """The number of a law, by the `bounds` of whichever class of that kind has such a field."""
    place, _, field = re.sub(r"\[\d+\]", "", path).rpartition(".")
    laws = _LAWS[place].__subclasses__() if place in _LAWS else ()
    found = {_of(law, path, field=field) for law in laws if field in law.bounds}
    return found.pop() if len(found) == 1 else None


def element(name: str) -> tuple[str, int | None]:
    """`"control_angles[3]"` as ("control_angles", 3): a vector and a place in it. Anything else
    with `None`."""
    match = re.fullmatch(r"(.*\w)\[(\d+)\]", name)
    return (name, None) if match is None else (match[1], int(match[2]))


def at(path: str) -> Number:
    """The number at a path, or that of the vector it is an element of.

    Raises `ValueError` for a path that no scene has.
    """
    for known in (path, element(path)[0]):
        if known in _BY_PATH:
            return _BY_PATH[known]
    if path.startswith(_TAPER):
        return Number(path, "1")
    of_law = _of_law(path)
    if of_law is not None:
        return of_law
    raise ValueError(
        f"Argument `name` must be the path of a scene's number, such as {PARCEL[0].path!r}, but is "
        f"{path!r}."
    )


def bounded(numbers: tuple[Number, ...]) -> dict[str, dict[str, Any]]:
    """Name, lower and upper bound, unit and scaling by name, of the numbers that have bounds."""
    fields = ("name", "lower", "upper", "unit", "scaling")
    return {
        number.name: {field: getattr(number, field) for field in fields}
        for number in numbers
        if number.name is not None and number.lower is not None
    }
