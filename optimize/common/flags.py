"""Fields of a configuration: each is defined once, with its default, the help of its flag and its
requirements. The parser and the checks follow from that definition."""

import argparse
import dataclasses
import difflib
import functools
import json
import math
import operator
import os
import re
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn, TypeVar

_T = TypeVar("_T")
FIDELITIES = ("coarse", "fast", "standard", "reference")
_CHECKED = {
    "least": ("at least", operator.ge),
    "above": ("above", operator.gt),
    "between": ("within", lambda value, ends: ends[0] < value < ends[1]),
}


def field(value: _T, text: str, **settings: Any) -> _T:
    """A field of a configuration, a frozen dataclass.

    **Arguments:**

    - `value`: its default, whose type is the flag's; of a tuple, that of its first element.
    - `text`: the help of the flag, with the unit in brackets.
    - `settings`: `least`, `above`, `between` (an open interval) and `choices`, which `check`
      requires of the value or of every element of a tuple; and settings of `add_argument` that do
      not follow from the default.
    """
    made: Any = dataclasses.field(default=value, metadata={"help": text, **settings})
    return made


# The least memory of each counted thing [bytes]: of a parcel with its measured numbers and their
# derivatives, an evaluation, or a point of a front.
_EACH = 1024


def _memory() -> float:
    """The memory [bytes] of this machine; infinite where the system does not report it. Determined
    here, without the package, as the help is printed before any slow import."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return float("inf")


def check(configuration: Any) -> None:
    """Raise `ValueError` where a field violates a requirement of `field`, is not finite, or is a
    count for which this machine lacks the memory."""
    for each in dataclasses.fields(configuration):
        value, asked = getattr(configuration, each.name), each.metadata
        unit = re.search(r"\[([^\]]+)\]", asked["help"])
        for one in value if isinstance(value, tuple) else (value,):
            if "choices" in asked:
                one_of(each.name, one, tuple(asked["choices"]))
            if isinstance(one, float) and not math.isfinite(one):
                raise ValueError(
                    f"Argument `{each.name}` must be finite [{unit[1] if unit else 1}], but is "
                    f"{one:g}."
                )
            for setting, (word, holds) in _CHECKED.items():
                if setting in asked and not holds(one, asked[setting]):
                    ends = asked[setting] if setting == "between" else (asked[setting],)
                    raise ValueError(
                        f"Argument `{each.name}` must be {word} "
                        f"{' and '.join(f'{end:g}' for end in ends)} [{unit[1] if unit else 1}], "
                        f"but is {one:g}."
                    )
            # An integer with a least value is a count, unless it is a seed.
            counts = type(one) is int and "least" in asked and each.name != "seed"
            if counts and one * _EACH > _memory():
                raise ValueError(
                    f"Argument `{each.name}` must be at most {_memory() / _EACH:,.0f}, for which "
                    f"this machine has the memory, but is {one:.3g}."
                )


def one_of(name: str, value: str, options: tuple[str, ...]) -> None:
    """Raise `ValueError` where a name is none of the options."""
    if value not in options:
        raise ValueError(f"Argument `{name}` must be one of {options}, but is {value!r}.")


class Parser(argparse.ArgumentParser):
    """A parser that refuses in one line: the error, and the nearest flag."""

    def error(self, message: str) -> NoReturn:
        unknown = message.partition("unrecognized arguments: ")[2].split()
        wrong = next((word.partition("=")[0] for word in unknown if word.startswith("-")), None)
        if unknown and wrong is None:
            message = f"{' '.join(unknown)} belongs to no flag"
        elif wrong is not None:
            flags = [flag for flag in self._option_string_actions if flag.startswith("--")]
            near = difflib.get_close_matches(wrong[2:], [flag[2:] for flag in flags], 1, 0.5)
            meant = f" Did you mean --{near[0]}?" if near else ""
            message = f"there is no flag {wrong}.{meant}"
        end = "" if message.endswith((".", "?")) else "."
        self.exit(2, f"{self.prog}: {message}{end} All flags: --help\n")


def described(
    configuration: type, prog: str, description: str, **switches: str
) -> dict[str, Any]:
    """The description of a parser for `parser`, as plain JSON values: a flag for each field of a
    configuration and for each switch, with its help."""
    flags = []
    for each in dataclasses.fields(configuration):
        default = each.default
        settings: dict[str, Any] = {}
        if isinstance(default, bool):
            settings["action"] = "yes or no"
        elif isinstance(default, tuple):
            settings["nargs"] = "+"
            if default:
                settings["type"] = type(default[0]).__name__
        else:
            settings["type"] = "Path" if isinstance(default, Path) else type(default).__name__
        settings |= {k: v for k, v in each.metadata.items() if k not in _CHECKED}
        if isinstance(settings.get("type"), type):
            settings["type"] = settings["type"].__name__
        if not (default == () and "by default" in settings["help"]):
            settings["help"] += _default_text(default)
        flags.append(["--" + each.name.replace("_", "-"), settings])
    for name, text in switches.items():
        switch = {"action": "store_true", "help": text + _default_text(False)}
        flags.append(["--" + name.replace("_", "-"), switch])
    # Tuples become lists, as they do in a file.
    return json.loads(json.dumps({"prog": prog, "description": description, "flags": flags}))


_TYPES = {"int": int, "float": float, "str": str, "Path": Path}


def parser(description: dict[str, Any]) -> argparse.ArgumentParser:
    """The parser of a description by `described`. It sets no defaults."""
    result = Parser(prog=f"python -m {description['prog']}", description=description["description"])
    for flag, settings in description["flags"]:
        made = dict(settings)
        if made.get("action") == "yes or no":
            made["action"] = argparse.BooleanOptionalAction
        if "type" in made:
            made["type"] = _TYPES[made["type"]]
        if isinstance(made.get("metavar"), list):
            # A name for each value; of a list argparse makes one name.
            made["metavar"] = tuple(made["metavar"])
        result.add_argument(flag, **made)
    return result


def _default_text(default: Any) -> str:
    """A default as it is written after its flag."""
    if isinstance(default, bool):
        default = "yes" if default else "no"
    words = map(str, default or ("none",)) if isinstance(default, tuple) else (str(default),)
    return f" (default: {' '.join(words)})".replace("%", "%%")


DESCRIPTION = "flags.json"
"""The file in a job's folder with the result of `described`, by `python tests/job_flags.py`."""


