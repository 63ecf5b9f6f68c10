"""The numbers of the main job, and a flag for each."""

import dataclasses
from pathlib import Path

import fencejax as fj
from fencejax.design import VARIABLES, objectives

from ..common import flags, machine, named


@dataclasses.dataclass(frozen=True)
class PeakForceConfig:
    """Every number of the job; `python -m optimize.peak_force --help` says what each is."""

    out: Path = flags.field(
        Path("out"), "folder for history.json, result.json, report.html, fence.dxf and the figures"
    )
    sorter: str = machine.sorter_field()
    set: tuple[str, ...] = machine.set_field()
    free: tuple[str, ...] = machine.free_field()
    distances: tuple[float, ...] = flags.field(
        (0.8, 0.9, 1.0), "arc coordinates of the first contact [m]", least=0
    )
    masses: tuple[float, ...] = flags.field((10.0, 15.0, 20.0), "parcel masses [kg]", above=0)
    drive_angle: float = flags.field(0.30, "drive angle at the first contact [rad]")
    duration: float = flags.field(
        0.25, "length of each impact [s]; the parcel must be diverted within it", above=0
    )
    drive: str = named.drive_field()
    taper: str = named.taper_field()
    variables: tuple[str, ...] = flags.field(
        ("thickness", "length_ratio", "youngs_modulus"),
        f"what is designed, of {', '.join(VARIABLES)}",
    )
    objective: str = named.objective_field()
    tip_limit: float = flags.field(0.08, "largest tip deflection [m]", above=0)
    stress_limit: float = flags.field(
        40e6,
        "largest bending stress [Pa]; 40 MPa stays below the yield of PA6, dry or not",
        above=0,
    )
    tip_clearance: float = flags.field(
        0.02, "shortest distance from a loaded corner to the tip [m]", above=0
    )
    crossing: float = flags.field(
        0.0, "how far the parcel's centre must get past the belt's edge [m]"
    )
    limit: tuple[str, ...] = named.limit_field()
    reserve: float = flags.field(
        0.005,
        "reserve in every margin [1], for the difference from the reference fidelity",
        least=0,
    )
    method: str = flags.field(
        "sqp",
        "sequential quadratic programming (sqp), or optax' Adam on an augmented Lagrangian (adam)",
        choices=("sqp", "adam"),
    )
    tolerance: float = flags.field(1e-3, "on stationarity and complementarity [1]", above=0)
    feasibility: float = flags.field(1e-4, "violation of a margin that counts as none [1]", above=0)
    penalty: float = flags.field(10.0, "penalty on violations at the start [1]", above=0)
    budget: int = flags.field(120, "evaluations at most", least=1)
    fidelity: str = flags.field(
        "standard",
        "fidelity of the optimisation",
        choices=flags.FIDELITIES,
    )
    reference: bool = flags.field(
        True, "run the paper's fences and the optimum at the reference fidelity"
    )
    agreement: float = flags.field(
        0.01,
        "largest relative difference of the force at the reference that confirms it [1]",
        above=0,
    )
    sort_masses: tuple[float, ...] = flags.field(
        (10.0, 15.0, 20.0),
        "parcel masses of the whole sorts run as a check [kg]; none: no check",
        nargs="*",
        above=0,
    )
    sort_front: float = flags.field(0.1, "place of the parcel's front when such a sort starts [m]")
    plots: bool = flags.field(True, "draw the figures")

    def __post_init__(self):
        flags.check(self)
        machine.only_without(self, "drive", "taper", "tip_limit", "stress_limit", "crossing")

    @property
    def machine(self) -> fj.sorter.Machine | None:
        """The sorter that is named, if any."""
        return machine.chosen(self)

    @property
    def belt(self) -> fj.Belt:
        """The belt of all impacts."""
        return fj.Belt() if self.machine is None else self.machine.belt

    @property
    def one_link(self) -> fj.Fence:
        """The paper's one-link fence, or the machine's fence without its rigid link."""
        if self.machine is None:
            return fj.Fence.one_link(taper=named.taper(self.taper))
        fence = self.machine.fence
        return fj.Fence(
            0.0, fence.reach, fence.width, fence.thickness, fence.material, fence.taper
        )

    @property
    def limits(self) -> tuple[objectives.Limit, ...]:
        """The limits for every impact."""
        limits = (
            objectives.tip_deflection_limit(self.tip_limit),
            objectives.stress_limit(self.stress_limit),
            objectives.diverted_limit(self.crossing),
            objectives.tip_clearance_limit(self.tip_clearance),
        )
        return named.limits(machine.limits(limits, self.machine, sorts=False), self.limit)

    @property
    def notes(self) -> list[str]:
        """What the job uses of the sorter that is named, and what it leaves out, a line each."""
        sorter = self.machine
        if sorter is None:
            return []
        count, wanted = sorter.parcels.count, sorter.objective
        which = f"first of the sorter's {count}" if count > 1 else "sorter's"
        lines = [
            *machine.notes(sorter),
            f"the parcel is the {which}, with the masses of --masses (of --sort-masses in whole "
            f"sorts), met at --distances{'; no other parcel is used' if count > 1 else ''}",
        ]
        if (wanted.over, wanted.quantity.name) != ("worst", self.quantity.name):
            lines.append(
                f"the objective is the worst {self.quantity.name} over the impacts, by "
                f"--objective, and not the sorter's own, the {wanted.over} {wanted.quantity.name} "
                "over its parcels, which python -m optimize.design takes"
            )
        return [*lines, *machine.unheld_notes(sorter)]

    @property
    def quantity(self) -> fj.Quantity:
        """The objective."""
        return named.quantity("objective", self.objective)

    @property
    def space(self) -> fj.DesignSpace:
        """The variables with their bounds."""
        return machine.space(self, self.machine)

    def worst_case(self) -> "PeakForceConfig":
        """The paper's worst case alone: its parcel of 15 kg, met near the tip."""
        return dataclasses.replace(self, distances=(1.08,), masses=(15.0,), sort_masses=(15.0,))

    def quick(self) -> "PeakForceConfig":
        """A small version: few evaluations at the coarse fidelity, and nothing checked after."""
        return dataclasses.replace(
            self, budget=12, fidelity="coarse", reference=False, sort_masses=()
        )


configure = flags.reader(
    PeakForceConfig,
    "optimize.peak_force",
    "The fence with the smallest peak force over the worst of several impacts, "
    "from the paper's two-link fence, under limits.",
    worst_case="the paper's worst case alone, 15 kg met near the tip, at R = 1.08 m, where no flag "
    "for distances and masses says otherwise",
    quick="few evaluations at the coarse fidelity and no checks after, where no flag for them says "
    "otherwise",
)
