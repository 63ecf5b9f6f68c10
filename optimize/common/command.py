"""A script run as a program: flags in, an exit status out."""

import operator
import sys
from collections.abc import Callable
from typing import TypeVar

import fencejax as fj

_Config = TypeVar("_Config")
_Found = TypeVar("_Found")


def run(
    name: str,
    configure: Callable[[], _Config],
    main: Callable[[_Config], _Found],
    *,
    succeeded: Callable[[_Found], bool] = operator.attrgetter("succeeded"),
    refused: tuple[type[Exception], ...] = (ValueError, TypeError),
    stopped: str | None = None,
    tune: bool = True,
) -> None:
    """Do the job that the flags describe and leave Python: with status 0 where it succeeded, and
    with 1 otherwise, after `name: ...` on the standard error where it could not be done.

    **Arguments:**

    - `configure`: makes the configuration from the flags.
    - `succeeded`: whether what `main` found is what was asked for; by default it says so itself.
    - `refused`: errors whose message says all; others are raised.
    - `stopped`: what to say where somebody interrupts the job.
    - `tune`: set the compiler for this machine first; not where `main` does so.
    """
    if tune:
        fj.tune_compiler()
    try:
        found = main(configure())
    except refused as error:
        sys.exit(f"{name}: {error}")
    except KeyboardInterrupt:
        if stopped is None:
            raise
        sys.exit(f"{name}: {stopped}")
    sys.exit(0 if succeeded(found) else 1)
