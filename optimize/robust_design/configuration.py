"""The numbers of the robust design, and a flag for each."""

import argparse
import dataclasses
from collections.abc import Sequence
from pathlib import Path

import fencejax as fj
from fencejax.design import Limit, objectives, risk

from ..common import designs, flags
from ..common.encounters import KINDS

SEVERITIES = {"force": "N", "g_load": "1", "drop_height": "m"}
"""Units of what a blow is measured by: the peak force, F / (m g), the equivalent drop height."""
METHODS = ("sample", "stochastic")
_DURATIONS = {"impacts": 0.20, "sorts": 1.4}
Span = tuple[float, float]


@dataclasses.dataclass(frozen=True)
class RobustConfig:
    """Every number of the job; `python -m optimize.robust_design --help` says what each is."""

    out: Path = Path("out")
    scenes: str = "sorts"
    severity: str = "force"
    measure: str = "cvar"
    level: float = 0.95
    fraction: float = 0.95
    tip_limit: float = 0.08
    stress_limit: float = 40e6
    crossing: float = 0.0
    mass: Span = (0.2, 30.0)
    length: Span = (0.20, 0.60)
    breadth: Span = (0.15, 0.40)
    stiffness: Span = (0.6e9, 5.0e9)
    offset: Span = (0.0, 0.25)
    angle: Span = (-0.3, 0.3)
    front: Span = (0.0, 0.2)
    belt_friction: Span = (0.5, 0.8)
    fence_friction: Span = (0.25, 0.45)
    distance: Span = (0.75, 1.05)
    drive_angle: Span = (0.2, 0.4)
    variables: tuple[str, ...] = ("thickness", "length_ratio", "youngs_modulus")
    bounds: tuple[tuple[str, float, float], ...] = ()
    method: str = "sample"
    sample: int = 512
    batch: int = 128
    steps: int = 60
    rate: float = 0.03
    tolerance: float = 5e-3
    feasibility: float = 1e-3
    budget: int = 40
    fresh: int = 2000
    resamples: int = 1000
    confidence: float = 0.95
    excluded_most: float = 0.01
    chunk: int = 64
    duration: float = 0.0
    fidelity: str = "fast"
    check_fidelity: str = "standard"
    seed: int = 0
    plots: bool = True

    def __post_init__(self):
        flags.one_of("scenes", self.scenes, KINDS)
        flags.one_of("severity", self.severity, tuple(SEVERITIES))
        flags.one_of("measure", self.measure, risk.MEASURES)
        flags.one_of("method", self.method, METHODS)
        for name in ("fidelity", "check_fidelity"):
            flags.one_of(name, getattr(self, name), flags.FIDELITIES)
        flags.at_least(
            self, sample=16, batch=16, steps=2, budget=1, fresh=50, resamples=50, chunk=1
        )
        for name in ("level", "fraction", "confidence"):
            value = getattr(self, name)
            if not 0 < value < 1:
                raise ValueError(f"Argument `{name}` must be in (0, 1) [1], but is {value:g}.")
        positive = ("mass", "length", "breadth", "stiffness")
        for name in (*positive, *LINEAR):
            low, high = getattr(self, name)
            if not low <= high or (name in positive and low <= 0):
                raise ValueError(
                    f"Argument `{name}` must be two numbers, the second at least the first"
                    f"{' and both above 0' if name in positive else ''}, but is {low:g}, {high:g}."
                )
        if self.offset[0] < 0:
            raise ValueError(f"Argument `offset` must be at least 0 [m], but is {self.offset[0]}.")
        if self.duration < 0:
            raise ValueError(f"Argument `duration` must be at least 0 [s], but is {self.duration}.")

    @property
    def seconds(self) -> float:
        """Duration of each scene [s]."""
        return self.duration or _DURATIONS[self.scenes]

    @property
    def unit(self) -> str:
        """Unit of the severity."""
        return SEVERITIES[self.severity]

    @property
    def limits(self) -> tuple[Limit, ...]:
        """What the stated fraction of parcels must hold."""
        return (
            objectives.tip_deflection_limit(self.tip_limit),
            objectives.stress_limit(self.stress_limit),
            objectives.diverted_limit(self.crossing),
        )

    @property
    def space(self) -> fj.DesignSpace:
        """The variables with their bounds."""
        return designs.space(self.variables, self.bounds)

    def quick(self) -> "RobustConfig":
        """A small version: few parcels, the fast fidelity throughout."""
        return dataclasses.replace(
            self, sample=96, batch=48, steps=12, budget=15, fresh=200, resamples=200,
            check_fidelity="fast",
        )  # fmt: skip


