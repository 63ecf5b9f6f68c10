"""The sorter of a job, from its flags: a file, numbers set, numbers freed."""

import dataclasses
import functools
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import fencejax as fj
from fencejax.scenes import AnyScene, names, numbers as scene_numbers
from fencejax.sorter import SECTIONS, amount, span, value

from . import designs, flags, named

Overrides = dict[str, Any]
NONE = "none"
SORTERS = Path(__file__).parents[1] / "sorters"
"""The sorter files that come with the jobs."""


def shipped() -> str:
    """The names of the sorter files that come with the jobs."""
    return ", ".join(sorted(path.stem for path in SORTERS.glob("*.toml")))


def sorter_field(default: str = NONE) -> str:
    """The field of a configuration that names a sorter file."""
    text = f"sorter file (TOML), or one that comes with the jobs: {shipped()}"
    text += f"; {NONE}: the job's own numbers" if default == NONE else ""
    return flags.field(default, text, metavar="FILE")


def set_field() -> tuple[str, ...]:
    """The field of a configuration that sets numbers."""
    text = "numbers that differ, as NAME=VALUE: belt.speed=2.5, thickness='45 mm' (SI or a unit)"
    return flags.field((), text, nargs="*", metavar="NAME=VALUE")


def free_field() -> tuple[str, ...]:
    """The field of a configuration that frees numbers."""
    text = "what is designed, as NAME=LOWER:UPPER: fence.thickness=4mm:90mm (SI or a unit)"
    return flags.field((), text, nargs="*", metavar="NAME=LOWER:UPPER")


def pairs(field: str, texts: tuple[str, ...]) -> dict[str, str]:
    """`NAME=VALUE` as names with texts.

    Raises `ValueError` where one has no `=`, or a name comes twice.
    """
    found: dict[str, str] = {}
    for text in texts:
        name, equals, rest = text.partition("=")
        name = name.strip()
        if not equals or not name or not rest.strip() or name in found:
            raise ValueError(
                f"Argument `{field}` must hold each name once as NAME=VALUE, but holds {text!r}."
            )
        found[name] = rest
    return found


def file_of(sorter: str) -> Path:
    """The sorter file of a name.

    Raises `ValueError` for a name that is neither a file's nor one of those that come with the
    jobs.
    """
    path, own = Path(sorter), SORTERS / f"{sorter}.toml"
    if path.suffix or path.exists():
        return path
    if not own.exists():
        raise ValueError(
            f"Argument `sorter` must be a file or one of {shipped()}, but is {sorter!r}."
        )
    return own


def load(
    sorter: str, given: tuple[str, ...] = (), free: tuple[str, ...] = ()
) -> fj.Sorter:
    """The sorter of a file, or of one that comes with the jobs, with numbers set and freed.

    Raises `ValueError` and `TypeError` for what cannot be read, and for implausible numbers.
    """
    path = file_of(sorter)
    spans: Overrides = {name: span(text) for name, text in pairs("free", free).items()}
    values: Overrides = {name: value(text) for name, text in pairs("set", given).items()}
    try:
        return _plausible(path, values, spans)
    except (ValueError, TypeError) as error:
        flag = _at_fault(path, values, spans)
        if flag is None:
            raise
        kind = TypeError if isinstance(error, TypeError) else ValueError
        raise kind(f"{flag}: {str(error).removeprefix(f'{path}: ')}") from error


def _plausible(path: Path, values: Overrides, spans: Overrides) -> fj.Sorter:
    """The sorter of a file; implausible numbers are refused."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fj.sorter.ImplausibleNumberWarning)
        found = fj.Sorter.load(path, set=values, free=spans)
    if found.doubts:
        raise ValueError(f"{path}: " + " ".join(found.doubts))
    return found


def _at_fault(path: Path, values: Overrides, spans: Overrides) -> str | None:
    """The flag because of which a sorter is refused; `None` where its file is the cause."""
    for flag, given in (("--free", values), ("--set", {})):
        try:
            _plausible(path, given, {})
        except (ValueError, TypeError):
            continue
        return flag
    return None


def numbers(field: str, text: str, scene: AnyScene | None = None) -> dict[str, float]:
    """`"distance=0.9,mass=12 kg"` as numbers [SI] by name, of a scene or of the table of names.

    Raises `ValueError` where one cannot be read or is implausible.
    """
    found = {}
    for name, raw in pairs(field, tuple(text.split(","))).items():
        if scene is not None and scene_numbers.has(scene, name):
            number = scene_numbers.number(scene, name)
        else:
            number = names.known(name)
        unit = "1" if number is None else number.unit
        found[name] = amount(name, raw, unit)
        path = name if number is None else number.path
        doubt = fj.sorter.doubt(path, found[name], unit)
        if doubt is not None:
            raise ValueError(f"Argument `{field}`: {doubt}")
    return found


def family(
    sorter: str, kind: str, varied: Sequence[str], given: tuple[str, ...],
    duration: float | None = None,
) -> fj.SceneFamily:  # fmt: skip
    """Scenes of a sorter in which some numbers vary and others are set; an impact for which no
    distance is given is at `place`. Settings that are no number of a scene, such as
    `fence.material=POM`, are made in the sorter."""
    own, others = parted(sorter, kind, given)
    machine = once(sorter, own)
    parts = machine.family(kind=kind).parts
    fixed = {}
    for text in others:
        fixed |= numbers("set", text, parts)
    return machine.family(
        tuple(varied), kind=kind, fixed=_placed(parts, fixed, varied), duration=duration
    )


def parted(
    sorter: str, kind: str, given: tuple[str, ...]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Settings as those made in the sorter, and those of numbers of its scenes."""
    parts = once(sorter).family(kind=kind).parts
    own = []
    for text in given:
        name = text.partition("=")[0].strip()
        if name.partition(".")[0] in SECTIONS and not scene_numbers.has(parts, name):
            own.append(text)
    return tuple(own), tuple(text for text in given if text not in own)


