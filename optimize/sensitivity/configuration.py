"""The numbers of the sensitivity study, and a flag for each."""

import dataclasses
import inspect
from pathlib import Path

import fencejax as fj
from fencejax.scenes import AnyScene, numbers as scene_numbers
from fencejax.study import quantities_of

from ..common import assignments, flags, machine, named
from . import defaults
from .defaults import RANGES

SCENES = (
    "oblique_impact", "along_fence", "border_and_fence", "whole_sort", "normal_impact",
    "rigid_wall",
)  # fmt: skip

AS_IT_IS = "the scene as it is"


@dataclasses.dataclass(frozen=True)
class SensitivityConfig:
    """Every number of the study; `python -m optimize.sensitivity --help` says what each is."""

    out: Path = flags.field(Path("out"), "folder for result.json, samples.npz and the figures")
    scene: str = flags.field(
        "oblique_impact", "which scene, with the paper's numbers", choices=SCENES
    )
    duration: float = flags.field(0.0, "length of each run [s]; 0: the scene's own", least=0)
    drive: str = named.drive_field()
    taper: str = named.taper_field()
    outputs: tuple[str, ...] = flags.field(
        ("peak_force", "tip_deflection", "impulse", "peak_stress"),
        f"of {', '.join(fj.OBJECTIVES)}, {named.OWN} of a Quantity",
    )
    variables: tuple[str, ...] = flags.field(
        (),
        "what varies, by name or path; by default all with a default range that the scene "
        f"has, of {', '.join(RANGES)}",
        nargs="*",
    )
    ranges: tuple[str, ...] = flags.field(
        (),
        "ranges [SI] instead of the default ones, as name=lower:upper[:logarithmic]; the default "
        "ones are around the paper's numbers. With a sorter file they are the spans of its free "
        "numbers and of its parcels; of the distance the same shares of the reach as of the "
        "paper's fence; of any other number, where the paper's range does not hold the sorter's "
        "own, 10 % either side of it",
        nargs="*",
        metavar="NAME=LOWER:UPPER",
    )
    sorter: str = machine.sorter_field()
    set: tuple[str, ...] = flags.field(
        (),
        "numbers that differ, each text as NAME=VALUE[,NAME=VALUE ...] (SI or a unit); of several "
        "each is a point at which the local study is made. By default, if the scene has a "
        "distance, two of them: 0.8 and 1 m on the paper's fence, and the same shares of the reach "
        "on another",
        nargs="*",
        type=str,
        metavar="NAME=VALUE",
    )
    along: str = flags.field(
        "default",
        "what the elasticities are followed along, as name=lower:upper [SI]; '' for none; by "
        "default the distance, if the scene has one, over 0.5:1.1 on the paper's fence, and the "
        "same shares of the reach on another",
    )
    along_count: int = flags.field(61, "places along it", least=2)
    gradients: int = flags.field(512, "gradients for the bounds; a power of 2", least=2)
    samples: int = flags.field(
        1024,
        "base points of the Sobol' indices; a power of 2. They cost samples x (variables + 2) runs",
        least=2,
    )
    confidence: float = flags.field(0.95, "of the intervals [1]", between=(0, 1))
    resamples: int = flags.field(200, "of the bootstrap", least=10)
    seed: int = flags.field(0, "of the sampling", least=0)
    fidelity: str = flags.field("standard", "fidelity of the simulations", choices=flags.FIDELITIES)
    chunk: int = flags.field(16, "runs computed at a time by a thread", least=1)
    plots: bool = flags.field(True, "draw the figures")

    def __post_init__(self):
        flags.check(self)
        for name in ("gradients", "samples"):
            value = getattr(self, name)
            if value & (value - 1):
                raise ValueError(
                    f"Argument `{name}` must be a power of 2, at which Sobol' points are balanced, "
                    f"but is {value}."
                )
        machine.only_without(self, "drive", "taper")
        if self.gradients > self.samples:
            raise ValueError(
                f"Argument `gradients` must be at most `samples` = {self.samples}, whose points it "
                f"takes, but is {self.gradients}."
            )

    @property
    def knobs(self) -> fj.Fidelity:
        """The fidelity by its name."""
        return getattr(fj.Fidelity, self.fidelity)()

    def base(self) -> AnyScene:
        """The scene with the paper's numbers."""
        if self.sorter != machine.NONE:
            return machine.scene(self.sorter, self.scene, self.duration or None)
        make = getattr(fj.scenes, self.scene)
        parts = {
            "fence": fj.Fence(taper=named.taper(self.taper)),
            "drive": named.drive(self.drive),
            "duration": self.duration if self.duration > 0 else None,
        }
        taken = inspect.signature(make).parameters
        return make(**{name: part for name, part in parts.items() if name in taken})

    def quantities(self) -> tuple[fj.Quantity, ...]:
        """The outputs."""
        return tuple(named.quantity("outputs", text) for text in self.outputs)

    def inputs(self, scene: AnyScene) -> tuple[fj.DesignVariable, ...]:
        """The inputs that vary, with their ranges.

        Raises `ValueError` for a name or a range that cannot be.
        """
        given = dict(_range(text) for text in self.ranges)
        sorter = None if self.sorter == machine.NONE else machine.once(self.sorter)
        usual = defaults.usual(scene, sorter)
        names = self.variables or tuple(dict.fromkeys([*usual, *given]))
        scene_numbers.together(scene, names)
        chosen = []
        for name in names:
            if name not in given and name not in usual:
                raise ValueError(
                    f"Argument `ranges` must hold one for {name!r}, which has no default one. "
                    f"Write {name}=lower:upper, or {name}=lower:upper:logarithmic."
                )
            if name in given:
                lower, upper, scaling = given[name]
                unit = scene_numbers.number(scene, name).unit
                variable = fj.DesignVariable(name, lower, upper, unit, scaling)
            else:
                variable = usual[name]
            scene_numbers.check(scene, name, variable.lower)
            scene_numbers.check(scene, name, variable.upper)
            chosen.append(variable)
        for name in given:
            if name not in names:
                raise ValueError(
                    f"Argument `ranges` must be of the variables {list(names)}, but names {name!r}."
                )
        return tuple(chosen)

    def places(self, scene: AnyScene) -> dict[str, dict[str, float]]:
        """The points of the local study by their text: numbers that differ from the scene's own.

        By default two distances or, where the scene has none, the scene as it is.
        """
        texts = self.set
        if not texts:
            texts = defaults.distances(scene)
        found = {}
        for text in texts:
            numbers = machine.numbers("set", text, scene) if text else {}
            for name, value in numbers.items():
                scene_numbers.check(scene, name, value)
            if numbers:
                scene_numbers.together(scene, tuple(numbers))
            title = ",".join(
                f"{name}={value:g} {scene_numbers.number(scene, name).unit}"
                for name, value in numbers.items()
            )
            found[title or AS_IT_IS] = numbers
        return found

    def line(self, scene: AnyScene) -> tuple[str, float, float] | None:
        """Name and bounds of the number along which elasticities are followed, if any."""
        text = self.along
        if text == "default":
            text = defaults.line(scene)
        if not text:
            return None
        name, (lower, upper, _) = _range(text)
        for value in (lower, upper):
            scene_numbers.check(scene, name, value)
        return name, lower, upper

    def check(self) -> None:
        """Raise `ValueError` where a name or a range is none of the scene's."""
        scene = self.base()
        quantities_of(scene, self.quantities())
        self.inputs(scene)
        self.places(scene)
        self.line(scene)

    def quick(self) -> "SensitivityConfig":
        """A small version: few points, the fast fidelity."""
        return dataclasses.replace(
            self, along_count=16, gradients=64, samples=64, resamples=50, fidelity="fast",
            duration=self.duration or (0.0 if self.scene == "whole_sort" else 0.15),
        )  # fmt: skip


def _range(text: str) -> tuple[str, tuple[float, float, str]]:
    form = "hold name=lower:upper[:scaling]"
    name, lower, upper, rest = assignments.span("ranges", text, form)
    if len(rest) > 1:
        raise assignments.refusal("ranges", text, form)
    return name, (lower, upper, rest[0] if rest else "linear")


configure = flags.reader(
    SensitivityConfig,
    "optimize.sensitivity",
    "What counts, and how much: elasticities by automatic differentiation, bounds on Sobol' "
    "indices by sampled derivatives, and the indices themselves.",
    quick="few points at the fast fidelity, where no flag for them says otherwise",
)
