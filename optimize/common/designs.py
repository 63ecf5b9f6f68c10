"""Design spaces from flags, and variables on their bounds."""

from collections.abc import Sequence

import fencejax as fj
from fencejax.design import DesignSpace, variable
from fencejax.scenes import names

Bounds = tuple[tuple[str, float, float], ...]


def space(
    variables: Sequence[str],
    given: Bounds = (),
    fence: fj.Fence | None = None,
    drive: fj.AbstractDrive | None = None,
    default: Bounds = (),
) -> DesignSpace:
    """The design space of some variables and of those with `given` bounds; other bounds are those
    of `default` or of the table of names."""
    spans = {_place(name): (lower, upper) for name, lower, upper in (*default, *given)}
    chosen = {_place(name): name for name in (*variables, *(name for name, *_ in given))}
    return DesignSpace(
        [variable(n, *spans[p]) if p in spans else n for p, n in chosen.items()], fence, drive
    )


def _place(name: str) -> str:
    """The path of a number from any of its names."""
    known = names.known(name)
    return name if known is None or names.element(name)[1] is not None else known.path


def on_bounds(space: DesignSpace, values) -> list[str]:
    """The variables within a hundredth of their range from a bound."""
    shares = [float(v.share(x)) for v, x in zip(space.variables, values, strict=True)]
    return [n for n, s in zip(space.names, shares, strict=True) if not 0.01 < s < 0.99]
