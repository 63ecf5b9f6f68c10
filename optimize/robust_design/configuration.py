"""The numbers of the robust design, and a flag for each."""

import dataclasses
from pathlib import Path
from typing import Any

import fencejax as fj
from fencejax.design import Limit, objectives, risk

from ..common import flags, machine, named
from ..common.encounters import KINDS

SEVERITIES = {"force": "N", "g_load": "1", "drop_height": "m"}
"""Measures of a blow with their units: peak force, F / (m g), equivalent drop height."""
METHODS = ("sample", "stochastic")
_DURATIONS = {"impacts": 0.20, "sorts": 1.4}
Span = tuple[float, float]
_SPAN: dict[str, Any] = {"nargs": 2, "metavar": ("FROM", "TO")}

LOGARITHMIC = ("mass", "stiffness")
"""Numbers drawn uniformly in the logarithm."""
LINEAR = (
    "length", "breadth", "offset", "angle", "front", "belt_friction", "fence_friction",
    "distance", "drive_angle",
)  # fmt: skip
"""Numbers drawn uniformly."""


@dataclasses.dataclass(frozen=True)
class RobustConfig:
    """Every number of the job; `python -m optimize.robust_design --help` says what each is."""

    not_in_key = frozenset({
        "out", "method", "sample", "batch", "steps", "rate", "tolerance", "feasibility", "budget",
        "fresh", "resamples", "confidence", "excluded_most", "chunk", "check_fidelity", "seed",
        "plots", *LOGARITHMIC, *LINEAR,
    })  # fmt: skip
    """Fields that do not affect the numbers of an evaluation; a journal is valid for any of them.
    The parcels are part of an evaluation's address."""

    out: Path = flags.field(
        Path("out"),
        "folder for robust.json, report.html, fence.dxf, evaluations.jsonl, fresh.npz and the "
        "figures; an interrupted job resumes from there",
    )
    sorter: str = machine.sorter_field()
    set: tuple[str, ...] = machine.set_field()
    free: tuple[str, ...] = machine.free_field()
    scenes: str = flags.field("sorts", "whole sorts, or single impacts", choices=KINDS)
    severity: str = flags.field(
        "force",
        "measure of a blow: peak force, g-load F / (m g), or the height of the equivalent drop "
        "on a corner",
        choices=tuple(SEVERITIES),
    )
    measure: str = flags.field(
        "cvar",
        "what is minimised over the parcels: mean, cvar (mean of the worst) or worst",
        choices=risk.MEASURES,
    )
    level: float = flags.field(
        0.95, "level of the CVaR: share of parcels that are not among the worst [1]", between=(0, 1)
    )
    fraction: float = flags.field(
        0.95, "share of parcels for which each limit must hold [1]", between=(0, 1)
    )
    tip_limit: float = flags.field(0.08, "largest tip deflection [m]", above=0)
    stress_limit: float = flags.field(40e6, "largest bending stress [Pa]", above=0)
    crossing: float = flags.field(
        0.0, "how far the parcel's centre must get past the belt's edge [m]"
    )
    limit: tuple[str, ...] = named.limit_field()
    mass: Span = flags.field(
        (0.2, 30.0), "span of the parcel mass [kg], uniform in its logarithm", above=0, **_SPAN
    )
    length: Span = flags.field(
        (0.20, 0.60), "span of the parcel's side along the belt [m]", above=0, **_SPAN
    )
    breadth: Span = flags.field(
        (0.15, 0.40), "span of the parcel's side across the belt [m]", above=0, **_SPAN
    )
    stiffness: Span = flags.field(
        (0.6e9, 5.0e9),
        "span of k_p [N/m^4], uniform in its logarithm; b_p is proportional to k_p^0.6, so "
        "that the restitution is constant",
        above=0,
        **_SPAN,
    )
    offset: Span = flags.field(
        (0.0, 0.25),
        "of sorts: span of Delta s, from the border to the parcel [m]",
        least=0,
        **_SPAN,
    )
    angle: Span = flags.field((-0.3, 0.3), "of sorts: span of the parcel's turn [rad]", **_SPAN)
    front: Span = flags.field(
        (0.0, 0.2),
        "of sorts: span of the parcel's front when the drive starts, its timing [m]",
        **_SPAN,
    )
    belt_friction: Span = flags.field(
        (0.5, 0.8), "span of the kinetic friction on the belt [1]", least=0, **_SPAN
    )
    fence_friction: Span = flags.field(
        (0.25, 0.45), "span of the kinetic friction on the fence [1]", least=0, **_SPAN
    )
    distance: Span = flags.field(
        (0.75, 1.05), "of impacts: span of the first contact's arc coordinate [m]", least=0, **_SPAN
    )
    drive_angle: Span = flags.field(
        (0.2, 0.4), "of impacts: span of the drive angle at the first contact [rad]", **_SPAN
    )
    drive: str = named.drive_field()
    taper: str = named.taper_field()
    variables: tuple[str, ...] = flags.field(
        ("thickness", "length_ratio", "youngs_modulus"), "what is designed"
    )
    method: str = flags.field(
        "sample",
        "sample: one sample throughout, by quadratic programming; stochastic: a fresh batch "
        "at every step, by optax' Adam",
        choices=METHODS,
    )
    sample: int = flags.field(512, "parcels of the sample", least=16)
    batch: int = flags.field(128, "parcels of a batch", least=16)
    steps: int = flags.field(60, "stochastic steps", least=2)
    rate: float = flags.field(
        0.03, "of the stochastic steps at the start, in shares of the ranges [1]", above=0
    )
    tolerance: float = flags.field(
        5e-3, "of the sample's problem, on stationarity and complementarity [1]", above=0
    )
    feasibility: float = flags.field(1e-3, "violation of a margin that counts as none [1]", above=0)
    budget: int = flags.field(40, "evaluations of the sample's problem at most", least=1)
    fresh: int = flags.field(
        2000, "parcels of the fresh sample, at which both designs are judged", least=50
    )
    resamples: int = flags.field(1000, "of the bootstrap", least=50)
    confidence: float = flags.field(0.95, "of the intervals [1]", between=(0, 1))
    excluded_most: float = flags.field(
        0.01, "largest share of fresh parcels without good numbers [1]", least=0
    )
    chunk: int = flags.field(64, "parcels in one vectorised call", least=1)
    duration: float = flags.field(
        0.0, "length of each scene [s]; 0: 0.2 s (impacts), 1.4 s (sorts)", least=0
    )
    fidelity: str = flags.field("fast", "fidelity of the optimisation", choices=flags.FIDELITIES)
    check_fidelity: str = flags.field(
        "standard", "fidelity of the fresh sample", choices=flags.FIDELITIES
    )
    seed: int = flags.field(0, "of all samples", least=0)
    plots: bool = flags.field(True, "draw the figures")

    def __post_init__(self):
        flags.check(self)
        machine.only_without(
            self, "mass", "length", "breadth", "stiffness", "offset", "angle", "front",
            "belt_friction", "fence_friction", "drive", "taper", "tip_limit", "stress_limit",
            "crossing",
        )  # fmt: skip
        if self.sorter != machine.NONE and self.scenes != "sorts":
            raise ValueError(
                "Argument `scenes` must be 'sorts' where a sorter file is given, but is "
                f"{self.scenes!r}."
            )
        for name in (*LOGARITHMIC, *LINEAR):
            low, high = getattr(self, name)
            if not low <= high:
                raise ValueError(
                    f"Argument `{name}` must be two numbers, the second at least the first, but is "
                    f"{low:g}, {high:g}."
                )

    @property
    def machine(self) -> fj.sorter.Machine | None:
        """The sorter that is named, if any."""
        return machine.chosen(self)

    @property
    def seconds(self) -> float:
        """Duration of each scene [s]."""
        given = None if self.machine is None else self.machine.duration
        return self.duration or given or _DURATIONS[self.scenes]

    @property
    def unit(self) -> str:
        """Unit of the severity."""
        return SEVERITIES[self.severity]

    @property
    def limits(self) -> tuple[Limit, ...]:
        """The limits for the stated fraction of parcels."""
        limits = (
            objectives.tip_deflection_limit(self.tip_limit),
            objectives.stress_limit(self.stress_limit),
            objectives.diverted_limit(self.crossing),
        )
        return named.limits(machine.limits(limits, self.machine), self.limit)

    @property
    def space(self) -> fj.DesignSpace:
        """The variables with their bounds."""
        return machine.space(self, self.machine)

    def quick(self) -> "RobustConfig":
        """A small version: few parcels, the fast fidelity throughout."""
        return dataclasses.replace(
            self, sample=96, batch=48, steps=12, budget=15, fresh=200, resamples=200,
            check_fidelity="fast",
        )  # fmt: skip


configure = flags.reader(
    RobustConfig,
    "optimize.robust_design",
    "The fence for parcels as they come: mean, CVaR or worst case of the blow over thousands "
    "of sorts, with limits that hold for a stated fraction of parcels. With --sorter the parcels "
    "are drawn from the distributions in its file, or by their weights from its list or CSV file.",
    quick="few parcels at the fast fidelity, where no flag for them says otherwise",
)
