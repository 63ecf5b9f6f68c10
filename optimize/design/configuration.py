"""The numbers of the design for one's own machine, and a flag for each."""

import dataclasses
from pathlib import Path

import fencejax as fj

from ..common import flags, machine


@dataclasses.dataclass(frozen=True)
class DesignConfig:
    """Every number of the job; `python -m optimize.design --help` says what each is."""

    not_in_key = frozenset({
        "out", "sorter", "set", "free", "tolerance", "feasibility", "budget", "check", "agreement",
        "picture",
    })  # fmt: skip
    """Fields that do not affect the numbers of an evaluation; a journal is valid for any of them.
    Bounds of limits are part of an evaluation's address."""

    out: Path = flags.field(
        Path("out"),
        "folder for design.json, report.html, fence.dxf and evaluations.jsonl; an interrupted "
        "job resumes from there",
    )
    sorter: str = machine.sorter_field("paper")
    set: tuple[str, ...] = machine.set_field()
    free: tuple[str, ...] = machine.free_field()
    reserve: float = flags.field(
        0.01,
        "reserve in every sort's margin [1], for the difference from a finer fidelity",
        least=0,
    )
    tolerance: float = flags.field(2e-3, "on stationarity and complementarity [1]", above=0)
    feasibility: float = flags.field(
        1e-3, "violation of a margin that counts as none [1]", above=0
    )
    rungs: int = flags.field(
        2, "fidelities, each finer, at which the search computes sorts in doubt", least=1
    )
    budget: int = flags.field(60, "evaluations at most for each candidate", least=1)
    fidelity: str = flags.field("fast", "fidelity of the search", choices=flags.FIDELITIES)
    check: str = flags.field(
        "standard", "fidelity at which designs are measured again", choices=flags.FIDELITIES
    )
    agreement: float = flags.field(
        0.02, "largest relative error of the objective that confirms a design [1]", above=0
    )
    picture: bool = flags.field(
        False,
        "simulate the hardest parcel's sort again for pictures in the report: one more program to "
        "compile",
    )

    def __post_init__(self):
        flags.check(self)

    @property
    def machine(self) -> fj.sorter.Machine:
        """The sorter with numbers set and freed.

        Raises `ValueError` and `TypeError` where it cannot be read.
        """
        found = machine.chosen(self)
        if found is None:
            raise ValueError("Argument `sorter` must name a sorter file, but is none.")
        return found

    def quick(self) -> "DesignConfig":
        """A small version: few evaluations, the coarse and the fast fidelity."""
        return dataclasses.replace(self, budget=12, fidelity="coarse", check="fast")


configure = flags.reader(
    DesignConfig,
    "optimize.design",
    "The fence for one's own machine, described by a sorter file: the smallest worst peak force "
    "over its parcels and places, within its limits, for each material.",
    quick="few evaluations at the coarse fidelity, where no flag for them says otherwise",
)
