"""The numbers of the measurement, and a flag for each."""

import argparse
import dataclasses
from collections.abc import Sequence
from pathlib import Path

from ..common import flags
from .cases import SCENES

LADDERS = ("full", "dense", "quick")


@dataclasses.dataclass(frozen=True)
class WorkPrecisionConfig:
    """Every number of the job; `python -m optimize.work_precision --help` says what each is."""

    out: Path = Path("out")
    scene: tuple[str, ...] = SCENES
    random: int = 255
    sorts: int = 100
    seed: int = 1
    duration: float = 0.13
    lanes: int = 32
    candidates: int = 6
    ladder: str = "full"
    integrators: bool = True
    orders: bool = True
    cold: bool = True
    batch: int = 4096
    repeats: int = 15
    threads: int = 2
    plots: bool = True

    def __post_init__(self):
        flags.at_least(
            self, random=1, sorts=1, lanes=1, candidates=0, batch=1, repeats=3, threads=1, seed=0
        )
        if not self.duration > 0:
            raise ValueError(
                f"Argument `duration` must be above 0 [s], but is {self.duration:g}."
            )
        for name in self.scene:
            if name not in SCENES:
                raise ValueError(f"Argument `scene` must be of {SCENES}, but holds {name!r}.")
        if not self.scene:
            raise ValueError(f"Argument `scene` must name at least one of {SCENES}, but is empty.")
        flags.one_of("ladder", self.ladder, LADDERS)

    def quick(self) -> "WorkPrecisionConfig":
        """A small version: eight impacts, few points."""
        scenes = tuple(name for name in self.scene if name in ("impact", "random"))
        return dataclasses.replace(
            self, scene=scenes or ("random",), random=7, lanes=8, candidates=0, ladder="quick",
            integrators=False, orders=False, cold=False, batch=8, repeats=5,
        )  # fmt: skip


_HELP = {
    "out": "folder for work_precision.md, work_precision.json and the figures",
    "scene": "the paper's impact, the slide, the whole sort, the random impacts, the random sorts",
    "random": "random impacts",
    "sorts": "random whole sorts",
    "seed": "of the random impacts",
    "duration": "length of an impact [s]",
    "lanes": "impacts over which each knob is moved by itself",
    "candidates": "points of the product grid that are measured, besides the rungs",
    "ladder": "full, dense (more points a knob) or quick",
    "integrators": "run diffrax's general solvers too",
    "orders": "measure the orders of convergence on smooth segments",
    "cold": "measure compile times, single runs and memory in processes of their own",
    "batch": "lanes of the large batch",
    "repeats": "runs of which the median is taken",
    "threads": "programs compiled at a time; times are measured one at a time",
    "plots": "draw the figures",
}


def parser() -> argparse.ArgumentParser:
    """One flag for each field of the configuration, and `--quick`."""
    return flags.parser(
        WorkPrecisionConfig,
        prog="optimize.work_precision",
        description="Measure speed against accuracy of the fidelities, for values and gradients.",
        explained=_HELP,
        special={
            "scene": {"choices": SCENES, "default": list(SCENES)},
            "ladder": {"choices": LADDERS},
        },
        quick="eight impacts, few points, whatever else is said",
    )


def configure(arguments: Sequence[str] | None = None) -> WorkPrecisionConfig:
    """The configuration that flags describe.

    Raises `ValueError` where a number is out of range.
    """
    return flags.configured(parser(), WorkPrecisionConfig, arguments)
