"""The numbers of the design of fence and motion together, and a flag for each."""

import dataclasses
from pathlib import Path

import jax.numpy as jnp
import numpy as np

import fencejax as fj
from fencejax.design import Limit, objectives

from ..common import flags, machine, named


@dataclasses.dataclass(frozen=True)
class CoDesignConfig:
    """Every number of the job; `python -m optimize.co_design --help` says what each is."""

    not_in_key = frozenset({
        "out", "tolerance", "feasibility", "budget", "starts", "scouting", "verify", "agreement",
        "plots",
    })  # fmt: skip
    """Fields that do not affect the numbers of an evaluation; a journal is valid for any of
    them."""
    designs_drive = True
    """The job designs its own motion, independent of free numbers of the sorter file's drive."""

    out: Path = flags.field(
        Path("out"),
        "folder for co_design.json, report.html, fence.dxf, evaluations.jsonl and the figures; an "
        "interrupted job resumes from there",
    )
    sorter: str = machine.sorter_field()
    set: tuple[str, ...] = machine.set_field()
    free: tuple[str, ...] = machine.free_field()
    masses: tuple[float, ...] = flags.field((5.0, 20.0), "parcel masses [kg]", above=0)
    offsets: tuple[float, ...] = flags.field(
        (0.05, 0.20), "Delta s, from the border to the parcel [m]", least=0
    )
    front: float = flags.field(0.1, "place of the parcel's front when the drive starts [m]")
    period: float = flags.field(
        1.5,
        "time from one sort to the next [s], for the drive's motion and the fence's ring-down",
        above=0,
    )
    controls: int = flags.field(8, "control angles of the motion", least=3)
    taper: str = named.taper_field()
    variables: tuple[str, ...] = flags.field(
        ("thickness", "length_ratio", "youngs_modulus", "control_angles", "cycle_time"),
        "what is designed; control_angles stands for all of them",
    )
    tip_limit: float = flags.field(0.08, "largest tip deflection [m]", above=0)
    stress_limit: float = flags.field(40e6, "largest bending stress [Pa]", above=0)
    crossing: float = flags.field(
        0.0, "how far the parcel's centre must get past the belt's edge [m]"
    )
    speed_limit: float = flags.field(3.0, "largest speed of the drive [rad/s]", above=0)
    acceleration_limit: float = flags.field(
        20.0, "largest acceleration of the drive [rad/s^2]", above=0
    )
    jerk_limit: float = flags.field(300.0, "largest jerk of the drive [rad/s^3]", above=0)
    torque_limit: float = flags.field(
        1000.0, "largest torque of the drive, parcel included [N m]", above=0
    )
    ring_limit: float = flags.field(
        0.002,
        "largest amplitude of the tip at the period's end, if all of the fence's energy "
        "were in its first mode [m]",
        above=0,
    )
    limit: tuple[str, ...] = named.limit_field()
    reserve: float = flags.field(
        0.01,
        "reserve in every sort's margin [1], for the difference from a finer fidelity",
        least=0,
    )
    tolerance: float = flags.field(2e-3, "on stationarity and complementarity [1]", above=0)
    feasibility: float = flags.field(1e-4, "violation of a margin that counts as none [1]", above=0)
    budget: int = flags.field(200, "evaluations at most", least=1)
    starts: int = flags.field(
        6,
        "first searches: from the given fence, and from others with the same drive, as each may "
        "end in another optimum; the most promising one continues",
        least=1,
    )
    scouting: int = flags.field(
        30, "evaluations of each first search, where there are several", least=2
    )
    fidelity: str = flags.field(
        "standard", "fidelity of the optimisation", choices=flags.FIDELITIES
    )
    verify: str = flags.field(
        "reference", "fidelity at which both designs are measured again", choices=flags.FIDELITIES
    )
    agreement: float = flags.field(
        0.02, "largest relative error of the force that confirms the optimum [1]", above=0
    )
    plots: bool = flags.field(True, "draw the figures")

    def __post_init__(self):
        flags.check(self)
        machine.only_without(
            self, "masses", "offsets", "front", "taper", "tip_limit", "stress_limit", "crossing",
            "torque_limit",
        )  # fmt: skip

    @property
    def machine(self) -> fj.sorter.Machine | None:
        """The sorter that is named, if any."""
        return machine.chosen(self)

    @property
    def seconds(self) -> float:
        """From one sort to the next [s]: the sorter's own, if given."""
        given = None if self.machine is None else self.machine.period
        return self.period if given is None else given

    @property
    def ring_bound(self) -> float:
        """Largest amplitude at the period's end [m]: the sorter's own, if given."""
        bounds = {} if self.machine is None else {r.name: b for r, b in self.machine.bounds}
        return bounds.get("ring") or self.ring_limit

    @property
    def limits(self) -> tuple[Limit, ...]:
        """The limits for every sort, apart from the ring-down."""
        limits = (
            objectives.tip_deflection_limit(self.tip_limit),
            objectives.stress_limit(self.stress_limit),
            objectives.diverted_limit(self.crossing),
            Limit(objectives.PEAK_TORQUE, self.torque_limit),
        )
        limits = machine.limits(limits, self.machine, ("ring", "cycle"))
        return named.limits(limits, self.limit)

    @property
    def space(self) -> fj.DesignSpace:
        """The variables over the fence and the spline nearest to its drive."""
        own = fj.HarmonicDrive() if self.machine is None else self.machine.drive
        cycle = min(float(own.cycle), 0.95 * self.seconds)
        paper = own if self.machine is not None else fj.HarmonicDrive(cycle_time=cycle)
        units = np.eye(self.controls)
        time = np.linspace(0, cycle, 400)
        columns = [np.asarray(fj.SplineDrive(row, cycle).angle(jnp.asarray(time))) for row in units]
        angles, *_ = np.linalg.lstsq(
            np.stack(columns, axis=1), np.asarray(paper.angle(jnp.asarray(time))), rcond=None
        )
        drive = fj.SplineDrive(np.maximum(angles, 0.0), cycle)
        # No angle below 0: the fence does not go through the border.
        spans = (("control_angles", -1e-3, 1.2), ("cycle_time", 0.6 * self.seconds, self.seconds))
        return machine.space(self, self.machine, drive, spans)

    def quick(self) -> "CoDesignConfig":
        """A small version: two sorts, or those of the sorter file, few control angles, the fast
        fidelity throughout, from one start."""
        own = {} if self.sorter != machine.NONE else dict(masses=(15.0,), offsets=(0.05, 0.2))
        return dataclasses.replace(
            self, controls=5, budget=40, starts=1, fidelity="fast", verify="standard", **own
        )


configure = flags.reader(
    CoDesignConfig,
    "optimize.co_design",
    "Fence, material and the drive's free-form motion designed together: the least worst peak "
    "force of whole sorts, with limits on fence, sort, drive and ring-down.",
    quick="two sorts and five control angles at the fast fidelity, where no flag for them says "
    "otherwise",
)
