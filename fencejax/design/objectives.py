"""Objectives and limits of a design: quantities of a result, and bounds on them.

>>> fj.LIMITS["tip_deflection"]
tip_deflection at most 80 mm
>>> fj.OBJECTIVES["peak_force"].unit
'N'
"""

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from jaxtyping import Array

from .. import _check
from ..printing import shown
from ..results import MEASURES, Measure, Result
from ..scenes import NormalScene, Scene

AnyScene = NormalScene | Scene


@dataclasses.dataclass(frozen=True)
class Quantity:
    """A differentiable number read from a result: an objective, or limited by a bound.

    Call it: `quantity(result, scene)`. Where the scene lacks the part for it, it is 0, as in
    `Result`.

    **Fields:**

    - `name`, `unit`, `meaning`: what it is.
    - `read`: the function of the result and the scene behind it.
    - `needs`: the parts that the scene must have: `"fence"`, `"belt"`, `"drive"`.
    - `fields`: the fields of the result that it reads; `None` if unknown.
    - `measures`: those of its fields that are measures of its own, to be passed to
      `fencejax.simulate(measures=...)`, which computes only the measures asked for.

    >>> slenderness = fj.Quantity(
    ...     "slenderness", "1", "length over thickness",
    ...     lambda result, scene: scene.fence.flexible_length / scene.fence.thickness,
    ... )
    >>> round(float(slenderness(None, fj.scenes.oblique_impact())), 2)
    16.67
    """

    name: str
    unit: str
    meaning: str
    read: Callable[..., Array]
    needs: tuple[str, ...] = ()
    fields: tuple[str, ...] | None = None
    measures: tuple[Measure, ...] = ()

    def __repr__(self) -> str:
        return f"{self.name} [{self.unit}]: {self.meaning}"

    def applies_to(self, scene: AnyScene) -> bool:
        """Whether the scene has the parts that the quantity needs."""
        return all(getattr(scene, part, None) is not None for part in self.needs)

    def __call__(self, result: Result, scene: AnyScene) -> Array:
        """The value [`unit`].

        Raises `ValueError` where the scene lacks a part.
        """
        if not self.applies_to(scene):
            raise ValueError(
                f"Argument `scene` must have {self.needs} for `{self.name}`, but a part of that "
                "is None."
            )
        return self.read(result, scene)


def of_measure(
    measure: Measure, name: str | None = None, needs: tuple[str, ...] = ()
) -> Quantity:
    """A measure of a result as a quantity, by its own name or another.

    >>> fj.objectives.of_measure(fj.results.MEASURES["impulse"], "push").name
    'push'
    """
    field = measure.name
    return Quantity(
        field if name is None else name,
        measure.unit,
        measure.meaning,
        lambda result, scene: getattr(result, field),
        needs,
        (field,),
        () if field in MEASURES else (measure,),
    )


# Measures with another name as a quantity.
_KNOWN_AS = {"peak_border_force": "border_force", "deepest": "indentation"}
_MEASURED = {
    quantity.name: quantity
    for quantity in (of_measure(m, _KNOWN_AS.get(name)) for name, m in MEASURES.items())
}
PEAK_FORCE, TIP_DEFLECTION, PEAK_STRESS, IMPULSE, PEAK_TORQUE = (
    _MEASURED[name]
    for name in ("peak_force", "tip_deflection", "peak_stress", "impulse", "peak_torque")
)
BORDER_FORCE, CONTACT_TIME, INDENTATION = (
    _MEASURED[name] for name in ("border_force", "contact_time", "indentation")
)

CROSSING = Quantity(
    "crossing", "m", "how far C_s gets beyond the belt's far edge, max y - s",
    lambda result, scene: result.furthest_y - scene.belt.width,
    needs=("belt",),
    fields=("furthest_y",),
)  # fmt: skip
TIP_CLEARANCE = Quantity(
    "tip_clearance", "m", "shortest distance along the fence from a loaded corner to the tip",
    lambda result, scene: scene.fence.reach - result.largest_place,
    needs=("fence",),
    fields=("largest_place",),
)  # fmt: skip

RING_ENERGY = Quantity(
    "ring_energy", "J", "what the fence's motion and bending hold at the end, less at the start",
    lambda result, scene: result.energy.fence_kinetic + result.energy.strain,
    needs=("fence",),
    fields=("energy",),
)  # fmt: skip
FENCE_MASS = Quantity(
    "fence_mass", "kg", "mass of the rigid and the flexible link",
    lambda result, scene: scene.fence.mass,
    needs=("fence",),
    fields=(),
)  # fmt: skip
CYCLE_TIME = Quantity(
    "cycle_time", "s", "time until the drive is home again: the shortest from parcel to parcel",
    lambda result, scene: scene.drive.cycle,
    needs=("drive",),
    fields=(),
)  # fmt: skip


OBJECTIVES: Mapping[str, Quantity] = {
    **_MEASURED,
    **{q.name: q for q in (CROSSING, TIP_CLEARANCE, RING_ENERGY, FENCE_MASS, CYCLE_TIME)},
}
"""Every quantity by name: each measure of a result, and those computed from several measures or
from the scene."""


