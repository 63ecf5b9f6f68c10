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
"""What a job says when it is interrupted that keeps what it has found."""

_REMEDIES = {
    errno.ENOSPC: "Make room, and run the same command again.",
    errno.EDQUOT: "Make room, and run the same command again.",
    errno.EEXIST: "Name another folder: this is a file.",
    errno.ENOTDIR: "Name another folder: there is a file in the way.",
    errno.EISDIR: "Name another folder: this one holds a folder where a file is to be.",
    errno.ENOENT: "Name one that is there.",
    errno.EACCES: "Name one that you may read and write.",
    errno.EPERM: "Name one that you may read and write.",
    errno.EROFS: "Name one that you may read and write.",
}


def begin(quiet: bool = False) -> Callable[..., None]:
    """Set double precision, in which jobs compute, and return what one prints with: nothing where
    `quiet`."""
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
    """Do the job that the flags describe and leave Python: with status 0 where it succeeded, with
    130 where somebody interrupts it, and with 1 otherwise, after `name: ...` on the standard error
    where it could not be done.

    **Arguments:**

    - `configure`: makes the configuration from the flags.
    - `succeeded`: whether what `main` found is what was asked for; by default it says so itself.
    - `refused`: errors whose message says all, beside those of the system (`OSError`) and of its
      memory; others are raised.
    - `stopped`: what to say where somebody interrupts the job.
    - `tune`: set the compiler for this machine first; not where `main` does so.
    - `cached`: keep compiled programs for the next run; not where it is measured how long they take
      to compile.
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
    """Leave Python with whether it is `done`, or with what stands in the way."""
    try:
        sys.exit(0 if done() else 1)
    except OSError as error:
        sys.exit(f"{name}: {_said(error)}")
    except MemoryError as error:
        told = f" ({error})" if str(error) else ""
        sys.exit(f"{name}: there is not enough memory{told}. Ask for less.")
    except refused as error:
        sys.exit(f"{name}: {error}")
    except KeyboardInterrupt:
        # Where nobody watches for it: see `interrupts`.
        print(f"{name}: {stopped}", file=sys.stderr)
        sys.exit(interrupts.STATUS)


def _said(error: OSError) -> str:
    """What the system refuses, and what to do; a message of our own says so itself."""
    if error.errno is None:
        return str(error)
    place = f"{os.fsdecode(error.filename)}: " if error.filename is not None else ""
    remedy = _REMEDIES.get(error.errno, "")
    return f"{place}{error.strerror}. {remedy}".strip()
