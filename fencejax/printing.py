"""Text of numbers and parts, for a terminal and for a notebook.

`shown(0.045, "m")` is `"45 mm"`. A class that prints itself is a `Readable`: it defines its title
and its rows, and gets its text and its HTML from here. A part of a scene is a `Part`: its rows are
its fields, with the units of its class's `bounds`, and a new part needs no code for it.

Printing computes nothing with JAX: within a transformation a traced number is shown by its type and
shape, and the program is unchanged.
"""

import dataclasses
import html
import math
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import numpy as np
from jax.core import Tracer

from ._check import Bounds

# For each unit: the least size, the factor and the name of each multiple that it is shown in.
_LADDERS: Mapping[str, tuple[tuple[float, float, str], ...]] = {
    "m": ((1.0, 1.0, "m"), (1e-5, 1e-3, "mm"), (0.0, 1e-6, "um")),
    "s": ((1.0, 1.0, "s"), (1e-4, 1e-3, "ms"), (0.0, 1e-6, "us")),
    "Pa": ((1e9, 1e9, "GPa"), (1e5, 1e6, "MPa"), (1e3, 1e3, "kPa")),
    "N": ((1e4, 1e3, "kN"),),
    "N m": ((1e4, 1e3, "kN m"),),
    "W": ((1e3, 1e3, "kW"),),
    "J": ((1e4, 1e3, "kJ"),),
}
_DIGITS, _WIDE, _FEW = 4, 96, 8


def shown(value: Any, unit: str = "1", digits: int = _DIGITS) -> str:
    """A number [`unit`, SI] as an engineer writes it: with `digits` significant digits, in the
    multiple of the unit with few figures before the point."""
    size, title = multiple(value, unit, digits)
    return _plain(float(value) / size, digits) + ("" if title == "1" else f" {title}")


def multiple(value: Any, unit: str, digits: int = _DIGITS) -> tuple[float, str]:
    """The multiple of a unit in which a number is shown, and its name: 1e-3 and `"mm"`."""
    number = float(value)
    if number != 0 and math.isfinite(number):
        for least, size, name in _LADDERS.get(unit, ()):
            # A number that is rounded up to the next multiple is shown in that.
            if abs(number) * (1 + 0.5 * 10.0**-digits) >= least:
                return size, name
    return 1.0, unit


def _plain(number: float, digits: int) -> str:
    """A number with so many digits: without a point where they end before it, with an exponent
    where it is far away."""
    if math.isfinite(number) and 10**digits <= abs(number) < 1e6:
        return f"{number:.0f}"
    text = f"{number:.{digits}g}"
    mantissa, exponent, power = text.partition("e")
    return f"{mantissa}e{int(power)}" if exponent else text.replace("-0", "0", text == "-0")


def _array(value: Any) -> np.ndarray | None:
    """The numbers of an array, if they are known on the host."""
    if isinstance(value, Tracer):
        return None
    try:
        found = np.asarray(value)
    except Exception:
        # A donated buffer, or one on other hosts.
        return None
    return found if found.dtype.kind in "fiu" else None


def known(*values: Any) -> bool:
    """Whether numbers can be shown: not traced, and on this host."""
    return all(_array(value) is not None for value in values)


_KINDS = {"float": "f", "int": "i", "uint": "u", "bfloat": "bf", "complex": "c"}


def _typed(value: Any) -> str:
    """`f64[3]`: type and shape of an array without its numbers."""
    name = str(value.dtype)
    letters = name.rstrip("0123456789")
    size = name[len(letters) :]
    return f"{_KINDS.get(letters, letters)}{size}[{','.join(map(str, value.shape))}]"


def numbers(value: Any, unit: str = "1") -> str:
    """An array as text: one number or a few with their unit, many by their shape and their range,
    and a traced array by its type and shape."""
    array = _array(value)
    if array is None:
        return _typed(value)
    if not array.ndim:
        return shown(array, unit)
    if array.ndim == 1 and array.size <= _FEW:
        return f"[{', '.join(shown(one, unit) for one in array)}]"
    text, known = _typed(value), array[np.isfinite(array)]
    if not known.size:
        return text
    low, high = shown(known.min(), unit), shown(known.max(), unit)
    return f"{text}, {low}" if low == high else f"{text}, {low} ... {high}"


class Table(NamedTuple):
    """The printed form of a thing: a title and rows, each a name with a text or with a table of its
    own; an empty name stands for a plain line. Short `inline` tables take one line, as a call:
    `Uniform()`."""

    title: str
    rows: "tuple[tuple[str, str | Table], ...]" = ()
    inline: bool = False

    def __repr__(self) -> str:
        return as_text(self)

    def _repr_html_(self) -> str:
        return as_html(self)


def as_table(thing: "Readable") -> Table:
    """The printed form of a thing."""
    return thing._printed()


def of_lines(title: str, text: str) -> Table:
    """A table of the lines of a text."""
    return Table(title, tuple(("", line) for line in text.splitlines()))


