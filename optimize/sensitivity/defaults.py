"""The ranges of inputs for which none is given: the paper's, or those of a sorter."""

import numpy as np

import fencejax as fj
from fencejax.scenes import AnyScene, numbers as scene_numbers
from fencejax.sorter import Machine, scene_path

from ..common.machine import place

# name, lower, upper, unit, scaling: ranges of PA6, of a sorter's parcels and of its settings around
# the paper's numbers, in which the corner stays on the fence.
_RANGES = (
    fj.DesignVariable("thickness", 0.040, 0.050, "m", "linear"),
    fj.DesignVariable("length_ratio", 0.4, 0.8, "1", "linear"),
    fj.DesignVariable("youngs_modulus", 2.0e9, 3.5e9, "Pa", "linear"),
    fj.DesignVariable("density", 1080.0, 1180.0, "kg/m^3", "linear"),
    fj.DesignVariable("damping_ratio", 0.02, 0.10, "1", "linear"),
    fj.DesignVariable("mass", 5.0, 20.0, "kg", "linear"),
    fj.DesignVariable("stiffness", 0.86e9, 3.44e9, "N/m^4"),
    fj.DesignVariable("damping", 1.65e5, 6.6e5, "N s kg^-0.4 m^-3"),
    fj.DesignVariable("belt_speed", 1.6, 2.4, "m/s", "linear"),
    fj.DesignVariable("belt_kinetic_friction", 0.5, 0.8, "1", "linear"),
    fj.DesignVariable("fence_kinetic_friction", 0.2, 0.5, "1", "linear"),
    fj.DesignVariable("distance", 0.7, 1.0, "m", "linear"),
    fj.DesignVariable("drive_angle", 0.25, 0.35, "rad", "linear"),
    fj.DesignVariable("top_speed", 1.3, 1.8, "rad/s", "linear"),
    fj.DesignVariable("offset", 0.0, 0.2, "m", "linear"),
    fj.DesignVariable("speed", 1.5, 2.5, "m/s", "linear"),
)
RANGES = {variable.name: variable for variable in _RANGES}
"""Inputs with default ranges; those that the scene has are studied by default."""
# The paper's places of the local study and its line along the fence [m].
_DISTANCES, _LINE = (0.8, 1.0), (0.5, 1.1)
# Numbers of the scene and not of a sorter.
_OF_SCENE = ("distance", "drive_angle", "speed")
_EITHER_SIDE = (0.9, 1.1)


def present(scene: AnyScene) -> list[str]:
    """The inputs with default ranges that the scene has."""
    return [name for name in RANGES if scene_numbers.has(scene, name)]


def distances(scene: AnyScene) -> tuple[str, ...]:
    """The places of the local study, as `NAME=VALUE`; one text without numbers if the scene has no
    distance."""
    if "distance" not in present(scene):
        return ("",)
    return tuple(f"distance={_on_fence(scene, of_paper)}" for of_paper in _DISTANCES)


def line(scene: AnyScene) -> str:
    """The line along the fence, as `NAME=LOWER:UPPER`; `""` if the scene has no distance."""
    if "distance" not in present(scene):
        return ""
    lower, upper = (_on_fence(scene, of_paper) for of_paper in _LINE)
    return f"distance={lower}:{upper}"


def _on_fence(scene: AnyScene, of_paper: float) -> float:
    assert scene.fence is not None
    return place(float(scene.fence.reach), of_paper)


def usual(scene: AnyScene, machine: Machine | None) -> dict[str, fj.DesignVariable]:
    """The inputs with default ranges that the scene has, with these.

    Of a sorter the range is the span of a free number, or of the sorter's parcels. Of the distance
    it is the same share of the reach as of the paper's fence. Of any other number it is that of
    `RANGES` or, where this does not hold the sorter's own value, 10 % either side of it; a value of
    0 outside its range has none.
    """
    if machine is None:
        return {name: RANGES[name] for name in present(scene)}
    spans, found = _spans(scene, machine), {}
    for name in present(scene):
        path, variable = scene_numbers.resolve(scene, name), RANGES[name]
        (value,) = map(float, scene_numbers.read(scene, [name]))
        lower, upper = variable.lower, variable.upper
        if path in spans:
            lower, upper = spans[path]
        elif name == "distance":
            lower, upper = (_on_fence(scene, end) for end in (lower, upper))
        elif name not in _OF_SCENE and not lower <= value <= upper:
            lower, upper = sorted(float(f"{share * value:.4g}") for share in _EITHER_SIDE)
        if lower < upper:
            scaling = variable.scaling if lower > 0 else "linear"
            found[name] = fj.DesignVariable(name, lower, upper, variable.unit, scaling)
    return found


def _spans(scene: AnyScene, machine: Machine) -> dict[str, tuple[float, float]]:
    """Least and largest value [SI] of numbers that differ between parcels, and of free ones, by
    their paths in the scene."""
    parcels = {
        path: (float(np.min(column)), float(np.max(column)))
        for path, column in machine.parcels.columns.items() if np.ptp(column) > 0
    }  # fmt: skip
    free = {scene_path(path): (span.lower, span.upper) for path, span in machine.free.items()}
    return {
        scene_numbers.resolve(scene, name): ends
        for name, ends in (parcels | free).items() if scene_numbers.has(scene, name)
    }  # fmt: skip
