"""A script run as a program: flags in, an exit status out."""

import errno
import functools
import operator
import os
import sys
from collections.abc import Callable
from typing import NoReturn, TypeVar

import jax

import fencejax as fj

from . import interrupts

_Config = TypeVar("_Config")
_Found = TypeVar("_Found")

RESUMED = "stopped; the same command goes on from here"
"""The message of an interrupted job that can be resumed."""

_REMEDIES = {
    errno.ENOSPC: "Make room, and run the same command again.",
    errno.EDQUOT: "Make room, and run the same command again.",
    errno.EEXIST: "Name another folder: this is a file.",
    errno.ENOTDIR: "Name another folder: there is a file in the way.",
    errno.EISDIR: "Name another folder: this one holds a folder where a file is to be.",
    errno.ENAMETOOLONG: "Write a shorter name.",
    errno.ENOENT: "Name one that is there.",
    errno.EACCES: "Name one that you may read and write.",
    errno.EPERM: "Name one that you may read and write.",
    errno.EROFS: "Name one that you may read and write.",
}


def begin(quiet: bool = False) -> Callable[..., None]:
    """Set double precision, in which jobs compute, and return the function that prints, or one that
    does nothing where `quiet`."""
    jax.config.update("jax_enable_x64", True)
    return (lambda *parts: None) if quiet else functools.partial(print, flush=True)


def run(
    name: str,
    configure: Callable[[], _Config],
    main: Callable[[_Config], _Found],
    *,
    succeeded: Callable[[_Found], bool] = operator.attrgetter("succeeded"),
    refused: tuple[type[Exception], ...] = (ValueError, TypeError),
    stopped: str = "stopped",
    tune: bool = True,
    cached: bool = True,
) -> None:
    """Run the job that the flags describe and exit Python: with status 0 where it succeeded, 130
    where it was interrupted, and 1 otherwise, with a message `name: ...` on the standard error
    where it could not be run.

    **Arguments:**

    - `configure`: makes the configuration from the flags.
    - `succeeded`: whether the result of `main` is a success; by default its own property.
    - `refused`: errors of which only the message is printed, besides those of the system
      (`OSError`) and of its memory; others are raised.
    - `stopped`: the message where the job is interrupted.
    - `tune`: set the compiler for this machine first; not where `main` does so.
    - `cached`: cache compiled programs for the next run; not where compile times are measured.
    """
    interrupts.say(f"{name}: {stopped}")

    def done() -> bool:
        if tune:
            fj.tune_compiler()
        if cached:
            fj.cache_programs()
        return succeeded(main(configure()))

    try:
        _leave(name, done, refused, stopped)
    except SystemExit as leaving:
        interrupts.end(leaving)


def _leave(
    name: str, done: Callable[[], bool], refused: tuple[type[Exception], ...], stopped: str
) -> NoReturn:
    """Exit Python with the status of `done`, or with the message of its error."""
    try:
        sys.exit(0 if done() else 1)
    except OSError as error:
        sys.exit(f"{name}: {_message(error)}")
    except MemoryError as error:
        reason = f" ({error})" if str(error) else ""
        sys.exit(f"{name}: there is not enough memory{reason}. Ask for less.")
    except refused as error:
        sys.exit(f"{name}: {error}")
    except KeyboardInterrupt:
        # Where `interrupts` is not watching.
        print(f"{name}: {stopped}", file=sys.stderr)
        sys.exit(interrupts.STATUS)


def _message(error: OSError) -> str:
    """The message of an error of the system, with a remedy; an own message has one already."""
    if error.errno is None:
        return str(error)
    # Where a file is renamed, its own name and not that of the temporary one.
    name = error.filename if error.filename2 is None else error.filename2
    place = f"{os.fsdecode(name)}: " if name is not None else ""
    remedy = _REMEDIES.get(error.errno, "")
    return f"{place}{error.strerror}. {remedy}".strip()
