"""Drives, tapers, quantities and limits named by flags: the package's own by their names, a user's
as `module:Name`, from any module that Python can import."""

import importlib
from collections.abc import Mapping
from typing import Any, TypeVar

import fencejax as fj
from fencejax import parts
from fencejax.design import LIMITS, OBJECTIVES, Limit, Quantity

from . import flags

_T = TypeVar("_T")
# Drives with a given motion and defaults for all arguments.
DRIVES = {
    name: law
    for name, law in parts.DRIVES.items()
    if law is not fj.SplineDrive and not issubclass(law, fj.AbstractTorqueDrive)
}
TAPERS = {name: parts.TAPERS[name] for name in ("constant_strength", "uniform")}
OWN = "or your own as module:Name"


def drive(text: str) -> fj.AbstractDrive:
    """A drive by name, with its default numbers, or `module:Name` of a drive or of a callable
    that returns one without arguments, such as its class.

    Raises `ValueError` where there is no such module or name, or it is no drive.
    """
    return _found("drive", text, DRIVES, fj.AbstractDrive)


def taper(text: str) -> fj.AbstractTaper:
    """A taper, as `drive`."""
    return _found("taper", text, TAPERS, fj.AbstractTaper)


def quantity(flag: str, text: str, known: Mapping[str, Quantity] = OBJECTIVES) -> Quantity:
    """A quantity of a result by name, of `known`, or `module:Name` of one; errors as of `drive`."""
    return _found(flag, text, known, Quantity)


def measure(flag: str, text: str) -> fj.Measure:
    """A measure of a user's own, `module:Name`; errors as of `drive`."""
    return _found(flag, text, {}, fj.Measure)


def limits(jobs: tuple[Limit, ...], texts: tuple[str, ...]) -> tuple[Limit, ...]:
    """A job's limits and those of `texts`, by name with their default bounds or `module:Name`; of
    the same quantity these take the place of the job's. Errors as of `drive`.

    Raises `ValueError` where two of `texts` limit the same quantity.
    """
    others = tuple(_found("limit", text, LIMITS, Limit) for text in texts)
    names = [limit.name for limit in others]
    if len(set(names)) < len(names):
        raise ValueError(f"Argument `limit` must limit each quantity once, but limits {names}.")
    return (*(limit for limit in jobs if limit.name not in names), *others)


def drive_field() -> str:
    """The field of a configuration that names a drive."""
    return flags.field("harmonic", f"the drive: {', '.join(DRIVES)}, {OWN}", metavar="DRIVE")


def taper_field() -> str:
    """The field of a configuration that names a taper."""
    text = f"thickness of the flexible link along it: {', '.join(TAPERS)}, {OWN}"
    return flags.field("constant_strength", text, metavar="TAPER")


def objective_field() -> str:
    """The field of a configuration that names the objective."""
    text = f"what is minimised, the largest over the impacts: {', '.join(OBJECTIVES)}, {OWN}"
    return flags.field("peak_force", text, metavar="QUANTITY")


def limit_field() -> tuple[str, ...]:
    """The field of a configuration that names further limits."""
    text = (
        f"further limits, or others of the same quantities: {', '.join(LIMITS)} with their default "
        f"bounds, {OWN}"
    )
    return flags.field((), text, nargs="*", metavar="LIMIT")


def _found(flag: str, text: str, known: Mapping[str, Any], kind: type[_T]) -> _T:
    if text in known:
        found = known[text]
    elif ":" in text:
        found = _imported(flag, text)
    else:
        raise ValueError(
            f"Argument `{flag}` must be one of {tuple(known)} or module:Name, but is {text!r}."
        )
    if isinstance(found, kind):
        return found
    refusal = (
        f"Argument `{flag}` must name an instance of {kind.__name__}, or what makes one, but "
        f"{text!r}"
    )
    if not callable(found):
        raise ValueError(f"{refusal} is a {type(found).__name__}.")
    if isinstance(found, type) and not issubclass(found, kind):
        raise ValueError(f"{refusal} makes a {found.__name__}.")
    try:
        made = found()
    except TypeError as error:
        raise ValueError(f"{refusal} cannot be called without arguments: {error}.") from error
    if not isinstance(made, kind):
        raise ValueError(f"{refusal} makes a {type(made).__name__}.")
    return made


def _imported(flag: str, text: str) -> Any:
    """The object named `module:Name`."""
    module, _, name = text.partition(":")
    try:
        owner = importlib.import_module(module)
    except (ImportError, TypeError, ValueError) as error:
        raise ValueError(
            f"Argument `{flag}` must name a module that Python can import, but {text!r} does not: "
            f"{error}. Run from the module's folder, or add that to PYTHONPATH."
        ) from error
    if not hasattr(owner, name):
        there = [each for each in vars(owner) if not each.startswith("_")]
        raise ValueError(
            f"Argument `{flag}` must name something of the module {module!r}, but {text!r} does "
            f"not. It has {', '.join(there)}."
        )
    return getattr(owner, name)
