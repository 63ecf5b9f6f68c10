"""The numbers of the reproduction, and a flag for each."""

import dataclasses
from pathlib import Path

import fencejax as fj

from ..common import flags
from .fences import REACH

_SPAN = {"nargs": 2, "metavar": ("FROM", "TO")}


@dataclasses.dataclass(frozen=True)
class PaperConfig:
    """Every number of the job; `python -m optimize.reproduce_paper --help` says what each is."""

    out: Path = flags.field(Path("out"), "folder for result.json and the figures")
    distance: float = flags.field(
        1.08, "R_s, arc coordinate of the first contact in the impact [m]", least=0
    )
    drive_angle: float = flags.field(0.30, "drive angle at the first contact in the impact [rad]")
    front: float = flags.field(0.1, "where the parcel's front is at t = 0 in the slide [m]")
    grid: int = flags.field(40, "points of the maps in each direction, for each fence", least=2)
    coarse_grid: int = flags.field(
        10, "the same where the table is repeated over open numbers", least=4
    )
    sensitivity_points: int = flags.field(
        61, "places at which the sensitivities are computed", least=2
    )
    masses: tuple[float, float] = flags.field(
        (1.0, 30.0), "span of the parcel mass in the maps [kg]", above=0, **_SPAN
    )
    distances: tuple[float, float] = flags.field(
        (0.3, 1.19), "span of the place of the first contact in the maps [m]", above=0, **_SPAN
    )
    chunk: int = flags.field(400, "impacts computed at a time", least=1)
    fidelity: str = flags.field("standard", "fidelity of the simulations", choices=flags.FIDELITIES)
    open_numbers: bool = flags.field(
        True, "repeat the table over the numbers that the paper leaves open"
    )
    plots: bool = flags.field(True, "draw the figures")

    def __post_init__(self):
        flags.check(self)
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

    @property
    def knobs(self) -> fj.Fidelity:
        """The fidelity by its name, with all steps alike."""
        return getattr(fj.Fidelity, self.fidelity)(longest_stride=1)

    def quick(self) -> "PaperConfig":
        """A small version: coarse maps, the fast fidelity."""
        return dataclasses.replace(
            self, grid=10, coarse_grid=8, sensitivity_points=8, chunk=200, fidelity="fast"
        )


configure = flags.reader(
    PaperConfig,
    "optimize.reproduce_paper",
    "Recompute the numerical results of T. Piatkowski, Active fence with flexible "
    "link, 2010, for the two-link and the one-link fence, and compare.",
    quick="coarse maps at the fast fidelity, where no flag for them says otherwise",
)
