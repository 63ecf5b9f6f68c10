"""The numbers of the identification, and a flag for each."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import fencejax as fj
from fencejax.scenes import AnyScene, numbers as scene_numbers
from fencejax.study import OFFSET, PARAMETERS, SIGNALS, Recording

from ..common import assignments, flags

SCENES = ("oblique_impact", "normal_impact")
# The longest impact that a recording in seconds would hold [s].
_LONGEST = 5.0
_PAIRS = "hold numbers as name=value[,name=value ...]"


@dataclasses.dataclass(frozen=True)
class IdentifyConfig:
    """Every number of the job; `python -m optimize.identify --help` says what each is."""

    out: Path = Path("out")
    records: tuple[str, ...] = ()
    demo: bool = False
    scene: str = "oblique_impact"
    known: tuple[str, ...] = ()
    signals: tuple[str, ...] = ()
    parameters: tuple[str, ...] = (
        "youngs_modulus", "damping_ratio", "stiffness", "damping", "fence_kinetic_friction",
    )  # fmt: skip
    noise: tuple[str, ...] = ()
    starts: int = 3
    confidence: float = 0.95
    seed: int = 0
    budget: int = 100
    fidelity: str = "standard"
    demo_fidelity: str = "standard"
    demo_noise: float = 0.02
    demo_rows: int = 250
    plots: bool = True

    def __post_init__(self):
        flags.one_of("scene", self.scene, SCENES)
        flags.one_of("fidelity", self.fidelity, flags.FIDELITIES)
        flags.one_of("demo_fidelity", self.demo_fidelity, flags.FIDELITIES)
        flags.at_least(self, starts=1, seed=0, budget=1, demo_rows=20)
        for name in self.signals:
            flags.one_of("signals", name, tuple(SIGNALS))
        if bool(self.records) == self.demo:
            raise ValueError(
                "Argument `records` must name at least one CSV file, or `demo` be asked for, but "
                f"{'both' if self.demo else 'neither'} is given. Write --records impact.csv, or "
                "--demo."
            )
        if not 0 < self.confidence < 1:
            raise ValueError(
                f"Argument `confidence` must be within 0 and 1 [1], but is {self.confidence:g}."
            )
        if not 0 < self.demo_noise < 1:
            raise ValueError(
                f"Argument `demo_noise` must be within 0 and 1 [1], but is {self.demo_noise:g}."
            )
        if self.demo and self.scene == "normal_impact":
            raise ValueError(
                "Argument `scene` must be 'oblique_impact' for the demonstration, which also looks "
                "for friction, but is 'normal_impact'."
            )
        if self.known and len(self.known) not in (1, len(self.records)):
            raise ValueError(
                f"Argument `known` must hold one set of numbers, or one for each of the "
                f"{len(self.records)} records, but holds {len(self.known)}."
            )

    @property
    def knobs(self) -> fj.Fidelity:
        """The fidelity by its name."""
        return getattr(fj.Fidelity, self.fidelity)()

    def searched(self) -> tuple[str | fj.DesignVariable, ...]:
        """What is searched, of `name` and `name=lower:upper[:scaling]`."""
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
            unit = "s" if name == OFFSET else scene_numbers.unit(scene_numbers.resolve(scene, name))
            form = "hold name or name=lower:upper[:linear]"
            _, lower, upper, scaling = assignments.span("parameters", text, form)
            found.append(fj.DesignVariable(name, lower, upper, unit, *scaling[:1]))
        return tuple(found)

    def numbers(self, index: int) -> dict[str, float]:
        """What is known of the setting of a record, by name [SI]."""
        if not self.known:
            return {}
        text = self.known[index if len(self.known) > 1 else 0]
        return assignments.values("known", text, _PAIRS)

    def scales(self) -> dict[str, float] | None:
        """The noise by signal, if it is given."""
        if not self.noise:
            return None
        found = [assignments.values("noise", text, _PAIRS) for text in self.noise]
        return {name: value for one in found for name, value in one.items()}

    def base(self, numbers: dict[str, float], duration: float) -> AnyScene:
        """A scene with the paper's numbers but for some that are known."""
        scene = getattr(fj.scenes, self.scene)(duration=duration)
        for name, value in numbers.items():
            scene_numbers.check(scene, name, value)
        if not numbers:
            return scene
        return scene_numbers.replace(scene, tuple(numbers), list(numbers.values()))

    def setting(self, index: int, recording: Recording) -> AnyScene:
        """The scene of a record, as long as it lasts.

        Raises `ValueError` where it lasts too long for an impact.
        """
        latest = 0.0
        for parameter in self.searched():
            name = parameter if isinstance(parameter, str) else parameter.name
            if name == OFFSET:
                latest = PARAMETERS[name].upper if isinstance(parameter, str) else parameter.upper
        last = float(recording.time[-1]) + latest
        if not 0 < last <= _LONGEST:
            raise ValueError(
                f"{recording.source}: times must end within 0 and {_LONGEST:g} s after the first "
                f"touch, but end at {float(recording.time[-1]):g} s. Are these milliseconds? Write "
                "`time [ms]` in the header."
            )
        return self.base(self.numbers(index), last)

    def quick(self) -> "IdentifyConfig":
        """A small version: one start, the fast fidelity."""
        return dataclasses.replace(
            self, starts=1, demo_rows=120, fidelity="fast", demo_fidelity="fast"
        )


