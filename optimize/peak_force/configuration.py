"""The numbers of the main job, and a flag for each."""

import argparse
import dataclasses
from collections.abc import Sequence
from pathlib import Path

from fencejax.design import VARIABLES, objectives

from ..common import designs, flags


@dataclasses.dataclass(frozen=True)
class PeakForceConfig:
    """Every number of the job; `python -m optimize.peak_force --help` says what each is."""

    out: Path = Path("out")
    distances: tuple[float, ...] = (0.8, 0.9, 1.0)
    masses: tuple[float, ...] = (10.0, 15.0, 20.0)
    drive_angle: float = 0.30
    duration: float = 0.25
    variables: tuple[str, ...] = ("thickness", "length_ratio", "youngs_modulus")
    bounds: tuple[tuple[str, float, float], ...] = ()
    tip_limit: float = 0.08
    stress_limit: float = 40e6
    tip_clearance: float = 0.02
    crossing: float = 0.0
    reserve: float = 0.005
    method: str = "sqp"
    tolerance: float = 1e-3
    feasibility: float = 1e-4
    penalty: float = 10.0
    budget: int = 120
    fidelity: str = "standard"
    reference: bool = True
    agreement: float = 0.01
    sort_masses: tuple[float, ...] = (10.0, 15.0, 20.0)
    sort_front: float = 0.1
    plots: bool = True

    @property
    def limits(self) -> tuple[objectives.Limit, ...]:
        """What every impact must hold."""
        return (
            objectives.tip_deflection_limit(self.tip_limit),
            objectives.stress_limit(self.stress_limit),
            objectives.diverted_limit(self.crossing),
            objectives.tip_clearance_limit(self.tip_clearance),
        )

    def worst_case(self) -> "PeakForceConfig":
        """The paper's worst case alone: its parcel of 15 kg, met near the tip."""
        return dataclasses.replace(self, distances=(1.08,), masses=(15.0,), sort_masses=(15.0,))


_HELP = {
    "out": "folder for history.json, result.json and the figures",
    "distances": "arc coordinates of the first touch [m]",
    "masses": "parcel masses [kg]",
    "drive_angle": "drive angle at the first touch [rad]",
    "duration": "length of each impact [s]; the parcel must be diverted within it",
    "variables": f"what is designed, of {', '.join(VARIABLES)}",
    "bounds": "bounds in SI units instead of the default ones, as name=lower:upper",
    "tip_limit": "largest tip deflection [m]",
    "stress_limit": "largest bending stress [Pa]; 40 MPa stays below the yield of PA6, dry or not",
    "tip_clearance": "shortest distance from a loaded corner to the tip [m]",
    "crossing": "how far the parcel's centre must get past the belt's edge [m]",
    "reserve": "kept in hand of every margin [1], for the difference to the reference fidelity",
    "method": "sequential quadratic programming (sqp), or optax' Adam on an augmented Lagrangian "
    "(adam)",
    "tolerance": "on stationarity and complementarity [1]",
    "feasibility": "violation of a margin that counts as none [1]",
    "penalty": "penalty on violations at the start [1]",
    "budget": "evaluations at most",
    "fidelity": "fidelity of the optimisation: fast, standard or reference",
    "reference": "run the paper's fences and the optimum at the reference fidelity",
    "agreement": "largest relative difference of the force at the reference that confirms it [1]",
    "sort_masses": "parcel masses of the whole sorts run as a check [kg]; none: no check",
    "sort_front": "where the parcel's front is when such a sort starts [m]",
    "plots": "draw the figures",
}


def parser() -> argparse.ArgumentParser:
    """One flag for each field of the configuration."""
    result = flags.parser(
        PeakForceConfig,
        prog="optimize.peak_force",
        description="The fence with the smallest peak force over the worst of several impacts, "
        "from the paper's two-link fence, under limits.",
        explained=_HELP,
        special={
            "bounds": designs.BOUNDS_FLAG,
            "method": {"choices": ("sqp", "adam")},
            "fidelity": {"choices": flags.FIDELITIES},
            "sort_masses": {"nargs": "*"},
        },
    )
    result.add_argument(
        "--worst-case",
        action="store_true",
        default=argparse.SUPPRESS,
        help="the paper's worst case alone, 15 kg met near the tip, at R = 1.08 m, whatever the "
        "flags for distances and masses say",
    )
    return result


def configure(arguments: Sequence[str] | None = None) -> PeakForceConfig:
    """The configuration that flags describe."""
    return flags.configured(parser(), PeakForceConfig, arguments)
