"""Numbers that the paper leaves open, and their ranges over which its statements are repeated."""

import dataclasses
from typing import Any

import jax.numpy as jnp

import fencejax as fj

from .case import Case, Start, make, stack
from .fences import NAMES


@dataclasses.dataclass(frozen=True)
class Setting:
    """A choice of all numbers that the paper leaves open; the defaults are the project's own.

    **Fields:**

    - `length`, `breadth`: A and B [m].
    - `damping_ratio`: zeta [1]. `youngs_modulus`: E [Pa].
    - `law`: the drive's.
    - `distance`, `drive_angle`: R_s [m] and the drive's angle [rad] at the first contact.
    - `turn` [1]: the parcel's rotation then (see `Case`).
    - `front` [m]: the place of the sliding parcel's front when the drive starts.
    """

    length: float = 0.4
    breadth: float = 0.3
    damping_ratio: float = 0.05
    youngs_modulus: float = 3.0e9
    law: str = "harmonic"
    distance: float = 1.08
    drive_angle: float = 0.30
    turn: float = 1.0
    front: float = 0.1

    def cases(self) -> Case:
        """The two fences in this setting, one lane each.

        Raises `ValueError` where a number is out of range.
        """
        material = fj.Material(
            youngs_modulus=self.youngs_modulus, damping_ratio=self.damping_ratio
        )
        parcel = fj.Parcel(length=self.length, breadth=self.breadth)
        return stack(
            [
                make(
                    name,
                    distance=self.distance,
                    drive_angle=self.drive_angle,
                    turn=self.turn,
                    material=material,
                    parcel=parcel,
                    law=self.law,
                )
                for name in NAMES
            ]
        )

    def sliding(self) -> Start:
        """The place of the parcel of the slide, Delta s = 0, when the drive starts."""
        zero = jnp.zeros(len(NAMES))
        return Start(zero + self.front, zero, zero)


@dataclasses.dataclass(frozen=True)
class Variant:
    """One open number changed: its `title`, the `label` of its value, and the `changes` [SI]."""

    title: str
    label: str
    changes: dict[str, Any]

    def of(self, setting: Setting) -> Setting:
        """The setting with the number changed."""
        return dataclasses.replace(setting, **self.changes)


VARIANTS = (
    Variant("parcel A x B", "0.3 x 0.2 m", {"length": 0.3, "breadth": 0.2}),
    Variant("parcel A x B", "0.6 x 0.4 m", {"length": 0.6, "breadth": 0.4}),
    Variant("damping ratio", "0.02", {"damping_ratio": 0.02}),
    Variant("damping ratio", "0.10", {"damping_ratio": 0.10}),
    Variant("Young's modulus", "1.0 GPa", {"youngs_modulus": 1.0e9}),
    Variant("Young's modulus", "1.5 GPa", {"youngs_modulus": 1.5e9}),
    Variant("Young's modulus", "2.4 GPa", {"youngs_modulus": 2.4e9}),
    Variant("Young's modulus", "3.4 GPa", {"youngs_modulus": 3.4e9}),
    Variant("drive's law", "trapezoid", {"law": "trapezoid"}),
    Variant("drive's law", "S-curve", {"law": "S-curve"}),
    Variant("R_s", "1.00 m", {"distance": 1.00}),
    Variant("R_s", "1.10 m", {"distance": 1.10}),
    Variant("angle when met", "0.25 rad", {"drive_angle": 0.25}),
    Variant("angle when met", "0.40 rad", {"drive_angle": 0.40}),
    Variant("met at 2.42 m/s", "1.10 m", {"distance": 1.10, "drive_angle": 0.40}),
    Variant("parcel turned", "half", {"turn": 0.5}),
    Variant("parcel turned", "not at all", {"turn": 0.0}),
    Variant("front, slide", "0.0 m", {"front": 0.0}),
    Variant("front, slide", "0.2 m", {"front": 0.2}),
)
"""One number at a time at its low and its high value (or at its other values, for a choice; moist
PA6 has 1.0 to 1.5 GPa), and place and angle together, so that the corner itself is hit at the
paper's 2.42 m/s, which by default is the speed at the tip."""
