"""The numbers of the identification, and a flag for each."""

import dataclasses
from pathlib import Path

import numpy as np

import fencejax as fj
from fencejax.scenes import AnyScene, numbers as scene_numbers
from fencejax.sorter import amount
from fencejax.study import OFFSET, PARAMETERS, SIGNALS, Aligned, Recording, align

from ..common import assignments, flags, machine

SCENES = ("oblique_impact", "normal_impact")
AUTO, ALL = "auto", "all"
# Duration of a scene with which the first contact of a recording is found [s].
_SEARCH_DURATION = 0.25
_PAIRS = "hold numbers as name=value[,name=value ...]"


@dataclasses.dataclass(frozen=True)
class IdentifyConfig:
    """Every number of the job; `python -m optimize.identify --help` says what each is."""

    out: Path = flags.field(Path("out"), "folder for result.json and the figures")
    records: tuple[str, ...] = flags.field(
        (),
        "text files, one an impact: a header such as `time [ms],force [N]`, then rows, with a "
        "decimal point or, between semicolons, a decimal comma; signals are "
        f"{', '.join(SIGNALS)}",
        nargs="*",
        metavar="CSV",
    )
    columns: tuple[str, ...] = flags.field(
        (),
        "columns that have other titles, as NAME=TITLE: time=Zeit force='Kraft [kN]'",
        nargs="*",
        metavar="NAME=TITLE",
    )
    delay: tuple[str, ...] = flags.field(
        (AUTO,),
        f"time of the first contact on the recordings' clocks, such as '12.5 ms', for all or one a "
        f"record; {AUTO}: found in the recording, and fitted with the other numbers",
        metavar="TIME",
    )
    length: str = flags.field(
        ALL, "length of the part of a recording used, from the first contact on, such as '150 ms'; "
        f"{ALL}: to its end", metavar="TIME",
    )  # fmt: skip
    demo: bool = flags.field(
        False,
        "make a recording with noise from known numbers, and find them again",
        action="store_true",
    )
    scene: str = flags.field(
        "oblique_impact", "what was recorded, with the paper's numbers", choices=SCENES
    )
    sorter: str = machine.sorter_field()
    set: tuple[str, ...] = flags.field(
        (),
        "numbers of the setting that differ, as NAME=VALUE[,NAME=VALUE ...] (SI or a unit): one "
        "text for all records, or one a record",
        nargs="*",
        metavar="NAME=VALUE",
    )
    signals: tuple[str, ...] = flags.field(
        (),
        "which columns to use; by default all that the first record has",
        nargs="*",
        choices=tuple(SIGNALS),
    )
    parameters: tuple[str, ...] = flags.field(
        ("youngs_modulus", "damping_ratio", "stiffness", "damping", "fence_kinetic_friction"),
        "what is searched, as name or name=lower:upper[:linear] [SI]; with default "
        f"bounds: {', '.join(PARAMETERS)}",
    )
    noise: tuple[str, ...] = flags.field(
        (),
        "standard deviations as signal=value [SI]; by default estimated from the residuals",
        nargs="*",
        metavar="SIGNAL=VALUE",
    )
    starts: int = flags.field(
        3, "searches, the first from the setting's own numbers, the others spread", least=1
    )
    confidence: float = flags.field(0.95, "of the intervals [1]", between=(0, 1))
    refine: bool = flags.field(
        True, "continue the search at the next finer fidelity where numbers are in doubt"
    )
    posterior: bool = flags.field(
        False, "standard errors with the model's curvature, too (Laplace)", action="store_true"
    )
    seed: int = flags.field(0, "of the starts and of the demonstration's noise", least=0)
    budget: int = flags.field(100, "evaluations at most in a search", least=1)
    fidelity: str = flags.field(
        "standard",
        "fidelity of the model",
        choices=flags.FIDELITIES,
    )
    demo_fidelity: str = flags.field(
        "standard", "fidelity of the demonstration's recording", choices=flags.FIDELITIES
    )
    demo_noise: float = flags.field(
        0.02, "its noise as a share of each signal's largest value [1]", between=(0, 1)
    )
    demo_rows: int = flags.field(250, "its number of rows", least=20)
    plots: bool = flags.field(True, "draw the figures")

    def __post_init__(self):
        flags.check(self)
        if bool(self.records) == self.demo:
            raise ValueError(
                "Argument `records` must name at least one CSV file, or `demo` be asked for, but "
                f"{'both' if self.demo else 'neither'} is given. Write --records impact.csv, or "
                "--demo."
            )
        if self.demo and self.scene == "normal_impact":
            raise ValueError(
                "Argument `scene` must be 'oblique_impact' for the demonstration, which also looks "
                "for friction, but is 'normal_impact'."
            )
        if self.set and len(self.set) not in (1, len(self.records)):
            raise ValueError(
                f"Argument `set` must hold one set of numbers, or one for each of the "
                f"{len(self.records)} records, but holds {len(self.set)}."
            )
        self.scales()
        if len(self.delay) not in (1, len(self.records)) or AUTO in self.delay[1:]:
            raise ValueError(
                f"Argument `delay` must be {AUTO}, or hold one time, or one for each of the "
                f"{len(self.records)} records, but holds {self.delay}."
            )

    @property
    def knobs(self) -> fj.Fidelity:
        """The fidelity by its name."""
        return getattr(fj.Fidelity, self.fidelity)()

    def searched(self) -> tuple[str | fj.DesignVariable, ...]:
        """The parameters, from `name` and `name=lower:upper[:scaling]`."""
        found = []
        scene = self.base({}, 0.1)
        for text in self.parameters:
            name, given, _ = text.partition("=")
            if not given:
                if name not in PARAMETERS:
                    raise ValueError(
                        f"Argument `parameters` must give bounds for {name!r}, which has no "
                        f"default ones. Write {name}=lower:upper[:linear]."
                    )
                found.append(name)
                continue
            unit = "s" if name == OFFSET else scene_numbers.number(scene, name).unit
            form = "hold name or name=lower:upper[:linear]"
            _, lower, upper, scaling = assignments.span("parameters", text, form)
            found.append(fj.DesignVariable(name, lower, upper, unit, *scaling[:1]))
        return tuple(found)

    def numbers(self, index: int) -> dict[str, float]:
        """The known numbers of a record's setting, by name [SI]."""
        if not self.set:
            return {}
        return machine.numbers("set", self.set[index if len(self.set) > 1 else 0])

    def scales(self) -> dict[str, float] | None:
        """The noise by signal, if it is given."""
        if not self.noise:
            return None
        found = [assignments.values("noise", text, _PAIRS) for text in self.noise]
        scales = {name: value for one in found for name, value in one.items()}
        for name, value in scales.items():
            if not 0 < value < np.inf:
                raise ValueError(
                    f"Argument `noise` must hold standard deviations above 0, but that of {name} "
                    f"is {value:g} [{SIGNALS.get(name, '1')}]."
                )
        return scales

    def base(self, numbers: dict[str, float], duration: float) -> AnyScene:
        """A scene with the paper's numbers, or a sorter's, except for the known ones."""
        if self.sorter == machine.NONE:
            scene = getattr(fj.scenes, self.scene)(duration=duration)
        else:
            scene = machine.scene(self.sorter, self.scene, duration)
        for name, value in numbers.items():
            scene_numbers.check(scene, name, value)
        if not numbers:
            return scene
        return scene_numbers.replace(scene, tuple(numbers), list(numbers.values()))

    def titles(self) -> dict[str, str]:
        """The titles of columns that differ from the signals' names."""
        return machine.pairs("columns", self.columns)

    def aligned(self, index: int, recording: Recording) -> Aligned:
        """A record on the clock of its scene.

        Raises `ValueError` where its first contact cannot be found, and where it lasts too long
        for an impact.
        """
        length = None if self.length == ALL else amount("length", self.length, "s")
        text = self.delay[index if len(self.delay) > 1 else 0]
        delay = None if text == AUTO else amount("delay", text, "s")
        span = float(np.ptp(recording.time))
        duration = min(_SEARCH_DURATION, span if length is None else length)
        scene = self.base(self.numbers(index), duration)
        return align(scene, recording, delay=delay, length=length, fidelity=self.knobs)

    def quick(self) -> "IdentifyConfig":
        """A small version: one start, the fast fidelity."""
        return dataclasses.replace(
            self, starts=1, demo_rows=120, fidelity="fast", demo_fidelity="fast"
        )


configure = flags.reader(
    IdentifyConfig,
    "optimize.identify",
    "Young's modulus, damping, the parcel's stiffness and friction from recordings of impacts, "
    "by least squares with the simulation's own derivatives, and how well they are known.",
    quick="one start at the fast fidelity, where no flag for them says otherwise",
)