def answer(command: Sequence[str]) -> None:
    """Where a command line of Python asks for a job's help, print it and exit, before the job's
    slow imports."""
    jobs = [k for k, word in enumerate(command) if word == "-m"][:1]
    words = command[jobs[0] + 1 :] if jobs else []
    if not {"-h", "--help"} & set(words[1:]):
        return
    file = Path(__file__).parents[1] / words[0].rpartition(".")[2] / DESCRIPTION
    if file.exists():
        parser(json.loads(file.read_text())).parse_args(["--help"])


_ABSENT = object()


def given(flags: argparse.ArgumentParser, arguments: Sequence[str] | None) -> dict[str, Any]:
    """The fields that the arguments set, without those left at their default; lists as tuples."""
    # argparse sets no default where the namespace has a value.
    absent = {action.dest: _ABSENT for action in flags._actions if action.dest != "help"}
    found = vars(flags.parse_args(arguments, argparse.Namespace(**absent)))
    return {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in found.items()
        if value is not _ABSENT
    }


def reader(
    configuration: type[_T], prog: str, description: str, **switches: str
) -> Callable[..., _T]:
    """The function from the arguments of the command line, by default the program's own, to the
    configuration that they describe.

    A switch, such as `--quick`, has the name of a method of the configuration, which makes another
    one of it. What a flag says goes before what a switch does. The function raises `ValueError`
    where a number is out of range.
    """

    text = functools.partial(described, configuration, prog, description, **switches)

    def configure(arguments: Sequence[str] | None = None) -> _T:
        values = given(parser(text()), arguments)
        wanted = [name for name in switches if values.pop(name, False)]
        # Nothing is checked before it is complete.
        made = object.__new__(configuration)
        fields: tuple[dataclasses.Field, ...] = dataclasses.fields(configuration)  # pyright: ignore
        vars(made).update({each.name: each.default for each in fields} | values)
        for name in wanted:
            made = getattr(made, name)()
        return configuration(**(vars(made) | values))

    configure.described = text  # pyright: ignore
    return configure


def command(configuration: Any, prog: str) -> str:
    """The command line that gives a configuration, with a flag for each field that is not at its
    default, and the folder."""
    words = ["python", "-m", prog]
    for each in dataclasses.fields(configuration):
        value, name = getattr(configuration, each.name), each.name.replace("_", "-")
        if value == each.default and each.name != "out":
            continue
        if isinstance(value, bool):
            words.append(f"--{name}" if value else f"--no-{name}")
        else:
            values = value if isinstance(value, tuple) else (value,)
            words += [f"--{name}", *(shlex.quote(str(one)) for one in values)]
    return " ".join(words)
