"""The sorter that a job is for, as flags name it: a file, numbers set, numbers freed."""

import warnings
from pathlib import Path
from typing import Any

import fencejax as fj
from fencejax.sorter import span, value

from . import flags

NONE = "none"
SORTERS = Path(__file__).parents[1] / "sorters"
"""The sorter files that come with the jobs."""


def sorter_field(default: str = NONE) -> str:
    """The field of a configuration that names a sorter file."""
    known = ", ".join(sorted(path.stem for path in SORTERS.glob("*.toml")))
    text = f"sorter file (TOML), or one that comes with the jobs: {known}"
    text += f"; {NONE}: the job's own numbers" if default == NONE else ""
    return flags.field(default, text, metavar="FILE")


def set_field() -> tuple[str, ...]:
    """The field of a configuration that sets numbers."""
    text = "numbers that differ, as NAME=VALUE: belt.speed=2.5, thickness='45 mm' (SI or a unit)"
    return flags.field((), text, nargs="*", metavar="NAME=VALUE")


def free_field() -> tuple[str, ...]:
    """The field of a configuration that frees numbers."""
    text = "what is designed, as NAME=LOWER:UPPER: fence.thickness=4mm:90mm; both alike: fixed"
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


def load(
    sorter: str, given: tuple[str, ...] = (), free: tuple[str, ...] = ()
) -> fj.Sorter:
    """The sorter of a file, or of one that comes with the jobs, with numbers set and freed.

    Raises `ValueError` and `TypeError` for what cannot be read, and for numbers that no such
    machine has.
    """
    path = Path(sorter)
    if not path.suffix and not path.exists():
        path = SORTERS / f"{sorter}.toml"
    spans: dict[str, Any] = {name: span(text) for name, text in pairs("free", free).items()}
    values = {name: value(text) for name, text in pairs("set", given).items()}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fj.sorter.ImplausibleNumberWarning)
        found = fj.Sorter.load(path, set=values, free=spans)
    if found.doubts:
        raise ValueError(f"{path}: " + " ".join(found.doubts))
    return found