def _placed(parts: Any, fixed: dict[str, float], varied: Sequence[str] = ()) -> dict[str, float]:
    """Fixed numbers of an impact, with its distance where neither they nor those that vary have
    it. `parts`: those of a `fencejax.SceneFamily`."""
    if not scene_numbers.has(parts, "distance"):
        return fixed
    known = [name for name in (*fixed, *varied) if scene_numbers.has(parts, name)]
    distance = scene_numbers.resolve(parts, "distance")
    if distance in [scene_numbers.resolve(parts, name) for name in known]:
        return fixed
    changes = {name: value for name, value in fixed.items() if name in known}
    fence = scene_numbers.replace(parts, tuple(changes), list(changes.values())).fence
    return {**fixed, "distance": place(float(fence.reach))}


PAPER_REACH, PAPER_PLACE = 1.2, 1.0
"""The reach of the paper's fence, and where its impacts are [m]."""


def place(reach: float, of_paper: float = PAPER_PLACE) -> float:
    """The distance [m] on a fence of that reach [m] that is the same share of it as one `of_paper`
    [m] is of the paper's, to 3 digits."""
    return float(f"{of_paper * reach / PAPER_REACH:.3g}")


def scene(sorter: str, kind: str, duration: float | None = None) -> AnyScene:
    """A scene of a sorter's parts: of a kind of `fencejax.SceneFamily`, then an impact at `place`,
    or of the normal direction alone."""
    machine = once(sorter)
    if kind in ("normal_impact", "rigid_wall"):
        parts = {"fence": machine.fence} if kind == "normal_impact" else {}
        parcel = machine.family(kind="oblique_impact").parcel
        return getattr(fj.scenes, kind)(parcel=parcel, duration=duration, **parts)
    fixed = _placed(machine.family(kind=kind).parts, {})
    return machine.family(kind=kind, fixed=fixed, duration=duration).scene(np.zeros(0))


def only_without(config: Any, *fields: str) -> None:
    """Refuse fields that the sorter file replaces.

    Raises `ValueError` where a sorter file is named and one of them is not at its default.
    """
    defaults = {field.name: field.default for field in dataclasses.fields(config)}
    for name in fields:
        if config.sorter != NONE and getattr(config, name) != defaults[name]:
            flag = name.replace("_", "-")
            raise ValueError(
                f"Argument `{name}` must be left out where a sorter file is given, which says it, "
                f"but is {getattr(config, name)!r}. Leave out --{flag}, or set the number by --set."
            )


def chosen(config: Any) -> fj.sorter.Machine | None:
    """The machine of a configuration with `sorter`, `set` and `free`; `None` where it names none
    and changes none of the paper's numbers."""
    if config.sorter == NONE:
        if config.set:
            raise ValueError(
                "Argument `set` must come with a sorter file, but there is none. Write "
                "--sorter paper for the paper's machine."
            )
        return None
    free = tuple(text for text in config.free if not _of_job(config, text))
    return once(config.sorter, config.set, free)


def _of_job(config: Any, text: str) -> bool:
    """Whether a freed number belongs to a drive that the job designs, not to the sorter's."""
    known = names.known(text.partition("=")[0].strip())
    return getattr(config, "designs_drive", False) and known is not None and _of_drive(known.path)


def _bounds(texts: tuple[str, ...]) -> designs.Bounds:
    """Names with lower and upper bound [SI], of `NAME=LOWER:UPPER`."""
    found = []
    for name, text in pairs("free", texts).items():
        name, ends = fj.sorter.scene_path(name), span(text)
        known = names.known(name)
        unit = "1" if known is None else known.unit
        lower, upper = (amount(f"{name}.{end}", ends[end], unit) for end in ("lower", "upper"))
        found.append((name, lower, upper))
    return tuple(found)


