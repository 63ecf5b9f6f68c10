"""The numbers of the front, and a flag for each."""

import dataclasses
from pathlib import Path

import fencejax as fj
from fencejax.design import Limit, Quantity, objectives

from ..common import flags, machine, named
from ..common.encounters import KINDS

AGAINST = {
    "tip_deflection": objectives.TIP_DEFLECTION,
    "cycle_time": objectives.CYCLE_TIME,
    "fence_mass": objectives.FENCE_MASS,
    "drive_torque": objectives.PEAK_TORQUE,
}
"""Quantities that are traded off against the peak force; each is better if smaller."""

_FENCE = ("thickness", "length_ratio", "youngs_modulus")
_VARIABLES = {
    "tip_deflection": _FENCE,
    "cycle_time": (*_FENCE, "top_speed", "cycle_time"),
    "fence_mass": (*_FENCE, "width"),
    "drive_torque": (*_FENCE, "top_speed", "cycle_time"),
}
_DURATIONS = {"impacts": 0.20, "sorts": 1.5}
# The drive is home again when a sort ends.
_BOUNDS = (("top_speed", 0.8, 4.0), ("cycle_time", 0.5, _DURATIONS["sorts"]))


@dataclasses.dataclass(frozen=True)
class ParetoConfig:
    """Every number of the job; `python -m optimize.pareto --help` says what each is."""

    not_in_key = frozenset({
        "out", "points", "starts", "together", "width", "tolerance", "budget", "feasibility",
        "verify", "agreement", "plots",
    })  # fmt: skip
    """Fields that do not affect the numbers of an evaluation; a journal is valid for any of
    them."""

    out: Path = flags.field(
        Path("out"),
        "folder for front.json, report.html, fence.dxf, evaluations.jsonl and the figures; an "
        "interrupted job resumes from there",
    )
    against: str = flags.field(
        "tip_deflection",
        f"what the peak force is weighed against: {', '.join(AGAINST)}, {named.OWN} of a Quantity",
        metavar="QUANTITY",
    )
    sorter: str = machine.sorter_field()
    set: tuple[str, ...] = machine.set_field()
    free: tuple[str, ...] = machine.free_field()
    scenes: str = flags.field(
        "auto",
        "impacts, sorts, or auto: sorts for cycle_time and drive_torque",
        choices=("auto", *KINDS),
    )
    masses: tuple[float, ...] = flags.field((5.0, 10.0, 20.0), "parcel masses [kg]", above=0)
    distances: tuple[float, ...] = flags.field(
        (0.85, 1.0), "of impacts: arc coordinates of the first contact [m]", least=0
    )
    drive_angle: float = flags.field(0.30, "of impacts: drive angle at the first contact [rad]")
    offsets: tuple[float, ...] = flags.field(
        (0.05, 0.20), "of sorts: Delta s, from the border to the parcel [m]", least=0
    )
    front: float = flags.field(
        0.1, "of sorts: place of the parcel's front when the drive starts [m]"
    )
    duration: float = flags.field(
        0.0, "length of each scene [s]; 0: 0.2 s (impacts), 1.5 s (sorts)", least=0
    )
    drive: str = named.drive_field()
    taper: str = named.taper_field()
    variables: tuple[str, ...] = flags.field(
        (), "variables of the design; by default those that affect the two quantities", type=str,
        nargs="*"
    )
    tip_limit: float = flags.field(0.10, "largest tip deflection [m]", above=0)
    stress_limit: float = flags.field(40e6, "largest bending stress [Pa]", above=0)
    tip_clearance: float = flags.field(
        0.02, "of impacts: shortest distance from a loaded corner to the tip [m]", above=0
    )
    crossing: float = flags.field(
        0.0, "how far the parcel's centre must get past the belt's edge [m]"
    )
    limit: tuple[str, ...] = named.limit_field()
    reserve: float = flags.field(
        0.005, "reserve in every margin [1], for the difference from a finer fidelity", least=0
    )
    points: int = flags.field(12, "points on the front", least=3)
    starts: int = flags.field(4, "starts of the search for the front's first end", least=1)
    together: bool = flags.field(
        False,
        "solve all points side by side instead of one after the other, each from its neighbour",
    )
    width: int = flags.field(4, "runs side by side, where there are several", least=1)
    tolerance: float = flags.field(2e-3, "on stationarity and complementarity [1]", above=0)
    feasibility: float = flags.field(1e-4, "violation of a margin that counts as none [1]", above=0)
    budget: int = flags.field(80, "evaluations for each point at most", least=1)
    fidelity: str = flags.field(
        "standard", "fidelity of the optimisation", choices=flags.FIDELITIES
    )
    verify: str = flags.field(
        "reference",
        "fidelity at which every point is measured again, or none",
        choices=("none", *flags.FIDELITIES),
    )
    agreement: float = flags.field(
        0.02, "largest relative error of the force that confirms a point [1]", above=0
    )
    plots: bool = flags.field(True, "draw the figures")

    def __post_init__(self):
        flags.check(self)
        named.quantity("against", self.against, AGAINST)
        machine.only_without(
            self, "masses", "offsets", "front", "drive", "taper", "tip_limit", "stress_limit",
            "crossing",
        )  # fmt: skip

    @property
    def machine(self) -> fj.sorter.Machine | None:
        """The sorter that is named, if any."""
        return machine.chosen(self)

    @property
    def kind(self) -> str:
        """The kind of encounters: quantities of drive and throughput need whole sorts."""
        if self.scenes != "auto":
            return self.scenes
        if self.machine is not None:
            return "sorts"
        return "sorts" if self.against in ("cycle_time", "drive_torque") else "impacts"

    @property
    def length(self) -> float:
        """Duration of each scene [s]."""
        given = None if self.machine is None or self.kind != "sorts" else self.machine.duration
        return self.duration or given or _DURATIONS[self.kind]

    @property
    def designed(self) -> tuple[str, ...]:
        """The variables."""
        return self.variables or _VARIABLES.get(self.against, _FENCE)

    @property
    def space(self) -> fj.DesignSpace:
        """The variables with their bounds."""
        designed = dataclasses.replace(self, variables=self.designed)
        return machine.space(designed, self.machine, default=_BOUNDS)

    @property
    def quantity(self) -> Quantity:
        """The quantity traded off against the peak force."""
        return named.quantity("against", self.against, AGAINST)

    @property
    def limits(self) -> tuple[Limit, ...]:
        """The limits for every parcel, along the whole front."""
        limits = (
            objectives.tip_deflection_limit(self.tip_limit),
            objectives.stress_limit(self.stress_limit),
            objectives.diverted_limit(self.crossing),
        )
        if self.kind == "impacts":
            limits = (*limits, objectives.tip_clearance_limit(self.tip_clearance))
        found = machine.limits(limits, self.machine, sorts=self.kind == "sorts")
        return named.limits(found, self.limit)

    @property
    def notes(self) -> list[str]:
        """What the job uses of the sorter that is named, and what it leaves out, a line each."""
        sorter = self.machine
        if sorter is None:
            return []
        unheld = machine.unheld_notes(sorter) if self.kind == "impacts" else []
        return [*machine.notes(sorter), *unheld]

    def quick(self) -> "ParetoConfig":
        """A small version: few points and parcels, or those of the sorter file, the fast fidelity
        throughout."""
        own = {} if self.sorter != machine.NONE else dict(masses=(15.0,), offsets=(0.05, 0.2))
        return dataclasses.replace(
            self, distances=(0.9, 1.0), points=4, starts=1, fidelity="fast", verify="standard",
            budget=40, **own,
        )  # fmt: skip


configure = flags.reader(
    ParetoConfig,
    "optimize.pareto",
    "The front of the worst peak force against tip deflection, cycle time, mass of the fence "
    "or torque of the drive, with the design of every point.",
    quick="few parcels and points at the fast fidelity, where no flag for them says otherwise",
)
