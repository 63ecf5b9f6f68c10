"""Design variables as flags give them, and tables of designs."""

import argparse
from collections.abc import Sequence

import fencejax as fj
from fencejax.design import DesignSpace, variable

Bounds = tuple[tuple[str, float, float], ...]


def bounds(text: str) -> tuple[str, float, float]:
    """`name=lower:upper` as a name and two numbers in SI units."""
    name, _, span = text.partition("=")
    lower, _, upper = span.partition(":")
    try:
        return name, float(lower), float(upper)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"must be name=lower:upper, but is {text!r}") from error


BOUNDS_FLAG = dict(type=bounds, nargs="*", metavar="NAME=LOWER:UPPER")
"""Settings of `add_argument` for a field of bounds."""


def space(
    variables: Sequence[str],
    given: Bounds = (),
    fence: fj.Fence | None = None,
    drive: fj.AbstractDrive | None = None,
    default: Bounds = (),
) -> DesignSpace:
    """The design space of some variables, with `given` bounds or else those of `default`.

    Raises `ValueError` for bounds of what is not designed.
    """
    spans = {name: (lower, upper) for name, lower, upper in default}
    for name, lower, upper in given:
        if name not in variables:
            raise ValueError(
                f"Argument `bounds` must be of designed variables {list(variables)}, but names "
                f"{name!r}. Add it to `variables`."
            )
        spans[name] = (lower, upper)
    chosen = [variable(name, *spans[name]) if name in spans else name for name in variables]
    return DesignSpace(chosen, fence, drive)


def on_bounds(space: DesignSpace, values) -> list[str]:
    """The variables within a hundredth of their range from a bound."""
    shares = [float(v.share(x)) for v, x in zip(space.variables, values, strict=True)]
    return [n for n, s in zip(space.names, shares, strict=True) if not 0.01 < s < 0.99]
