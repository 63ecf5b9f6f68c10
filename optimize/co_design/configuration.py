"""The numbers of the design of fence and motion together, and a flag for each."""

import argparse
import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import fencejax as fj
from fencejax.design import Limit, objectives

from ..common import designs, flags


@dataclasses.dataclass(frozen=True)
class CoDesignConfig:
    """Every number of the job; `python -m optimize.co_design --help` says what each is."""

    out: Path = Path("out")
    masses: tuple[float, ...] = (5.0, 20.0)
    offsets: tuple[float, ...] = (0.05, 0.20)
    front: float = 0.1
    period: float = 1.5
    controls: int = 8
    variables: tuple[str, ...] = (
        "thickness", "length_ratio", "youngs_modulus", "control_angles", "cycle_time",
    )  # fmt: skip
    bounds: tuple[tuple[str, float, float], ...] = ()
    tip_limit: float = 0.08
    stress_limit: float = 40e6
    crossing: float = 0.0
    speed_limit: float = 3.0
    acceleration_limit: float = 20.0
    jerk_limit: float = 300.0
    torque_limit: float = 1000.0
    ring_limit: float = 0.002
    reserve: float = 0.01
    tolerance: float = 2e-3
    feasibility: float = 1e-4
    budget: int = 100
    fidelity: str = "standard"
    verify: str = "reference"
    agreement: float = 0.02
    plots: bool = True

    def __post_init__(self):
        flags.one_of("fidelity", self.fidelity, flags.FIDELITIES)
        flags.one_of("verify", self.verify, flags.FIDELITIES)
        flags.at_least(self, controls=3, budget=1)
        for name in (
            "period", "speed_limit", "acceleration_limit", "jerk_limit", "torque_limit",
            "ring_limit", "tip_limit", "stress_limit",
        ):  # fmt: skip
            if not getattr(self, name) > 0:
                raise ValueError(
                    f"Argument `{name}` must be above 0, but is {getattr(self, name):g}."
                )

    @property
    def limits(self) -> tuple[Limit, ...]:
        """What every sort must hold, apart from the ring-down."""
        return (
            objectives.tip_deflection_limit(self.tip_limit),
            objectives.stress_limit(self.stress_limit),
            objectives.diverted_limit(self.crossing),
            Limit(objectives.PEAK_TORQUE, self.torque_limit),
        )

    @property
    def space(self) -> fj.DesignSpace:
        """The variables over the paper's fence and a spline as near as can be to its drive."""
        cycle = min(fj.HarmonicDrive().cycle_time.item(), 0.95 * self.period)
        paper = fj.HarmonicDrive(cycle_time=cycle)
        units = np.eye(self.controls)
        time = np.linspace(0, cycle, 400)
        columns = [np.asarray(fj.SplineDrive(row, cycle).angle(time)) for row in units]
        angles, *_ = np.linalg.lstsq(
            np.stack(columns, axis=1), np.asarray(paper.angle(time)), rcond=None
        )
        drive = fj.SplineDrive(np.maximum(angles, 0.0), cycle)
        # No angle below 0: the fence does not go through the border.
        spans = (("control_angles", -1e-3, 1.2), ("cycle_time", 0.6 * self.period, self.period))
        return designs.space(self.variables, self.bounds, drive=drive, default=spans)

    def quick(self) -> "CoDesignConfig":
        """A small version: two sorts, few control angles, the fast fidelity throughout."""
        return dataclasses.replace(
            self, masses=(15.0,), offsets=(0.05, 0.2), controls=5, budget=40, fidelity="fast",
            verify="standard",
        )  # fmt: skip


_HELP = {
    "out": "folder for co_design.json, evaluations.jsonl and the figures; a job that was "
    "interrupted goes on from there",
    "masses": "parcel masses [kg]",
    "offsets": "Delta s, from the border to the parcel [m]",
    "front": "where the parcel's front is when the drive starts [m]",
    "period": "from one sort to the next [s]; the drive moves within it and the fence rings down",
    "controls": "control angles of the motion",
    "variables": "what is designed; control_angles stands for all of them",
    "bounds": "bounds in SI units instead of the default ones, as name=lower:upper",
    "tip_limit": "largest tip deflection [m]",
    "stress_limit": "largest bending stress [Pa]",
    "crossing": "how far the parcel's centre must get past the belt's edge [m]",
    "speed_limit": "largest speed of the drive [rad/s]",
    "acceleration_limit": "largest acceleration of the drive [rad/s^2]",
    "jerk_limit": "largest jerk of the drive [rad/s^3]",
    "torque_limit": "largest torque of the drive, parcel included [N m]",
    "ring_limit": "largest amplitude of the tip at the period's end, all that the fence then "
    "holds taken for its first mode [m]",
    "reserve": "kept in hand of every sort's margin [1], for the difference to a finer fidelity",
    "tolerance": "on stationarity and complementarity [1]",
    "feasibility": "violation of a margin that counts as none [1]",
    "budget": "evaluations at most",
    "fidelity": "fidelity of the optimisation",
    "verify": "fidelity at which both designs are looked at again",
    "agreement": "largest relative error of the force that confirms the optimum [1]",
    "plots": "draw the figures",
}
_SPECIAL = {
    "fidelity": dict(choices=flags.FIDELITIES),
    "verify": dict(choices=flags.FIDELITIES),
    "bounds": designs.BOUNDS_FLAG,
}


def parser() -> argparse.ArgumentParser:
    """One flag for each field of the configuration, and --quick."""
    return flags.parser(
        CoDesignConfig,
        "optimize.co_design",
        "Fence, material and the drive's free-form motion designed together: the least worst peak "
        "force of whole sorts, with limits on fence, sort, drive and ring-down.",
        _HELP,
        _SPECIAL,
        "two sorts and five control angles at the fast fidelity, whatever the flags for them say",
    )


def configure(arguments: Sequence[str] | None = None) -> CoDesignConfig:
    """The configuration that flags describe.

    Raises `ValueError` where a number is out of range.
    """
    return flags.configured(parser(), CoDesignConfig, arguments)