def notes(machine: fj.sorter.Machine | None) -> list[str]:
    """The choices of a sorter that a job for a single one of them uses, a line each."""
    if machine is None:
        return []
    first, *others = (sheet.name for sheet in machine.materials)
    lines = [f"the fence is of {first}"]
    if others:
        lines[0] += (
            f", the first of the sorter's {1 + len(others)} materials; for another write "
            f"--set fence.material={others[0]!r}, for all of them python -m optimize.design"
        )
    for path, values in machine.choices.items():
        lines.append(
            f"{path} is {values[0]:g}, the first of the sorter's list; for another write "
            f"--set {path}={values[1]:g}"
        )
    return lines


def once(
    sorter: str, given: tuple[str, ...] = (), free: tuple[str, ...] = ()
) -> fj.sorter.Machine:
    """The machine of `load`, read once: a job also asks for it while tracing, where numbers must be
    plain."""
    return _machine(sorter, given, free, file_of(sorter).stat().st_mtime_ns)


@functools.lru_cache(maxsize=16)
def _machine(
    sorter: str, given: tuple[str, ...], free: tuple[str, ...], changed: int
) -> fj.sorter.Machine:
    del changed
    return load(sorter, given, free).machine


def limits(
    jobs: tuple[fj.Limit, ...], machine: fj.sorter.Machine | None, without: tuple[str, ...] = (),
    sorts: bool = True,
) -> tuple[fj.Limit, ...]:  # fmt: skip
    """A job's limits, replaced by and extended with those of a machine's table of limits, `without`
    some of its rows and, unless the job's scenes are whole `sorts`, without those of `unheld`."""
    if machine is None:
        return jobs
    for row, _ in machine.bounds:
        if row.over == "mean" and not row.asked:
            raise ValueError(
                f"Argument `limits.{row.name}` must be left out for this job, as it bounds a mean "
                "over the parcels. Write python -m optimize.design, or --set "
                f"limits.{row.name}=false."
            )
    without = (*without, *(() if sorts else unheld(machine)))
    own = [limit for name, limit in _given_limits(machine) if name not in without]
    names = {limit.name for limit in own}
    return (*(limit for limit in jobs if limit.name not in names), *own)


_OF_WHOLE_SORTS = (
    "clear_period", "crossing_time", "ring_amplitude", "rms_torque", "drive_work", "net_work",
)  # fmt: skip


def unheld(machine: fj.sorter.Machine) -> tuple[str, ...]:
    """The names of a machine's limits that bound the end of a whole sort, or a sum over it, and
    not a single impact."""
    found = _given_limits(machine)
    return tuple(name for name, limit in found if limit.quantity.name in _OF_WHOLE_SORTS)


def unheld_notes(machine: fj.sorter.Machine) -> list[str]:
    """What a job that designs for single impacts says of those limits; a line, if there are any."""
    names = [f"limits.{name}" for name in unheld(machine)]
    if not names:
        return []
    them = "them" if len(names) > 1 else "it"
    off = " ".join(f"{name}=false" for name in names)
    return [
        f"NOT held, as the job designs for single impacts and whole sorts alone can be bounded so: "
        f"{', '.join(names)}; python -m optimize.design holds {them}, and --set {off} switches "
        f"{them} off"
    ]


def _given_limits(machine: fj.sorter.Machine) -> tuple[tuple[str, fj.Limit], ...]:
    """The limits that a machine's table gives, for its first material, by name."""
    given = [(row, bound) for row, bound in machine.bounds if bound is not None or _named(row)]
    return fj.sorter.settled(given, machine, machine.materials[0])


_OWN = ("stress", "torque")


def _named(row: fj.sorter.LimitRow) -> bool:
    """Whether a limit with its usual bound applies: that of the material or the motor, or one that
    the sorter names."""
    usual = fj.sorter.LIMIT_ROWS.get(row.name)
    return row.name in _OWN or (usual is not None and usual.asked and not row.asked)


def space(
    config: Any, machine: fj.sorter.Machine | None, drive: fj.AbstractDrive | None = None,
    default: designs.Bounds = (),
) -> fj.DesignSpace:  # fmt: skip
    """The design space of a job over the machine's fence and drive: the machine's free numbers or,
    where there are none, the job's own variables. With another `drive`, which the job designs, it
    is the free numbers of the fence and the job's own variables of that drive."""
    if machine is None:
        fence = fj.Fence(taper=named.taper(config.taper))
        drive = named.drive(config.drive) if drive is None else drive
        return designs.space(config.variables, _bounds(config.free), fence, drive, default)
    free = machine.free
    if drive is not None:
        free = {path: span for path, span in free.items() if not path.startswith("drive.")}
    own = config.variables
    if free:
        known = {name: names.known(name) for name in own}
        moved = [name for name, number in known.items() if number and _of_drive(number.path)]
        own = (*map(fj.sorter.scene_path, free), *(moved if drive is not None else ()))
    spans = tuple((fj.sorter.scene_path(p), s.lower, s.upper) for p, s in free.items())
    drive = machine.drive if drive is None else drive
    given = _bounds(tuple(text for text in config.free if _of_job(config, text)))
    return designs.space(own, given, machine.fence, drive, (*default, *spans))


def _of_drive(path: str) -> bool:
    return path.startswith("drive.")