LOGARITHMIC = ("mass", "stiffness")
"""Spans drawn evenly in the logarithm."""
LINEAR = (
    "length", "breadth", "offset", "angle", "front", "belt_friction", "fence_friction",
    "distance", "drive_angle",
)  # fmt: skip
"""Spans drawn evenly."""

_HELP = {
    "out": "folder for robust.json, evaluations.jsonl, fresh.npz and the figures; a job that was "
    "interrupted goes on from there",
    "scenes": "whole sorts, or single impacts",
    "severity": "what a blow is measured by: peak force, g-load F / (m g), or the height of the "
    "drop on a corner that hits as hard",
    "measure": "what is minimised over the parcels: mean, cvar (mean of the worst) or worst",
    "level": "of the CVaR: the share of parcels that are not among the worst [1]",
    "fraction": "share of parcels for which each limit must hold [1]",
    "tip_limit": "largest tip deflection [m]",
    "stress_limit": "largest bending stress [Pa]",
    "crossing": "how far the parcel's centre must get past the belt's edge [m]",
    "mass": "span of the parcel mass [kg], even in its logarithm",
    "length": "span of the parcel's side along the belt [m]",
    "breadth": "span of the parcel's side across the belt [m]",
    "stiffness": "span of k_p [N/m^4], even in its logarithm; b_p goes with its power 0.6, so that "
    "the restitution stays",
    "offset": "of sorts: span of Delta s, from the border to the parcel [m]",
    "angle": "of sorts: span of the parcel's turn [rad]",
    "front": "of sorts: span of the parcel's front when the drive starts, its timing [m]",
    "belt_friction": "span of the kinetic friction on the belt [1]",
    "fence_friction": "span of the kinetic friction on the fence [1]",
    "distance": "of impacts: span of the first touch's arc coordinate [m]",
    "drive_angle": "of impacts: span of the drive angle at the first touch [rad]",
    "variables": "what is designed",
    "bounds": "bounds in SI units instead of the default ones, as name=lower:upper",
    "method": "sample: one sample throughout, by quadratic programming; stochastic: a fresh batch "
    "at every step, by optax' Adam",
    "sample": "parcels of the sample",
    "batch": "parcels of a batch",
    "steps": "stochastic steps",
    "rate": "of the stochastic steps at the start, in shares of the ranges [1]",
    "tolerance": "of the sample's problem, on stationarity and complementarity [1]",
    "feasibility": "violation of a margin that counts as none [1]",
    "budget": "evaluations of the sample's problem at most",
    "fresh": "parcels of the fresh sample, at which both designs are judged",
    "resamples": "of the bootstrap",
    "confidence": "of the intervals [1]",
    "excluded_most": "largest share of fresh parcels whose numbers are bad [1]",
    "chunk": "parcels in one vectorised call",
    "duration": "length of each scene [s]; 0: 0.2 s (impacts), 1.4 s (sorts)",
    "fidelity": "fidelity of the optimisation",
    "check_fidelity": "fidelity of the fresh sample",
    "seed": "of all samples",
    "plots": "draw the figures",
}
_SPECIAL = {
    "scenes": dict(choices=KINDS),
    "severity": dict(choices=tuple(SEVERITIES)),
    "measure": dict(choices=risk.MEASURES),
    "method": dict(choices=METHODS),
    "fidelity": dict(choices=flags.FIDELITIES),
    "check_fidelity": dict(choices=flags.FIDELITIES),
    "bounds": designs.BOUNDS_FLAG,
    **{name: dict(type=float, nargs=2, metavar=("FROM", "TO")) for name in LOGARITHMIC + LINEAR},
}


def parser() -> argparse.ArgumentParser:
    """One flag for each field of the configuration, and --quick."""
    return flags.parser(
        RobustConfig,
        "optimize.robust_design",
        "The fence for parcels as they come: mean, CVaR or worst case of the blow over thousands "
        "of sorts, with limits that hold for a stated fraction of parcels.",
        _HELP,
        _SPECIAL,
        "few parcels at the fast fidelity, whatever the flags for them say",
    )


def configure(arguments: Sequence[str] | None = None) -> RobustConfig:
    """The configuration that flags describe.

    Raises `ValueError` where a number is out of range.
    """
    return flags.configured(parser(), RobustConfig, arguments)
