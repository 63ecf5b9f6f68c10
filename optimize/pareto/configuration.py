"""The numbers of the front, and a flag for each."""

import argparse
import dataclasses
from collections.abc import Sequence
from pathlib import Path

import fencejax as fj
from fencejax.design import Limit, Quantity, objectives

from ..common import designs, flags
from ..common.encounters import KINDS

AGAINST = {
    "tip_deflection": objectives.TIP_DEFLECTION,
    "cycle_time": objectives.CYCLE_TIME,
    "fence_mass": objectives.FENCE_MASS,
    "drive_torque": objectives.PEAK_TORQUE,
}
"""What the peak force is weighed against; of each, less is better."""

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

    out: Path = Path("out")
    against: str = "tip_deflection"
    scenes: str = "auto"
    masses: tuple[float, ...] = (5.0, 10.0, 20.0)
    distances: tuple[float, ...] = (0.85, 1.0)
    drive_angle: float = 0.30
    offsets: tuple[float, ...] = (0.05, 0.20)
    front: float = 0.1
    duration: float = 0.0
    variables: tuple[str, ...] = ()
    bounds: tuple[tuple[str, float, float], ...] = ()
    tip_limit: float = 0.10
    stress_limit: float = 40e6
    tip_clearance: float = 0.02
    crossing: float = 0.0
    reserve: float = 0.005
    points: int = 12
    starts: int = 4
    together: bool = False
    width: int = 4
    tolerance: float = 2e-3
    feasibility: float = 1e-4
    budget: int = 80
    fidelity: str = "standard"
    verify: str = "reference"
    agreement: float = 0.02
    plots: bool = True

    def __post_init__(self):
        flags.one_of("against", self.against, tuple(AGAINST))
        flags.one_of("scenes", self.scenes, ("auto", *KINDS))
        flags.one_of("fidelity", self.fidelity, flags.FIDELITIES)
        flags.one_of("verify", self.verify, ("none", *flags.FIDELITIES))
        flags.at_least(self, points=3, starts=1, width=1, budget=1)
        if self.duration < 0:
            raise ValueError(f"Argument `duration` must be at least 0 [s], but is {self.duration}.")

    @property
    def kind(self) -> str:
        """What a parcel goes through: drive and throughput are seen in whole sorts only."""
        if self.scenes != "auto":
            return self.scenes
        return "sorts" if self.against in ("cycle_time", "drive_torque") else "impacts"

    @property
    def length(self) -> float:
        """Duration of each scene [s]."""
        return self.duration or _DURATIONS[self.kind]

    @property
    def designed(self) -> tuple[str, ...]:
        """The variables."""
        return self.variables or _VARIABLES[self.against]

    @property
    def space(self) -> fj.DesignSpace:
        """The variables with their bounds."""
        drive = fj.HarmonicDrive()
        return designs.space(self.designed, self.bounds, drive=drive, default=_BOUNDS)

    @property
    def quantity(self) -> Quantity:
        """What the peak force is weighed against."""
        return AGAINST[self.against]

    @property
    def limits(self) -> tuple[Limit, ...]:
        """What every parcel must hold, all along the front."""
        limits = (
            objectives.tip_deflection_limit(self.tip_limit),
            objectives.stress_limit(self.stress_limit),
            objectives.diverted_limit(self.crossing),
        )
        if self.kind == "sorts":
            return limits
        return (*limits, objectives.tip_clearance_limit(self.tip_clearance))

    def quick(self) -> "ParetoConfig":
        """A small version: few parcels and points, the fast fidelity throughout."""
        return dataclasses.replace(
            self, masses=(15.0,), distances=(0.9, 1.0), offsets=(0.05, 0.2), points=4, starts=1,
            fidelity="fast", verify="standard", budget=40,
        )  # fmt: skip


_HELP = {
    "out": "folder for front.json, evaluations.jsonl and the figures; a job that was interrupted "
    "goes on from there",
    "against": "what the peak force is weighed against",
    "scenes": "impacts, sorts, or auto: sorts for cycle_time and drive_torque",
    "masses": "parcel masses [kg]",
    "distances": "of impacts: arc coordinates of the first touch [m]",
    "drive_angle": "of impacts: drive angle at the first touch [rad]",
    "offsets": "of sorts: Delta s, from the border to the parcel [m]",
    "front": "of sorts: where the parcel's front is when the drive starts [m]",
    "duration": "length of each scene [s]; 0: 0.2 s (impacts), 1.5 s (sorts)",
    "variables": "what is designed; by default what bears on the two quantities",
    "bounds": "bounds in SI units instead of the default ones, as name=lower:upper",
    "tip_limit": "largest tip deflection [m]",
    "stress_limit": "largest bending stress [Pa]",
    "tip_clearance": "of impacts: shortest distance from a loaded corner to the tip [m]",
    "crossing": "how far the parcel's centre must get past the belt's edge [m]",
    "reserve": "kept in hand of every margin [1], for the difference to a finer fidelity",
    "points": "points on the front",
    "starts": "starts of the search for the front's first end",
    "together": "solve all points side by side instead of one after the other, each from its "
    "neighbour",
    "width": "runs side by side, where there are several",
    "tolerance": "on stationarity and complementarity [1]",
    "feasibility": "violation of a margin that counts as none [1]",
    "budget": "evaluations for each point at most",
    "fidelity": "fidelity of the optimisation",
    "verify": "fidelity at which every point is looked at again, or none",
    "agreement": "largest relative error of the force that confirms a point [1]",
    "plots": "draw the figures",
}
_SPECIAL = {
    "against": dict(choices=tuple(AGAINST)),
    "scenes": dict(choices=("auto", *KINDS)),
    "fidelity": dict(choices=flags.FIDELITIES),
    "verify": dict(choices=("none", *flags.FIDELITIES)),
    "bounds": designs.BOUNDS_FLAG,
    "variables": dict(type=str, nargs="*"),
}


def parser() -> argparse.ArgumentParser:
    """One flag for each field of the configuration, and --quick."""
    return flags.parser(
        ParetoConfig,
        "optimize.pareto",
        "The front of the worst peak force against tip deflection, cycle time, mass of the fence "
        "or torque of the drive, with the design of every point.",
        _HELP,
        _SPECIAL,
        "few parcels and points at the fast fidelity, whatever the flags for them say",
    )


def configure(arguments: Sequence[str] | None = None) -> ParetoConfig:
    """The configuration that flags describe.

    Raises `ValueError` where a number is out of range.
    """
    return flags.configured(parser(), ParetoConfig, arguments)
