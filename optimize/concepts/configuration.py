"""The numbers of the comparison of concepts, and a flag for each."""

import dataclasses
from pathlib import Path

import fencejax as fj

from ..common import flags, machine
from .means import LINKS, MEANS, Concept, ordered


@dataclasses.dataclass(frozen=True)
class ConceptsConfig:
    """Every number of the job; `python -m optimize.concepts --help` says what each is."""

    not_in_key = frozenset({
        "out", "sorter", "set", "free", "concepts", "rates", "load", "tolerance", "feasibility",
        "budget", "check", "verify", "agreement", "plots",
    })  # fmt: skip
    """Fields that do not affect the numbers of an evaluation; a journal is valid for any of them.
    Bounds of limits, and with them the rates, are part of an evaluation's address."""

    out: Path = flags.field(
        Path("out"),
        "folder for concepts.json, concepts.csv, report.html, the figures and the evaluations; an "
        "interrupted job resumes from there",
    )
    sorter: str = machine.sorter_field("paper")
    set: tuple[str, ...] = machine.set_field()
    free: tuple[str, ...] = machine.free_field()
    concepts: tuple[str, ...] = flags.field(
        (
            "rigid", "rigid+pad", "rigid+shaft", "rigid+clutch", "rigid+motion", "one_link",
            "one_link+clutch", "two_link", "two_link+curved", "two_link+pad", "two_link+motion",
            "two_link+pad+motion", "rigid+torque", "two_link+torque",
        ),
        f"what is compared: {' or '.join(LINKS)}, joined by + with any of "
        f"{', '.join(name for name in MEANS if name not in LINKS)}",
        metavar="CONCEPT",
    )  # fmt: skip
    rates: tuple[float, ...] = flags.field(
        (2400.0, 3000.0, 3600.0), "parcels an hour [1/h]", metavar="RATE", above=0
    )
    load: bool = flags.field(
        True, "minimise the largest acceleration in g, too, besides the peak force"
    )
    controls: int = flags.field(
        8, "control angles of a motion of any form, and values of a torque", least=3
    )
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
        1, "fidelities, each finer, at which the search computes sorts in doubt; its result is "
        "computed finer in any case", least=1,
    )
    budget: int = flags.field(30, "evaluations at most for each search", least=1)
    fidelity: str = flags.field("fast", "fidelity of the search", choices=flags.FIDELITIES)
    check: str = flags.field(
        "fast", "fidelity at which designs are compared", choices=flags.FIDELITIES
    )
    verify: str = flags.field(
        "reference", "fidelity at which every point is measured again", choices=flags.FIDELITIES
    )
    agreement: float = flags.field(
        0.02, "largest relative error of the objective that confirms a point [1]", above=0
    )
    plots: bool = flags.field(True, "draw the figure")

    def __post_init__(self):
        flags.check(self)
        for name in ("concepts", "rates"):
            given = getattr(self, name)
            if not given or len(set(given)) < len(given):
                raise ValueError(
                    f"Argument `{name}` must hold one at least, and none twice, but is {given}."
                )
        found = [concept.name for concept in self.read]
        if len(set(found)) < len(found):
            raise ValueError(f"Argument `concepts` must not repeat a concept, but is {found}.")

    @property
    def read(self) -> list[Concept]:
        """The concepts, special cases before general ones."""
        return ordered(Concept.read(text) for text in self.concepts)

    @property
    def paces(self) -> tuple[float, ...]:
        """The rates [1/h], the slowest first."""
        return tuple(sorted(self.rates))

    @property
    def described(self) -> fj.Sorter:
        """The sorter with numbers set and freed.

        Raises `ValueError` and `TypeError` where it cannot be read.
        """
        if self.sorter == machine.NONE:
            raise ValueError("Argument `sorter` must name a sorter file, but is none.")
        return machine.load(self.sorter, self.set, self.free)

    def quick(self) -> "ConceptsConfig":
        """A small version: three concepts at two rates, for the force alone, at the fast fidelity
        throughout."""
        return dataclasses.replace(
            self, concepts=("rigid", "one_link", "two_link"), rates=(2400.0, 3200.0), load=False,
            verify="fast", budget=25,
        )  # fmt: skip


configure = flags.reader(
    ConceptsConfig,
    "optimize.concepts",
    "Which concept of softening wins: the least worst peak force, and acceleration in g, over "
    "parcels an hour, of each concept under the same limits, with its torque and mass.",
    quick="three concepts at two rates, for the force alone, where no flag for them says otherwise",
)
