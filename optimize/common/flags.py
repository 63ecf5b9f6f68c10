"""A flag for each field of a job's configuration, and checks that several jobs make."""

import argparse
import dataclasses
import inspect
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

_T = TypeVar("_T")
FIDELITIES = ("coarse", "fast", "standard", "reference")


def parser(
    configuration: type,
    prog: str,
    description: str,
    explained: Mapping[str, str],
    special: Mapping[str, dict[str, Any]],
    quick: str | None = None,
) -> argparse.ArgumentParser:
    """Flags for the fields of a dataclass, with their defaults.

    **Arguments:**

    - `configuration`: the dataclass; every field has a default, which says the flag's type.
    - `explained`: the help of each field.
    - `special`: settings of `add_argument`, by field, where they do not follow from the default.
    - `quick`: the help of `--quick`, if there is such a flag.
    """
    result = argparse.ArgumentParser(
        prog=f"python -m {prog}",
        description=description,
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    for field in dataclasses.fields(configuration):
        default = field.default
        settings: dict[str, Any] = {"default": default, "help": explained[field.name]}
        if isinstance(default, bool):
            settings["action"] = argparse.BooleanOptionalAction
        elif isinstance(default, tuple):
            settings["nargs"] = "+"
            if default:
                settings["type"] = type(default[0])
        else:
            settings["type"] = Path if isinstance(default, Path) else type(default)
        settings.update(special.get(field.name, {}))
        result.add_argument("--" + field.name.replace("_", "-"), **settings)
    if quick is not None:
        result.add_argument("--quick", action="store_true", help=quick)
    return result


def read(flags: argparse.ArgumentParser, arguments: Sequence[str] | None) -> dict[str, Any]:
    """What is given, by field; lists as tuples."""
    given = vars(flags.parse_args(arguments))
    return {k: tuple(v) if isinstance(v, list) else v for k, v in given.items()}


def configured(
    flags: argparse.ArgumentParser, configuration: type[_T], arguments: Sequence[str] | None
) -> _T:
    """The configuration that flags describe.

    A switch that is no field of the dataclass, such as `--quick`, has the name of one of its
    methods, which makes another configuration of this one.

    Raises `ValueError` where a number is out of range.
    """
    given = read(flags, arguments)
    fields = inspect.signature(configuration).parameters
    switches = [name for name in given if name not in fields]
    wanted = [name for name in switches if given.pop(name)]
    result = configuration(**given)
    for name in wanted:
        result = getattr(result, name)()
    return result


def at_least(configuration: Any, **bounds: int) -> None:
    """Raise `ValueError` where a field is below its bound."""
    for name, least in bounds.items():
        value = getattr(configuration, name)
        if value < least:
            raise ValueError(f"Argument `{name}` must be at least {least} [1], but is {value}.")


def one_of(name: str, value: str, options: tuple[str, ...]) -> None:
    """Raise `ValueError` where a name is none of the options."""
    if value not in options:
        raise ValueError(f"Argument `{name}` must be one of {options}, but is {value!r}.")
