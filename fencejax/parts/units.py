"""Units as powers of mass, length and time, read from their text."""

import re
from typing import NamedTuple

from .. import _check


class Dimension(NamedTuple):
    """Exponents of mass [kg], length [m] and time [s]."""

    mass: float
    length: float
    time: float


_UNITS = {
    "1": Dimension(0, 0, 0),
    "rad": Dimension(0, 0, 0),
    "kg": Dimension(1, 0, 0),
    "m": Dimension(0, 1, 0),
    "s": Dimension(0, 0, 1),
    "N": Dimension(1, 1, -2),
    "Pa": Dimension(1, -1, -2),
    "J": Dimension(1, 2, -2),
    "W": Dimension(1, 2, -3),
}
_FACTOR = re.compile(r"([A-Za-z]+|1)(?:\^(-?\d+(?:\.\d+)?))?")


def dimension(unit: str) -> Dimension:
    """The dimension of a product of powers such as `"N s kg^-0.4 m^-3"` or `"kg/m^3"`: spaces
    multiply, and a slash divides by all that follows it.

    Raises `ValueError` where the text is none, or names another unit than 1, rad, kg, m, s, N, Pa,
    J and W.
    """
    total = [0.0, 0.0, 0.0]
    above, *below = unit.split("/")
    for sign, factors in ((1, above), *((-1, part) for part in below)):
        for factor in factors.split():
            match = _FACTOR.fullmatch(factor)
            if match is None:
                raise ValueError(
                    f"Argument `unit` must be a product of powers, but is {unit!r}. Write, for "
                    'example, "kg m/s^2".'
                )
            _check.choice(f"unit of {unit!r}", match[1], tuple(_UNITS))
            power = sign * float(match[2] or 1)
            total = [t + power * e for t, e in zip(total, _UNITS[match[1]], strict=True)]
    return Dimension(*total)
