"""The numbers of the measurement, and a flag for each."""

import dataclasses
from pathlib import Path

from ..common import flags
from .cases import SCENES

LADDERS = ("full", "dense", "quick")


@dataclasses.dataclass(frozen=True)
class WorkPrecisionConfig:
    """Every number of the job; `python -m optimize.work_precision --help` says what each is."""

    out: Path = flags.field(
        Path("out"), "folder for work_precision.md, work_precision.json and the figures"
    )
    scene: tuple[str, ...] = flags.field(
        SCENES,
        "the paper's impact, the slide, the whole sort, the random impacts, the random sorts",
        choices=SCENES,
        default=list(SCENES),
    )
    random: int = flags.field(255, "random impacts", least=1)
    sorts: int = flags.field(100, "random whole sorts", least=1)
    seed: int = flags.field(1, "of the random impacts", least=0)
    duration: float = flags.field(0.13, "length of an impact [s]", above=0)
    lanes: int = flags.field(32, "impacts over which each knob is moved by itself", least=1)
    candidates: int = flags.field(
        6, "points of the product grid that are measured, besides the rungs", least=0
    )
    ladder: str = flags.field("full", "full, dense (more points a knob) or quick", choices=LADDERS)
    integrators: bool = flags.field(True, "run diffrax's general solvers too")
    orders: bool = flags.field(True, "measure the orders of convergence on smooth segments")
    cold: bool = flags.field(
        True, "measure compile times, single runs and memory in processes of their own"
    )
    batch: int = flags.field(4096, "lanes of the large batch", least=1)
    repeats: int = flags.field(15, "runs of which the median is taken", least=3)
    threads: int = flags.field(
        2, "programs compiled at a time; times are measured one at a time", least=1
    )
    plots: bool = flags.field(True, "draw the figures")

    def __post_init__(self):
        flags.check(self)
        if not self.scene:
            raise ValueError(f"Argument `scene` must name at least one of {SCENES}, but is empty.")

    def quick(self) -> "WorkPrecisionConfig":
        """A small version: eight impacts, few points."""
        scenes = tuple(name for name in self.scene if name in ("impact", "random"))
        return dataclasses.replace(
            self, scene=scenes or ("random",), random=7, lanes=8, candidates=0, ladder="quick",
            integrators=False, orders=False, cold=False, batch=8, repeats=5,
        )  # fmt: skip


configure = flags.reader(
    WorkPrecisionConfig,
    "optimize.work_precision",
    "Measure speed against accuracy of the fidelities, for values and gradients.",
    quick="eight impacts, few points, where no flag for them says otherwise",
)
