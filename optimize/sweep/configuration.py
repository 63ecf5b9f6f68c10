"""The numbers of a sweep, and a flag for each."""

import dataclasses
import os
from pathlib import Path

import fencejax as fj
from fencejax.design import DesignVariable
from fencejax.scenes import numbers as scene_numbers
from fencejax.study import KINDS, OUTPUTS, VARIABLES, Samples, SceneFamily, Sweep, sampling

from ..common import assignments, flags, machine, named

# Cores that a machine may have.
_MOST_ON_A_MACHINE = 1024
_SAMPLINGS = ("grid", "latin_hypercube", "sobol")
# Where impacts are on the paper's fence [m].
_LINE = (0.5, 1.1)
_VARY = ("mass=1:30", "distance={}:{}".format(*_LINE))
_FENCES = {"two_link": fj.Fence, "one_link": fj.Fence.one_link}


@dataclasses.dataclass(frozen=True)
class SweepConfig:
    """Every number of the job; `python -m optimize.sweep --help` says what each is."""

    out: Path = flags.field(
        Path("out"),
        "folder for sweep.zarr, result.json and the figures; the same command resumes "
        "where it stopped",
    )
    scene: str = flags.field(
        "oblique_impact", f"kind of scene: {', '.join(KINDS)}", choices=tuple(KINDS)
    )
    vary: tuple[str, ...] = flags.field(
        _VARY,
        "what varies, as name, name=lower:upper, or name=lower:upper:points for a grid, each "
        "with :linear or :logarithmic behind if wanted; names: the scene's own and "
        f"{', '.join(VARIABLES)}. With a sorter file the default is the distance over the same "
        "shares of the reach as of the paper's fence",
        metavar="NAME=LOWER:UPPER",
    )
    sampling: str = flags.field(
        "grid", "kind of sample: grid, latin_hypercube or sobol", choices=_SAMPLINGS
    )
    points: int = flags.field(48, "points of a grid along each variable", least=2)
    count: int = flags.field(
        4096, "points of a Latin hypercube or, a power of two, of a Sobol sequence", least=1
    )
    seed: int = flags.field(0, "of their random numbers", least=0)
    sorter: str = machine.sorter_field()
    set: tuple[str, ...] = machine.set_field()
    fence: str = flags.field(
        "two_link", f"the fence that is changed: {', '.join(_FENCES)}", choices=tuple(_FENCES)
    )
    drive: str = named.drive_field()
    taper: str = named.taper_field()
    outputs: tuple[str, ...] = flags.field(
        ("peak_force", "tip_deflection"),
        f"what is kept, of {', '.join(OUTPUTS)}, {named.OWN} of a Measure",
        metavar="OUTPUT",
    )
    gradient: str = flags.field(
        "none", "output whose derivatives in all variables are kept too, or none"
    )
    duration: float = flags.field(0.0, "length of each scene [s]; 0: the scene's own", least=0)
    fidelity: str = flags.field("standard", "fidelity of the simulations", choices=flags.FIDELITIES)
    refine: bool = flags.field(
        True, "compute lanes in numerical doubt again, at finer fidelities"
    )
    chunk: int = flags.field(
        0, "lanes that a device or worker computes and stores at a time; 0: chosen", least=0
    )
    group: int = flags.field(0, "lanes that run through their loops together; 0: chosen", least=0)
    devices: int = flags.field(0, "devices that JAX makes of this CPU; 0: one a core", least=0)
    workers: int = flags.field(
        0,
        "processes of a Dask cluster on this machine that compute; 0: this process alone, with all "
        "its devices, which is as fast",
        least=0,
    )
    scheduler: str = flags.field(
        "none",
        "ADDRESS of a Dask scheduler whose workers compute, such as tcp://HOST:8786 (Slurm, "
        "Kubernetes: Dask's own packages), or none",
    )
    tolerated: float = flags.field(
        0.25, "share of lanes without good numbers that still counts as success [1]"
    )
    plots: bool = flags.field(True, "draw the figures")

    def __post_init__(self):
        flags.check(self)
        for name in ("devices", "workers"):
            if getattr(self, name) > _MOST_ON_A_MACHINE:
                raise ValueError(
                    f"Argument `{name}` must be at most {_MOST_ON_A_MACHINE}, but is "
                    f"{getattr(self, name)}: one a core serves best."
                )
        if self.workers and self.scheduler != "none":
            raise ValueError(
                "Argument `workers` starts a Dask cluster on this machine and must be 0 where "
                f"`scheduler` names another one, but is {self.workers}. Leave one of them out."
            )
        machine.only_without(self, "fence", "drive", "taper")
        if not 0 <= self.tolerated <= 1:
            raise ValueError(
                f"Argument `tolerated` must be within 0 ... 1 [1], but is {self.tolerated:g}."
            )

    @property
    def machine(self) -> fj.sorter.Machine | None:
        """The sorter that is named, if any, with those settings that are made in it."""
        if self.sorter == machine.NONE:
            return None
        own, _ = machine.parted(self.sorter, self.scene, self.set)
        return machine.once(self.sorter, own)

    @property
    def notes(self) -> list[str]:
        """The choices of the sorter that is named where nothing else is set, a line each."""
        sorter = self.machine
        if sorter is None:
            return []
        parts = sorter.family(kind=self.scene).parts
        names = [text.partition("=")[0].strip() for text in (*self.set, *self.varied)]
        given = {
            scene_numbers.resolve(parts, name) for name in names if scene_numbers.has(parts, name)
        }
        left = {
            path: values for path, values in sorter.choices.items()
            if fj.sorter.scene_path(path) not in given
        }  # fmt: skip
        lines = machine.notes(dataclasses.replace(sorter, choices=left))
        if sorter.parcels.count > 1:
            lines.append(
                f"the parcel is the first of the sorter's {sorter.parcels.count}, apart from what "
                "varies or is set; for another write --set or --vary with its numbers, such as "
                "mass and length"
            )
        return lines

    @property
    def varied(self) -> tuple[str, ...]:
        """What varies: as given, or by default of a sorter the distance along its own fence."""
        sorter = self.machine
        if sorter is None or self.vary != _VARY:
            return self.vary
        lower, upper = (machine.place(float(sorter.fence.reach), end) for end in _LINE)
        return _VARY[0], f"distance={lower}:{upper}"

    def samples(self) -> Samples:
        """The points.

        Raises `ValueError` where `vary` cannot be read, or names a number without bounds.
        """
        texts = self.varied
        read = [_variable(text) for text in texts]
        variables = [variable for variable, _ in read]
        if self.sampling == "grid":
            counts = [self.points if count is None else count for _, count in read]
            return sampling.grid(variables, counts)
        for text, (_, count) in zip(texts, read, strict=True):
            if count is not None:
                raise ValueError(
                    f"Argument `vary` must not give points a variable for {self.sampling}, but "
                    f"holds {text!r}. The number of points is --count."
                )
        lay = sampling.sobol if self.sampling == "sobol" else sampling.latin_hypercube
        return lay(variables, self.count, self.seed)

    def sweep(self) -> Sweep:
        """The sweep that this describes.

        Raises `ValueError` for names and bounds that the scene does not have.
        """
        samples = self.samples()
        duration = self.duration or None
        if self.sorter != machine.NONE:
            family = machine.family(self.sorter, self.scene, samples.names, self.set, duration)
        else:
            fixed = [machine.numbers("set", text) for text in self.set]
            family = SceneFamily(
                self.scene,
                samples.names,
                fixed={name: number for one in fixed for name, number in one.items()},
                fence=_FENCES[self.fence](taper=named.taper(self.taper)),
                drive=named.drive(self.drive),
                duration=duration,
            )
        texts = (*self.outputs, *(() if self.gradient == "none" else (self.gradient,)))
        own = {text: named.measure("outputs", text) for text in texts if ":" in text}
        names = [own[text].name if text in own else text for text in texts]
        return Sweep(
            family,
            samples,
            names,
            None if self.gradient == "none" else names[-1],
            getattr(fj.Fidelity, self.fidelity)(),
            tuple({measure.name: measure for measure in own.values()}.values()),
            self.refine,
        )

    def quick(self) -> "SweepConfig":
        """A small version: a few hundred points at the fast fidelity."""
        return dataclasses.replace(
            self, points=min(self.points, 16), count=min(self.count, 256), fidelity="fast"
        )

    @property
    def local_devices(self) -> int:
        """Devices on the CPU: one a core that this process may use."""
        if self.devices:
            return self.devices
        if hasattr(os, "sched_getaffinity"):
            return len(os.sched_getaffinity(0))
        return os.cpu_count() or 1


def _variable(text: str) -> tuple[DesignVariable, int | None]:
    """A variable, and its number of points on a grid where given, from
    name[=lower:upper[:points][:linear|logarithmic]]."""
    name, _, given = text.partition("=")
    if not given:
        return sampling.variable(name), None
    form = "read name[=lower:upper[:points][:linear|logarithmic]]"
    _, lower, upper, rest = assignments.span("vary", text, form)
    scaling = rest.pop() if rest and rest[-1] in ("linear", "logarithmic") else None
    try:
        (count,) = [int(word) for word in rest] or [None]
    except ValueError as error:
        raise assignments.refusal("vary", text, form) from error
    return sampling.variable(name, lower, upper, scaling=scaling), count


configure = flags.reader(
    SweepConfig,
    "optimize.sweep",
    "Compute scenes over a grid, a Latin hypercube or a Sobol sequence, on every "
    "device of this machine or on a Dask cluster, resumably.",
    quick="at most 16 points an axis, or 256 in all, at the fast fidelity",
)
