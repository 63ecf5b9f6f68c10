"""The table of a scene's numbers: path, name, unit, default bounds of each.

Everything that refers to a number by name reads this table: design variables, sweeps,
sensitivities, identification and the choice of a fidelity. Units and signs are those of the parts'
own `bounds`.
"""

import re
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple, Protocol

from .._check import Bounds
from ..parts import (
    Belt,
    ConstantSpeedDrive,
    Fence,
    Friction,
    HarmonicDrive,
    HeldDrive,
    Material,
    Pad,
    Parcel,
    PneumaticDrive,
    RestShape,
    SCurveDrive,
    Shaft,
    Shear,
    SplineDrive,
    TorqueDrive,
    TrapezoidDrive,
)


class Number(NamedTuple):
    """A number of a scene.

    **Fields:**

    - `path`: where a scene holds it, such as `"fence.material.density"`; of a vector, the path of
      the whole. A number derived from several (see `DERIVED`) has its name instead.
    - `bounds`: its unit, and the bounds that its part sets.
    - `name`: its name besides its path. Two numbers that are never in one scene may share it.
    - `lower`, `upper`: default bounds [`unit`] of designs and sweeps, if it has any, with their
      `scaling` (see `fencejax.DesignVariable`).

    >>> number = fj.scene_numbers.number(fj.scenes.oblique_impact(), "thickness")
    >>> number.path, number.unit
    ('fence.thickness', 'm')
    """

    path: str
    bounds: Bounds
    name: str | None = None
    lower: float | None = None
    upper: float | None = None
    scaling: str = "logarithmic"

    @property
    def unit(self) -> str:
        """The unit in the SI."""
        return self.bounds.unit

    @property
    def sign(self) -> str:
        """`"above 0"`, `"at least 0"` or nothing."""
        return ABOVE if self.bounds.above == 0 else LEAST if self.bounds.least == 0 else ""


ABOVE, LEAST = "above 0", "at least 0"
"""The possible signs."""
_LINE = "linear"
DERIVED = ("reach", "length_ratio")
"""Names of what is not a number of the scene itself, but of both lengths of the fence: l_s + l_p at
a constant l_s / l_p, and l_s / l_p at a constant l_s + l_p."""


class _Part(Protocol):
    bounds: ClassVar[dict[str, Bounds]]


def _of(part: type[_Part], path: str, *rest: Any, field: str | None = None) -> Number:
    """A number with the bounds of a part's `field`, by default the end of the path."""
    return Number(path, part.bounds[field or path.rpartition(".")[2]], *rest)


def _free(path: str, unit: str, *rest: Any, **bounds: float) -> Number:
    """A number for which no part sets bounds."""
    return Number(path, Bounds(unit, **bounds), *rest)


