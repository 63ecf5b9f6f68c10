"""Implausible numbers of a sorter, and what was probably meant."""

from collections.abc import Iterable, Mapping

from .amounts import amount

# Lowest and highest plausible value [SI] of a sorter's number, by the end of its path. The ranges
# are wide: they detect a wrong unit, not an unusual machine.
_USUAL: Mapping[str, tuple[float, float]] = {
    "belt.speed": (0.02, 8.0),
    "belt.width": (0.1, 4.0),
    "gravity": (1.0, 30.0),
    "kinetic": (0.0, 2.0),
    "static": (0.0, 2.0),
    "fence.rigid_length": (0.0, 5.0),
    "fence.flexible_length": (0.03, 5.0),
    "reach": (0.1, 6.0),
    "fence.width": (3e-3, 1.5),
    "fence.thickness": (2e-4, 0.3),
    "fence.edge_radius": (0.0, 0.2),
    "shaft.stiffness": (10.0, 1e12),
    "shaft.damping": (0.0, 1e7),
    "shaft.slip_torque": (0.05, 1e6),
    "shaft.inertia": (0.0, 100.0),
    "pad.thickness": (0.0, 0.3),
    "rest_shape.tip": (-1.0, 1.0),
    "rest_shape.middle": (-1.0, 1.0),
    "pad.modulus": (1e3, 1e10),
    "pad.contact_length": (1e-3, 1.0),
    "pad.retardation_time": (0.0, 1.0),
    "youngs_modulus": (3e6, 1e12),
    "density": (50.0, 23e3),
    "damping_ratio": (0.0, 0.5),
    "allowed_stress": (1e4, 5e9),
    "fatigue_strength": (1e4, 5e9),
    "fatigue_exponent": (2.0, 50.0),
    "drive.top_speed": (0.0, 60.0),
    "drive.speed": (0.0, 60.0),
    "drive.cycle_time": (0.05, 60.0),
    "drive.hold_time": (0.05, 60.0),
    "drive.acceleration": (1e-2, 1e4),
    "drive.jerk": (1e-1, 1e7),
    "drive.dwell": (0.0, 60.0),
    "drive.end_angle": (0.01, 3.1),
    "drive.inertia": (0.0, 1e4),
    "drive.damping": (0.0, 1e6),
    "drive.stiffness": (0.0, 1e6),
    "drive.pressure": (1e4, 1e7),
    "drive.area": (1e-6, 1.0),
    "drive.lever": (1e-3, 2.0),
    "drive.fill_time": (1e-4, 10.0),
    "drive.open_time": (1e-3, 60.0),
    "mass": (5e-3, 200.0),
    "length": (0.02, 4.0),
    "breadth": (0.02, 4.0),
    "stiffness": (1e4, 1e15),
    "damping": (1.0, 1e10),
    "height": (1e-3, 4.0),
    "critical_load": (1.0, 1e4),
    "critical_velocity_change": (0.05, 50.0),
    "offset": (0.0, 4.0),
    "front": (-20.0, 4.0),
    "motor.torque": (0.05, 1e6),
    "motor.rated_torque": (0.05, 1e6),
    "motor.stall_torque": (0.05, 1e6),
    "motor.no_load_speed": (0.05, 500.0),
    "motor.rotor_inertia": (0.0, 1.0),
    "motor.gear_ratio": (0.2, 1000.0),
    "motor.efficiency": (0.1, 1.0),
    "period": (0.1, 300.0),
    "limits.tip_deflection": (1e-4, 3.0),
    "limits.stress": (1e4, 5e9),
    "limits.torque": (0.05, 1e6),
    "limits.ring": (1e-6, 1.0),
    "limits.life": (1.0, 1e12),
}
# Units that are often typed instead of the SI unit.
_SLIPS: Mapping[str, tuple[str, ...]] = {
    "m": ("mm", "cm", "in"),
    "Pa": ("GPa", "MPa", "kPa", "bar"),
    "kg/m^3": ("g/cm^3",),
    "kg": ("g",),
    "s": ("ms", "min"),
    "rad": ("deg",),
    "rad/s": ("deg/s", "rpm"),
    "rad/s^2": ("deg/s^2",),
    "m/s": ("mm/s", "m/min"),
    "1": ("%",),
    "N m": ("N mm", "kN m"),
    "m/s^2": ("mm/s^2",),
}


def _usual(path: str) -> tuple[float, float] | None:
    """The range of the longest end of a path that is in the table."""
    parts = path.split(".")
    for begin in range(len(parts)):
        found = _USUAL.get(".".join(parts[begin:]))
        if found is not None:
            return found
    return None


def doubt(path: str, value: float, unit: str) -> str | None:
    """A warning about an implausible number [`unit`], with what was probably meant; `None` for a
    plausible one."""
    span = _usual(path)
    if span is None or span[0] <= value <= span[1]:
        return None
    meant = [
        f"{value:g} {slip}"
        for slip in _SLIPS.get(unit, ())
        if span[0] <= amount(path, f"{value!r} {slip}", unit) <= span[1]
    ]
    likely = f" Is it {' or '.join(meant)}?" if meant else ""
    return (
        f"`{path}` is {value:g} [{unit}], where machines have {span[0]:g} ... {span[1]:g}.{likely}"
    )


def doubts(numbers: Iterable[tuple[str, float, str]]) -> tuple[str, ...]:
    """The warnings about numbers, given as path, value and unit."""
    found = (doubt(path, float(value), unit) for path, value, unit in numbers)
    return tuple(dict.fromkeys(text for text in found if text is not None))
