"""The kinds of scenes that are searched for errors, each with the bounds of its numbers."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from robustness import extreme_sorts
from robustness.extreme_scenes import ORDINARY, USUAL, WIDE, impact, riding

import fencejax as fj

_FENCE_AND_PARCEL = {
    "modulus": (1e8, 2.1e11), "density": (400, 8000), "thickness": (3e-3, 0.09),
    "damping_ratio": (0.002, 0.1), "mass": (0.2, 60), "stiffness": (1e7, 1e13),
    "damping": (1e1, 1e7),
}  # fmt: skip
"""What a real fence and parcel can have; E / rho is at most 1e8 m^2/s^2, besides, and static
friction no less than kinetic."""
REALISTIC = {**USUAL, **_FENCE_AND_PARCEL, "flexible": (0.15, 1.0)}
# A sort's numbers, as far as a scene of its own does not already name them.
_SORT = {
    **{name: REALISTIC[name] for name in (
        "reach", "flexible", "length", "aspect", "belt", "belt_kinetic", "belt_static", "kinetic",
        "static", "top_speed",
    )},
    **_FENCE_AND_PARCEL, "border": (0.05, 1.0),
}  # fmt: skip
_WIDE_SORT = {name: WIDE.get(name, (1e-3, 5.0)) for name in _SORT}
_IN_PARCEL = {"across": (-0.5, 0.5), "along": (-0.5, 0.5)}
_ON_BELT = {**_IN_PARCEL, "front": (-0.3, 0.6), "offset": (0.0, 0.3), "turn": (-0.3, 0.3)}
ANGLES = 8
_FREE = {**_ON_BELT, "cycle": (0.9, 1.5), **{f"angle_{k}": (0.0, 0.8) for k in range(ANGLES)}}
_NORMAL = (
    "thickness", "reach", "flexible", "width", "modulus", "density", "damping_ratio", "mass",
    "length", "aspect", "stiffness", "damping", "place", "approach",
)  # fmt: skip


class Searched(NamedTuple):
    """A kind of scene: how numbers make one, what else they are where nothing is said, the bounds
    of those that are varied by ratios, `realistic` and `wide`, and of those varied by differences;
    the numbers that a gradient is by, and the fixed step of the truth [s], `None` where its steps
    follow their error.
    """

    scene: Callable[[Mapping[str, Any]], Any]
    ordinary: Mapping[str, float]
    realistic: Mapping[str, tuple[float, float]]
    wide: Mapping[str, tuple[float, float]]
    by_differences: Mapping[str, tuple[float, float]]
    varied: tuple[str, ...]
    step: float | None

    def bounds(self, name: str) -> Mapping[str, tuple[float, float]]:
        """Those of that name."""
        return getattr(self, name)

    def numbers(self, shares, name: str) -> dict[str, np.ndarray]:
        """Numbers of lanes from shares in [0, 1] of the bounds of that name, (lanes, numbers)."""
        bounds = self.bounds(name)
        found = {n: np.full(len(shares), value) for n, value in self.ordinary.items()}
        for column, (n, (low, high)) in zip(shares.T, bounds.items(), strict=False):
            found[n] = np.exp(np.log(low) + column * np.log(high / low))
        for column, (n, (low, high)) in zip(
            shares.T[len(bounds) :], self.by_differences.items(), strict=True
        ):
            found[n] = low + column * (high - low)
        found["modulus"] = np.minimum(found["modulus"], 1e8 * found["density"])
        found["ride"] = found["belt"]
        if name == "realistic":
            for kinetic, static in (("belt_kinetic", "belt_static"), ("kinetic", "static")):
                found[static] = np.maximum(found[static], found[kinetic])
        return found

    def count(self, name: str) -> int:
        """How many numbers are varied."""
        return len(self.bounds(name)) + len(self.by_differences)


def _normal(x):
    flexible, breadth = x["reach"] * x["flexible"], x["length"] * x["aspect"]
    return fj.scenes.normal_impact(
        fence=fj.Fence(
            x["reach"] - flexible, flexible, x["width"], x["thickness"],
            fj.Material(x["modulus"], x["density"], x["damping_ratio"]),
        ),
        distance=x["place"] * x["reach"], speed=x["approach"], duration=0.1,
        parcel=fj.Parcel(
            mass=x["mass"], length=x["length"], breadth=breadth, stiffness=x["stiffness"],
            damping=x["damping"],
        ),
    )  # fmt: skip


def _free_drive(x):
    angles = jnp.stack([jnp.asarray(x[f"angle_{k}"]) for k in range(ANGLES)])
    scene = extreme_sorts.scene("sort", x)
    given = {name: getattr(scene, name) for name in ("fence", "parcel", "belt", "fence_friction")}
    border = fj.Border(fj.Friction(x["border"], x["border"]))
    return fj.scenes.whole_sort(
        drive=fj.SplineDrive(angles, x["cycle"]), front=x["front"], offset=x["offset"],
        angle=x["turn"], border=border, duration=1.36, **given,
    )  # fmt: skip


_OF_IMPACT = (
    "thickness", "modulus", "density", "damping_ratio", "mass", "stiffness", "belt", "reach"
)  # fmt: skip
_OF_NORMAL = ("approach" if name == "belt" else name for name in _OF_IMPACT)

KINDS = {
    "impact": Searched(
        lambda x: impact(x, 0.1), ORDINARY, REALISTIC, WIDE, _IN_PARCEL, _OF_IMPACT, 1e-5
    ),
    "normal impact": Searched(
        _normal, ORDINARY, {n: REALISTIC[n] for n in _NORMAL}, {n: WIDE[n] for n in _NORMAL}, {},
        tuple(_OF_NORMAL), 1e-5,
    ),
    "sort": Searched(
        lambda x: extreme_sorts.scene("sort", x), extreme_sorts.ORDINARY, _SORT, _WIDE_SORT,
        _ON_BELT, _OF_IMPACT, None,
    ),
    "sort, free drive": Searched(
        _free_drive, extreme_sorts.ORDINARY,
        {n: b for n, b in _SORT.items() if n != "top_speed"},
        {n: b for n, b in _WIDE_SORT.items() if n != "top_speed"},
        _FREE, _OF_IMPACT, None,
    ),
}  # fmt: skip
"""Every kind by name."""


def changed(x, varied):
    """The numbers with some of them changed (see `riding`)."""
    return riding(x, varied) if "belt" in varied else x | varied