def fields(quantities: Iterable[Quantity]) -> tuple[str, ...] | None:
    """The fields of a result that some quantities read, for `fencejax.simulate(only=...)`; `None`
    if they are unknown for one of the quantities.

    >>> fj.objectives.fields([fj.objectives.PEAK_FORCE, fj.objectives.CROSSING])
    ('furthest_y', 'peak_force')
    """
    names: set[str] = set()
    for quantity in quantities:
        if quantity.fields is None:
            return None
        names.update(quantity.fields)
    return tuple(sorted(names))


def measures(quantities: Iterable[Quantity]) -> tuple[Measure, ...]:
    """The own measures of some quantities, each once, for `fencejax.simulate(measures=...)`.

    Raises `ValueError` where two different measures have the same name.

    >>> damage = fj.shock.damage_boundary(60.0, 2.0)
    >>> [measure.name for measure in fj.objectives.measures([damage])]
    ['pulse_impulse']
    """
    found: dict[str, Measure] = {}
    for quantity in quantities:
        for measure in quantity.measures:
            if found.setdefault(measure.name, measure) != measure:
                raise ValueError(
                    "Argument `quantities` must read measures of different names, but two that "
                    f"are not the same are named {measure.name!r}. Name one of them otherwise."
                )
    return tuple(found.values())


@dataclasses.dataclass(frozen=True)
class Limit:
    """A bound on a quantity: at most, or at least.

    margin = (bound - quantity) / scale (at most) or (quantity - bound) / scale (at least); the
    limit holds where the margin is 0 or more.

    **Fields:**

    - `quantity`: the limited quantity.
    - `bound` [the quantity's unit].
    - `sense`: `"at most"` or `"at least"`.
    - `scale` [the quantity's unit], above 0: the unit of the margin; by default the
      bound's magnitude.

    Raises `ValueError` where the bound is 0 and no scale is given.

    >>> limit = fj.Limit(fj.objectives.PEAK_FORCE, 1200.0)
    >>> limit, limit.margin_of(900.0)
    (peak_force at most 1200 N, 0.25)
    """

    quantity: Quantity
    bound: float
    sense: str = "at most"
    scale: float | None = None

    def __post_init__(self):
        name, unit = self.quantity.name, self.quantity.unit
        _check.choice("sense", self.sense, ("at most", "at least"))
        _check.number(f"{name} bound", self.bound, unit=unit)
        _check.number(
            f"{name} scale",
            self.unit_of_margin,
            above=0,
            unit=unit,
            remedy="Give `scale`, what the margin is to be measured in.",
        )

    def __repr__(self) -> str:
        return f"{self.name} {self.sense} {shown(self.bound, self.quantity.unit)}"

    @property
    def name(self) -> str:
        """The name of the limited quantity."""
        return self.quantity.name

    @property
    def unit_of_margin(self) -> float:
        """The unit of the margin [the quantity's unit]."""
        return abs(self.bound) if self.scale is None else self.scale

    def margin_of(self, value: Any) -> Any:
        """The margin [1] at a value of the quantity."""
        left = self.bound - value if self.sense == "at most" else value - self.bound
        return left / self.unit_of_margin

    def margin(self, result: Result, scene: AnyScene) -> Array:
        """The margin [1]; 0 or more where the limit holds."""
        return self.margin_of(self.quantity(result, scene))


def tip_deflection_limit(bound: float = 0.08) -> Limit:
    """The tip deflects by at most `bound` [m]: the paper's fence near the tip.

    >>> fj.objectives.tip_deflection_limit(0.1)
    tip_deflection at most 100 mm
    """
    return Limit(TIP_DEFLECTION, bound)


def stress_limit(bound: float = 40e6) -> Limit:
    """The bending stress is at most `bound` [Pa].

    The default is for polyamide PA6: it yields at about 80 MPa dry and 45 MPa conditioned in
    humid air (data sheets), so 40 MPa keeps half of the dry strength in reserve for repeated
    blows and stays below yield in either state.

    >>> fj.objectives.stress_limit(30e6)
    peak_stress at most 30 MPa
    """
    return Limit(PEAK_STRESS, bound)


def diverted_limit(bound: float = 0.0, scale: float = 0.7) -> Limit:
    """The parcel is diverted: within the scene C_s gets at least `bound` [m] past the belt's far
    edge, max over t of y_C - s >= `bound`.

    Beyond that edge the parcel's weight rests on the chute. The margin is in belt widths
    (`scale` [m]).

    >>> fj.objectives.diverted_limit()
    crossing at least 0 m
    """
    return Limit(CROSSING, bound, "at least", scale)


def tip_clearance_limit(bound: float = 0.02) -> Limit:
    """The contact stays on the fence: a corner that presses with more than 1 N stays at least
    `bound` [m] short of the tip.

    The differentiable form of `Status.LEFT_OVER_TIP`. It holds for a single blow; over a whole
    sort the parcel leaves over the tip by design, once it is diverted. Past the tip the load
    fades, so that the clearance saturates at a little below 0: start from a design that holds it.

    >>> fj.objectives.tip_clearance_limit(0.03)
    tip_clearance at least 30 mm
    """
    return Limit(TIP_CLEARANCE, bound, "at least")


LIMITS: Mapping[str, Limit] = {
    limit.name: limit
    for limit in (tip_deflection_limit(), stress_limit(), diverted_limit(), tip_clearance_limit())
}
"""The default limits by the names of their quantities."""
