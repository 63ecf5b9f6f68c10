"""The numbers of the reproduction, and a flag for each."""

import argparse
import dataclasses
from collections.abc import Sequence
from pathlib import Path

import fencejax as fj

from ..common import flags
from .fences import REACH


@dataclasses.dataclass(frozen=True)
class PaperConfig:
    """Every number of the job; `python -m optimize.reproduce_paper --help` says what each is."""

    out: Path = Path("out")
    distance: float = 1.08
    drive_angle: float = 0.30
    front: float = 0.1
    grid: int = 40
    coarse_grid: int = 10
    sensitivity_points: int = 61
    masses: tuple[float, float] = (1.0, 30.0)
    distances: tuple[float, float] = (0.3, 1.19)
    chunk: int = 400
    fidelity: str = "standard"
    open_numbers: bool = True
    plots: bool = True

    def __post_init__(self):
        flags.at_least(self, grid=2, coarse_grid=4, sensitivity_points=2, chunk=1)
        for name, lowest, highest in (("masses", 0.0, None), ("distances", 0.0, REACH)):
            low, high = getattr(self, name)
            if not lowest < low < high:
                raise ValueError(
                    f"Argument `{name}` must be two rising numbers above {lowest:g}, but is "
                    f"{low:g}, {high:g}."
                )
            if highest is not None and high > highest:
                raise ValueError(
                    f"Argument `{name}` must be at most {highest:g} [m], but is {high:g}. The "
                    "fence ends there."
                )
        flags.one_of("fidelity", self.fidelity, flags.FIDELITIES)

    @property
    def knobs(self) -> fj.Fidelity:
        """The fidelity by its name, with all steps alike."""
        return getattr(fj.Fidelity, self.fidelity)(longest_stride=1)

    def quick(self) -> "PaperConfig":
        """A small version: coarse maps, the fast fidelity."""
        return dataclasses.replace(
            self, grid=10, coarse_grid=8, sensitivity_points=8, chunk=200, fidelity="fast"
        )


_HELP = {
    "out": "folder for result.json and the figures",
    "distance": "R_s, arc coordinate of the first touch in the impact [m]",
    "drive_angle": "drive angle at the first touch in the impact [rad]",
    "front": "where the parcel's front is at t = 0 in the slide [m]",
    "grid": "points of the maps in each direction, for each fence",
    "coarse_grid": "the same where the table is repeated over open numbers",
    "sensitivity_points": "places at which the sensitivities are computed",
    "masses": "span of the parcel mass in the maps [kg]",
    "distances": "span of the place of the first touch in the maps [m]",
    "chunk": "impacts computed at a time",
    "fidelity": "fast, standard or reference",
    "open_numbers": "repeat the table over the numbers that the paper leaves open",
    "plots": "draw the figures",
}


def parser() -> argparse.ArgumentParser:
    """One flag for each field of the configuration, and `--quick`."""
    span = {"nargs": 2, "metavar": ("FROM", "TO")}
    return flags.parser(
        PaperConfig,
        prog="optimize.reproduce_paper",
        description="Recompute the numerical results of T. Piatkowski, Active fence with flexible "
        "link, 2010, for the two-link and the one-link fence, and compare.",
        explained=_HELP,
        special={
            "masses": span, "distances": span, "fidelity": {"choices": flags.FIDELITIES},
        },
        quick="coarse maps at the fast fidelity, whatever the flags for them say",
    )  # fmt: skip


def configure(arguments: Sequence[str] | None = None) -> PaperConfig:
    """The configuration that flags describe.

    Raises `ValueError` where a number is out of range.
    """
    return flags.configured(parser(), PaperConfig, arguments)
