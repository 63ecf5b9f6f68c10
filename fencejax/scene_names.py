"""The table of a scene's numbers: path, name, unit, default bounds of each.

Everything that speaks of a number by name reads this table: design variables, sweeps,
sensitivities, identification and the choice of a fidelity.
"""

import re
from collections.abc import Mapping
from typing import Any, NamedTuple


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

# The flexible link is at least half of the reach; the moduli run from polyethylene to glass-filled
# polyamide.
FENCE = (
    Number("fence.thickness", "m", "thickness", 0.01, 0.09, sign=ABOVE),
    Number("length_ratio", "1", "length_ratio", 0.0, 1.0, _LINE, LEAST),
    Number("reach", "m", "reach", 0.9, 1.8, sign=ABOVE),
    Number("fence.width", "m", "width", 0.03, 0.40, sign=ABOVE),
    Number("fence.material.youngs_modulus", "Pa", "youngs_modulus", 0.5e9, 10e9, sign=ABOVE),
    Number("fence.material.density", "kg/m^3", "density", 900.0, 2000.0, sign=ABOVE),
    Number("fence.material.damping_ratio", "1", "damping_ratio", 0.005, 0.20, sign=LEAST),
    Number("fence.rigid_length", "m", "rigid_length", sign=LEAST),
    Number("fence.flexible_length", "m", "flexible_length", sign=ABOVE),
)
DRIVE = (
    Number("drive.top_speed", "rad/s", "top_speed", 0.5, 4.0, sign=LEAST),
    Number("drive.cycle_time", "s", "cycle_time", 0.5, 4.0, sign=ABOVE),
    Number("drive.speed", "rad/s", "speed", 0.5, 4.0, sign=ABOVE),
    Number("drive.held_angle", "rad", "held_angle", -1.0, 1.0, _LINE),
    Number("drive.end_angle", "rad", "end_angle", 0.3, 1.2, sign=ABOVE),
    Number("drive.acceleration", "rad/s^2", "acceleration", 2.0, 60.0, sign=ABOVE),
    Number("drive.jerk", "rad/s^3", "jerk", 20.0, 2000.0, sign=ABOVE),
    Number("drive.dwell", "s", "dwell", 0.0, 1.0, _LINE, LEAST),
    Number("drive.control_angles", "rad", "control_angles", -0.2, 1.2, _LINE),
    Number("drive.hold_time", "s", "hold_time", sign=ABOVE),
    Number("drive.turn", "1", "turn", sign=ABOVE),
)
# Parcels as a sorter meets them.
PARCEL = (
    Number("parcel.mass", "kg", "mass", 0.2, 30.0, sign=ABOVE),
    Number("parcel.length", "m", "length", 0.1, 0.8, sign=ABOVE),
    Number("parcel.breadth", "m", "breadth", 0.1, 0.6, sign=ABOVE),
    Number("parcel.center_x", "m", "center_x", -0.05, 0.05, _LINE),
    Number("parcel.center_y", "m", "center_y", -0.05, 0.05, _LINE),
    Number("parcel.given_inertia", "kg m^2", "inertia", 0.01, 2.0, sign=ABOVE),
    Number("parcel.stiffness", "N/m^4", "stiffness", 1e8, 1e10, sign=LEAST),
    Number("parcel.damping", "N s kg^-0.4 m^-3", "damping", 1e5, 1e6, sign=LEAST),
)
BELT = (
    Number("belt.speed", "m/s", "belt_speed", 0.5, 3.0, sign=LEAST),
    Number("belt.width", "m", "belt_width", 0.5, 1.0, sign=ABOVE),
    Number("belt.gravity", "m/s^2", "gravity", 1.0, 10.0, sign=LEAST),
)
FRICTION = (
    Number("belt.friction.kinetic", "1", "belt_kinetic_friction", 0.2, 0.9, _LINE, LEAST),
    Number("belt.friction.static", "1", "belt_static_friction", 0.3, 1.0, _LINE, LEAST),
    Number("fence_friction.kinetic", "1", "fence_kinetic_friction", 0.1, 0.6, _LINE, LEAST),
    Number("fence_friction.static", "1", "fence_static_friction", 0.2, 0.8, _LINE, LEAST),
    Number("border.friction.kinetic", "1", "border_kinetic_friction", 0.1, 0.6, _LINE, LEAST),
    Number("border.friction.static", "1", "border_static_friction", 0.2, 0.8, _LINE, LEAST),
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