# The flexible link is at least half of the reach; the moduli run from polyethylene to glass-filled
# polyamide.
FENCE = (
    _of(Fence, "fence.thickness", "thickness", 0.01, 0.09),
    _free("length_ratio", "1", "length_ratio", 0.0, 1.0, _LINE, least=0),
    _free("reach", "m", "reach", 0.9, 1.8, above=0),
    _of(Fence, "fence.width", "width", 0.03, 0.40),
    _of(Material, "fence.material.youngs_modulus", "youngs_modulus", 0.5e9, 10e9),
    _of(Material, "fence.material.density", "density", 900.0, 2000.0),
    _of(Material, "fence.material.damping_ratio", "damping_ratio", 0.005, 0.20),
    _of(Fence, "fence.rigid_length", "rigid_length"),
    _of(Fence, "fence.flexible_length", "flexible_length"),
    _of(Pad, "fence.pad.thickness", "pad_thickness", 0.0, 0.03, _LINE),
    _of(Pad, "fence.pad.modulus", "pad_modulus", 5e4, 5e6),
    _of(Shaft, "fence.shaft.stiffness", "shaft_stiffness", 1e4, 1e7),
    _of(Shaft, "fence.shaft.damping", "shaft_damping"),
    _of(Shaft, "fence.shaft.inertia", "shaft_inertia"),
    _of(Shaft, "fence.shaft.slip_torque", "slip_torque", 50.0, 5e3),
    _of(Pad, "fence.pad.contact_length", "pad_contact_length"),
    _of(Pad, "fence.pad.retardation_time", "pad_retardation_time"),
    _of(Fence, "fence.edge_radius", "edge_radius", 0.0, 0.03, _LINE),
    _of(RestShape, "fence.rest_shape.tip", "rest_tip", -0.06, 0.06, _LINE),
    _of(RestShape, "fence.rest_shape.middle", "rest_middle", -0.03, 0.03, _LINE),
    _of(Shear, "fence.shear.poissons_ratio", "poissons_ratio"),
    _of(Shear, "fence.shear.coefficient", "shear_coefficient"),
)
# Of several drives with such a number, the one with the widest bounds.
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
    _of(TorqueDrive, "drive.torques", "torques", -1e3, 1e3, _LINE),
    _of(PneumaticDrive, "drive.pressure", "pressure", 0.0, 1e6, _LINE),
    _of(PneumaticDrive, "drive.area", "piston_area", 3e-4, 2e-2),
    _of(PneumaticDrive, "drive.lever", "lever", 0.03, 0.3),
    _of(PneumaticDrive, "drive.fill_time", "fill_time", 0.01, 0.5),
    _of(PneumaticDrive, "drive.open_time", "open_time", 0.1, 2.0),
    _of(TorqueDrive, "drive.inertia", "drive_inertia", 0.01, 100.0),
    _of(TorqueDrive, "drive.damping", "drive_damping", 0.0, 300.0, _LINE),
    _of(TorqueDrive, "drive.stiffness", "drive_stiffness", 0.0, 1e3, _LINE),
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
    _free("start.place", "m", "distance", 0.5, 1.1, _LINE, least=0),
    _free("start.drive_angle", "rad", "drive_angle", 0.1, 0.5, _LINE),
    _free("start.parcel_angle", "rad", "parcel_angle", -0.5, 0.5, _LINE),
    _free("start.front", "m", "front", -0.5, 0.5, _LINE),
    _free("start.offset", "m", "offset", 0.0, 0.3, _LINE, least=0),
    _free("start.angle", "rad", "angle", -0.5, 0.5, _LINE),
    _free("start.velocity[0]", "m/s"),
    _free("start.velocity[1]", "m/s"),
    _free("start.velocity[2]", "rad/s"),
    _free("start.motion.x", "m"),
    _free("start.motion.y", "m"),
    _free("start.motion.angle", "rad"),
    _free("start.motion.x_rate", "m/s"),
    _free("start.motion.y_rate", "m/s"),
    _free("start.motion.spin", "rad/s"),
)
# A scene with one coordinate holds these itself.
NORMAL = (
    _free("speed", "m/s", "speed"),
    _free("distance", "m", "distance", least=0),
)
NUMBERS = (*FENCE, *DRIVE, *PARCEL, *BELT, *FRICTION, *START, *NORMAL)
"""All that have a name, or that no part describes. Any other number is found by its path, with the
bounds of the part that holds it (see `fencejax.scene_numbers.number`)."""

PATHS: Mapping[str, tuple[str, ...]] = {
    name: tuple(number.path for number in NUMBERS if number.name == name)
    for name in dict.fromkeys(number.name for number in NUMBERS)
    if name is not None
}
"""Paths of a name; a scene has one of them at most."""

BY_PATH = {number.path: number for number in NUMBERS}


def element(name: str) -> tuple[str, int | None]:
    """`"control_angles[3]"` as ("control_angles", 3): a vector and a place in it. Anything else
    with `None`.

    >>> fj.scenes.element("control_angles[3]"), fj.scenes.element("mass")
    (('control_angles', 3), ('mass', None))
    """
    match = re.fullmatch(r"(.*\w)\[(\d+)\]", name)
    return (name, None) if match is None else (match[1], int(match[2]))


def known(name: str) -> Number | None:
    """The number of the table with a path or a name, or that of the vector it is an element of;
    of several with a name the first that has default bounds. `None` if there is none."""
    for one in (name, element(name)[0]):
        found = [BY_PATH[path] for path in (one, *PATHS.get(one, ())) if path in BY_PATH]
        if found:
            return next((number for number in found if number.lower is not None), found[0])
    return None


def at(path: str) -> Number:
    """The number at a path, or that of the vector it is an element of.

    Raises `ValueError` for a path that is none of the table's.
    """
    found = BY_PATH.get(path, BY_PATH.get(element(path)[0]))
    if found is not None:
        return found
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