_HELP = {
    "out": "folder for result.json and the figures",
    "records": "CSV files, one an impact: a header such as `time [ms],force [N]`, then rows; "
    f"signals are {', '.join(SIGNALS)}, and time counts from the first touch",
    "demo": "make a recording with noise from numbers that are known, and find them again",
    "scene": "what was recorded, with the paper's numbers",
    "known": "numbers of the setting that differ from the paper's, as name=value[,name=value ...] "
    "[SI]: one for all records, or one a record",
    "signals": "which columns to use; by default all that the first record has",
    "parameters": "what is searched, as name or name=lower:upper[:linear] [SI]; with default "
    f"bounds: {', '.join(PARAMETERS)}",
    "noise": "standard deviations as signal=value [SI]; by default estimated from the residuals",
    "starts": "searches, the first from the setting's own numbers, the others spread",
    "confidence": "of the intervals [1]",
    "seed": "of the starts and of the demonstration's noise",
    "budget": "evaluations at most in a search",
    "fidelity": "fidelity of the model: fast, standard or reference",
    "demo_fidelity": "fidelity of the demonstration's recording",
    "demo_noise": "its noise as a share of each signal's largest value [1]",
    "demo_rows": "its number of rows",
    "plots": "draw the figures",
}


def parser():
    """One flag for each field of the configuration, and --quick."""
    choices = {name: {"choices": flags.FIDELITIES} for name in ("fidelity", "demo_fidelity")}
    return flags.parser(
        IdentifyConfig,
        "optimize.identify",
        "Young's modulus, damping, the parcel's stiffness and friction from recordings of impacts, "
        "by least squares with the simulation's own derivatives, and how well they are known.",
        _HELP,
        {
            "scene": {"choices": SCENES},
            "records": {"nargs": "*", "metavar": "CSV"},
            "known": {"nargs": "*", "metavar": "NAME=VALUE"},
            "signals": {"nargs": "*", "choices": tuple(SIGNALS)},
            "noise": {"nargs": "*", "metavar": "SIGNAL=VALUE"},
            "demo": {"action": "store_true"},
            **choices,
        },
        quick="one start at the fast fidelity, whatever the flags for them say",
    )


def configure(arguments: Sequence[str] | None = None) -> IdentifyConfig:
    """The configuration that flags describe.

    Raises `ValueError` where a number is out of range.
    """
    return flags.configured(parser(), IdentifyConfig, arguments)
