"""The measured scenes as rows of numbers: the paper's own and a random set around it."""

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

import fencejax as fj

VARIABLES = (
    "thickness", "rigid_length", "flexible_length", "youngs_modulus", "density", "damping_ratio",
    "mass", "distance",
)  # fmt: skip
"""Variables of the gradients: h_1, l_s, l_p, E, rho, zeta, m_p and R. In the whole sort `distance`
is x of the parcel's front when the drive starts."""
SYMBOLS = ("$h_1$", "$l_s$", "$l_p$", "$E$", r"$\rho$", r"$\zeta$", "$m_p$", "$R$")
QUANTITIES = ("peak_force", "tip_deflection", "impulse")
TITLES = tuple(name.replace("_", " ") for name in QUANTITIES)
SCENES = ("impact", "slide", "sort", "random", "sorts")

_PAPER = {
    "thickness": 0.045, "rigid_length": 0.45, "flexible_length": 0.75, "youngs_modulus": 3.0e9,
    "density": 1130.0, "damping_ratio": 0.05, "mass": 15.0, "distance": 1.0, "drive_angle": 0.30,
    "fence_friction": 0.35, "belt_friction": 0.65,
}  # fmt: skip
NUMBERS = tuple(_PAPER)
"""Columns of a family's numbers: the variables, the drive angle [rad] at the touch, and the kinetic
coefficients of fence and belt."""

RANGES = {
    # lower, upper, whether logarithmic
    "distance": (0.60, 1.06, False),
    "mass": (2.0, 25.0, True),
    "drive_angle": (0.20, 0.40, False),
    "thickness": (0.040, 0.060, True),
    "youngs_modulus": (2.0e9, 5.0e9, True),
    "damping_ratio": (0.02, 0.10, True),
    "fence_friction": (0.20, 0.50, False),
    "belt_friction": (0.40, 0.80, False),
}
"""Ranges of the random impacts, in SI units; other numbers are the paper's."""

# Static over kinetic coefficients of the paper.
_FENCE_STATIC, _BELT_STATIC = 0.5 / 0.35, 0.85 / 0.65


@dataclasses.dataclass(frozen=True, eq=False)
class Family:
    """Scenes of one structure, one compiled program: `numbers` of shape (lanes, 11), columns
    `NUMBERS` [SI], each over `duration` [s]. `kind` is `"impact"`, `"slide"` or `"sort"`."""

    kind: str
    numbers: np.ndarray
    duration: float

    def first(self, lanes: int) -> "Family":
        """The same with its first lanes only."""
        return dataclasses.replace(self, numbers=self.numbers[:lanes])

    def repeated(self, lanes: int) -> "Family":
        """The same, over and over, until there are that many lanes."""
        return dataclasses.replace(
            self, numbers=np.resize(self.numbers, (lanes, self.numbers.shape[1]))
        )


def impacts(count: int, seed: int, duration: float) -> Family:
    """The paper's impact at R = 1.0 m in lane 0, followed by `count` random ones."""
    rng = np.random.default_rng(seed)
    columns = []
    for name, value in _PAPER.items():
        if name not in RANGES:
            columns.append(np.full(1 + count, value))
            continue
        low, high, logarithmic = RANGES[name]
        share = rng.uniform(size=count)
        drawn = low * (high / low) ** share if logarithmic else low + (high - low) * share
        columns.append(np.concatenate([[value], drawn]))
    return Family("impact", np.stack(columns, axis=1), duration)


def slide() -> Family:
    """The parcel's wall lying on the fence and sliding along it, `scenes.along_fence`."""
    numbers = _PAPER | {"distance": 0.8, "drive_angle": 0.25}
    return Family("slide", np.array([list(numbers.values())]), 0.25)


def sort() -> Family:
    """The whole sort at Delta s = 0, parcel's front at 0.1 m, `scenes.whole_sort`."""
    return Family("sort", np.array([list((_PAPER | {"distance": 0.1}).values())]), 1.36)


def sorts(count: int, seed: int) -> Family:
    """Random whole sorts over the ranges of the random impacts, the parcel's front at -0.2 to
    0.3 m when the drive starts."""
    rows = impacts(count, seed, 1.36).numbers[1:]
    fronts = np.random.default_rng(seed + 1).uniform(-0.2, 0.3, count)
    rows[:, NUMBERS.index("distance")] = fronts
    return Family("sort", rows, 1.36)


def scene(family: Family, numbers: Array, factors: Array) -> fj.Scene:
    """One scene from a row of numbers of shape (11,), its variables times `factors` [1] of shape
    (8,)."""
    given = {name: numbers[k] for k, name in enumerate(NUMBERS)}
    for k, name in enumerate(VARIABLES):
        given[name] = given[name] * factors[k]
    for part, ratio in (("fence", _FENCE_STATIC), ("belt", _BELT_STATIC)):
        kinetic = given.pop(f"{part}_friction")
        given |= {f"{part}_kinetic_friction": kinetic, f"{part}_static_friction": ratio * kinetic}
    if family.kind == "sort":
        given["front"] = given.pop("distance")
        del given["drive_angle"]
    kinds = {"impact": "oblique_impact", "slide": "along_fence", "sort": "whole_sort"}
    made = fj.SceneFamily(kinds[family.kind], tuple(given), duration=family.duration)
    return made.scene(jnp.stack([*given.values()]))


def outcome(family: Family, fidelity: fj.Fidelity, numbers: Array, factors: Array):
    """Peak force [N], tip deflection [m] and impulse [N s], shape (3,), and the status."""
    made = scene(family, numbers, factors)
    result = fj.simulate(made, fidelity=fidelity, only=QUANTITIES)
    return jnp.stack([getattr(result, name) for name in QUANTITIES]), result.status