def as_text(table: Table, room: int = _WIDE) -> str:
    """A table for a terminal."""
    if table.inline:
        cells = [_cell(name, value, room) for name, value in table.rows]
        line = f"{table.title}({', '.join(cells)})"
        if len(line) <= room and "\n" not in line:
            return line
        cells = [_cell(name, value, room - 2) for name, value in table.rows]
        indented = (cell.replace("\n", "\n  ") for cell in cells)
        lines = (f"  {cell}" if cell.startswith("#") else f"  {cell}," for cell in indented)
        return "\n".join([f"{table.title}(", *lines, ")"])
    wide = max((len(name) for name, _ in table.rows), default=0)
    lines = [table.title]
    for name, value in table.rows:
        text = value if isinstance(value, str) else as_text(value, room - wide - 4)
        lead = f"  {name:<{wide}}  " if name else "  "
        lines.append((lead + text.replace("\n", "\n" + " " * len(lead))).rstrip())
    return "\n".join(lines)


def _cell(name: str, value: "str | Table", room: int) -> str:
    text = value if isinstance(value, str) else as_text(value, room - len(name) - 2)
    return f"{name}={text}" if name else text


def as_html(table: Table) -> str:
    """A table for a notebook."""
    rows = "".join(_html_rows(table, 0))
    return (
        f"<table><thead><tr><th colspan='2' style='text-align:left'>{html.escape(table.title)}</th>"
        f"</tr></thead><tbody>{rows}</tbody></table>"
    )


def _html_rows(table: Table, depth: int) -> Iterator[str]:
    left = "text-align:left;white-space:pre-wrap"
    for name, value in table.rows:
        inner = value if isinstance(value, Table) else None
        text = html.escape(value if isinstance(value, str) else value.title)
        if not name:
            yield f"<tr><td colspan='2' style='{left};font-family:monospace'>{text}</td></tr>"
        else:
            lead = f"{left};padding-left:{1 + depth}em"
            head = f"<td style='{lead}'>{html.escape(name)}</td>"
            yield f"<tr>{head}<td style='{left}'>{text}</td></tr>"
        if inner is not None:
            yield from _html_rows(inner, depth + 1)


class Readable:
    """A class that prints itself: a subclass defines its printed form by `_printed`."""

    def _printed(self) -> Table:
        raise NotImplementedError

    def __repr__(self) -> str:
        return as_text(self._printed())

    def _repr_html_(self) -> str:
        """For notebooks."""
        return as_html(self._printed())


class Part(Readable, eqx.Module):
    """A part of a scene, printed as the call that makes it, with the units of numbers.

    A gradient in a part, or a difference of parts, has the class of the part, and is recognised by
    numbers out of the part's bounds. It is shown without units, as those of the part are not its
    own; `fencejax.Gradient` shows it with its own units.
    """

    bounds: ClassVar[dict[str, Bounds]] = {}

    def _unit(self, name: str) -> str:
        """The unit of a field, or of an element or a field of it."""
        found = self.bounds.get(name.removeprefix("given_"))
        return "1" if found is None else found.unit

    def _printed(self) -> Table:
        if not any(_out_of_bounds(self)):
            return _of_part(self, True)
        table = _of_part(self, False)
        note = "not in the bounds of a part, as a gradient is not: see fj.Gradient for its units"
        return table._replace(rows=(*table.rows, ("", f"# {note}")))


def _fields(part: Any) -> Iterator[tuple[str, Any]]:
    """The fields to print, by name: not those that are `None`, nor a setting at its default."""
    for field in dataclasses.fields(part):
        value = getattr(part, field.name, None)
        usual = field.default is not dataclasses.MISSING and not hasattr(value, "dtype")
        if value is None or (usual and type(value) is type(field.default)
                             and value == field.default):  # fmt: skip
            continue
        yield field.name, value


def _of_part(part: Part, with_units: bool) -> Table:
    rows = tuple(
        (name.removeprefix("given_"), _value(part, name, value, with_units))
        for name, value in _fields(part)
    )
    return Table(type(part).__name__, rows, inline=True)


def _value(owner: Part, name: str, value: Any, with_units: bool) -> "str | Table":
    """The text of a field: a part, numbers, several of them, or anything else by its own text."""
    if isinstance(value, Part):
        return _of_part(value, with_units)
    if isinstance(value, Readable):
        return value._printed()
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        rows = tuple(
            (key, _value(owner, f"{name}.{key}", one, with_units))
            for key, one in zip(value._fields, value, strict=True)  # pyright: ignore
        )
        return Table(type(value).__name__, rows, inline=True)
    if isinstance(value, tuple) and any(hasattr(one, "dtype") for one in value):
        rows = tuple(
            ("", _value(owner, f"{name}[{k}]", one, with_units)) for k, one in enumerate(value)
        )
        return Table("", rows, inline=True)
    if isinstance(value, tuple) and value and all(isinstance(one, Part) for one in value):
        return Table("", tuple(("", _of_part(one, with_units)) for one in value), inline=True)
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    unit = owner._unit(name) if with_units else "1"
    if hasattr(value, "dtype") and hasattr(value, "shape"):
        return numbers(value, unit)
    return shown(value, unit) if number else repr(value)


def _out_of_bounds(part: Part) -> Iterator[bool]:
    """For each number of a part, and of the parts in it, whether it is out of its bounds."""
    for name, value in _fields(part):
        for one in value if isinstance(value, tuple) else (value,):
            if isinstance(one, Part):
                yield from _out_of_bounds(one)
        bounds = type(part).bounds.get(name.removeprefix("given_"))
        array = _array(value) if bounds is not None and hasattr(value, "dtype") else None
        if bounds is None or array is None:
            continue
        for bad, limit in (
            (np.less_equal, bounds.above), (np.less, bounds.least), (np.greater, bounds.most),
        ):  # fmt: skip
            yield limit is not None and bool(np.any(bad(array, limit)))
