"""Reading numbers with a unit, and refusing unknown names, in a sorter file."""

import difflib
import functools
import math
import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ..parts import dimension

_NUMBER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(.*)", re.DOTALL)
_TOLERANCE = 1e-9


@functools.cache
def _registry():
    """The units of the library `pint`, loaded at the first use."""
    import pint

    return pint.UnitRegistry()


def _exponents(unit) -> tuple[float, float, float] | None:
    """Powers of mass, length and time; `None` for a unit with other dimensions."""
    found = {name.strip("[]"): float(power) for name, power in unit.dimensionality.items()}
    mass, length, time = (found.pop(name, 0.0) for name in ("mass", "length", "time"))
    return None if found else (mass, length, time)


def amount(name: str, value: Any, unit: str) -> float:
    """A number in `unit` [SI] from a plain number, which is taken to be in that unit already, or
    from text such as `"45 mm"`, `"3 GPa"`, `"400 N m"`, `"60 deg"`.

    Where `unit` holds an angle, as rad/s does, the text's unit must hold one too: `"50 Hz"` may
    count turns or radians, whose numbers differ by 2 pi.

    Raises `ValueError` for text that is no number, has a unit of another dimension or lacks the
    angle, and `TypeError` for anything but numbers and text.
    """
    if not isinstance(value, str):
        plain = isinstance(value, (int, float)) or hasattr(value, "dtype")
        if not plain or isinstance(value, bool) or np.ndim(value):
            raise TypeError(
                f"Argument `{name}` [{unit}] must be a number, or text with a unit such as "
                f'"{_example(unit)}", but is {value!r}.'
            )
        return _finite(name, float(value), unit)
    text = value.strip()
    match = _NUMBER.fullmatch(text)
    if match is None or "," in text:
        comma = " Write a decimal point." if "," in text else ""
        raise ValueError(
            f"Argument `{name}` [{unit}] must be a number with or without a unit, such as "
            f'"{_example(unit)}", but is {value!r}.{comma}'
        )
    number, written = float(match[1]), match[2].strip()
    if not written:
        return _finite(name, number, unit)
    # "Nm" is no unit of its own; a library may read it as something else.
    written = re.sub(r"\b([kM]?N)(m|mm)\b", r"\1 \2", written)
    try:
        parsed = _registry().parse_units(written)
        powers, wanted = _exponents(parsed), dimension(unit)
        quantity = _registry().Quantity(1.0, parsed)
        size = float(quantity.to_base_units().magnitude)
        turned = dict(quantity.to_root_units().unit_items()).get("radian", 0)
    except Exception as error:
        # The library raises errors of many kinds for text that it cannot read.
        raise ValueError(
            f"Argument `{name}` must be in {unit} or a unit like it, such as "
            f'"{_example(unit)}", but is {value!r}: {written!r} is no unit.'
        ) from error
    if powers is None or any(abs(a - b) > _TOLERANCE for a, b in zip(powers, wanted, strict=True)):
        raise ValueError(
            f"Argument `{name}` must be in {unit} or a unit like it, such as "
            f'"{_example(unit)}", but is {value!r}, of another dimension.'
        )
    if _angle(unit) not in (0, turned):
        raise ValueError(
            f"Argument `{name}` must be in {unit} or a unit like it, with an angle, but is "
            f"{value!r}. {_with_angle(number * size, written, unit)}"
        )
    return _finite(name, number * size, unit)


def _angle(unit: str) -> int:
    """The power of the angle in a unit [SI], in which rad stands once at most."""
    above, _, below = unit.partition("/")
    return above.split().count("rad") - re.split(r"[ /]", below).count("rad")


def _with_angle(size: float, written: str, unit: str) -> str:
    """What to write instead of a unit without an angle."""
    if unit != "rad/s":
        return f'Write, for example, "{_example(unit)}".'
    return (
        f'Write "{60 * size:.4g} rpm", which is "{2 * math.pi * size:.4g} rad/s", where {written} '
        f'counts turns, and "{size:.4g} rad/s" where it counts radians.'
    )


def _finite(name: str, value: float, unit: str) -> float:
    if not math.isfinite(value):
        raise ValueError(f"Argument `{name}` must be finite [{unit}], but is {value}.")
    return value


_EXAMPLES = {
    "m": "45 mm", "Pa": "3 GPa", "rad": "30 deg", "m/s": "2.5 m/s", "kg/m^3": "1130 kg/m^3",
    "N m": "400 N m", "s": "1.4 s", "kg": "15 kg", "1": "0.35", "N": "300 N", "rad/s": "1.5 rad/s",
}  # fmt: skip


def _example(unit: str) -> str:
    return _EXAMPLES.get(unit, f"2 {unit}")


_WRITTEN = {
    "control_angles": "[0, 0.3, 0.6] [rad]", "torques": "[60, 0, -60] [N m]",
    "ratios": "[1, 0.8, 0.5]", "stribeck_speed": '"20 mm/s"',
}  # fmt: skip


def as_written(name: str, unit: str) -> str:
    """An example of how a number [`unit`], or a vector, is written in a sorter file."""
    usual = _example(unit) if unit == "1" else f'"{_example(unit)}"'
    return f"{name} = {_WRITTEN.get(name, usual)}"


def listed(path: str, raw: Any, unit: str) -> Any:
    """The numbers of a vector, which must be a list."""
    if isinstance(raw, str) or np.ndim(raw) != 1:
        key = path.removesuffix(".start").rpartition(".")[2]
        raise TypeError(
            f"Argument `{path}` must be a list of numbers, but is {raw!r}. Write, for example, "
            f"{as_written(key, unit)}."
        )
    return raw


def nearest(name: str, known: Iterable[str], likeness: float = 0.5) -> str:
    """`" Did you mean ...?"` with the known name nearest to an unknown one, or nothing. A known
    name that starts with the unknown one as its first word is preferred to similar spellings,
    which are alike by `likeness` [1] at least."""
    known = list(known)
    begun = [one for one in known if one.startswith(f"{name}_")]
    found = begun or difflib.get_close_matches(name, known, 1, likeness)
    return f" Did you mean `{found[0]}`?" if found else ""


def refuse_unknown(where: str, table: Mapping[str, Any], known: Iterable[str]) -> None:
    """Raise `ValueError` for an unknown key of a table, naming the nearest known one."""
    known = list(known)
    for key in table:
        if key not in known:
            raise ValueError(
                f"`{where}` holds the unknown key `{key}`.{nearest(str(key), known)} It may hold "
                f"{', '.join(known)}."
            )
