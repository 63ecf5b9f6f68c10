"""Parts from tables of a sorter file: fence, drive, belt, border and friction, with free
numbers."""

import dataclasses
import inspect
import math
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeVar

import equinox as eqx

from .. import _check
from .._check import Bounds
from ..parts import (
    DRIVES,
    FRICTIONS,
    TAPERS,
    AbstractDrive,
    AbstractFriction,
    AbstractTaper,
    Belt,
    Border,
    DataSheet,
    Fence,
    Material,
    Pad,
    RestShape,
    SecondOrderLoads,
    Shaft,
    Shear,
    materials,
)
from ..printing import shown
from .amounts import amount, as_written, listed, nearest, refuse_unknown

_P = TypeVar("_P")
Table = Mapping[str, Any]
VECTORS = ("control_angles", "ratios", "torques")
_ROUNDING = 1e-9
_SPAN = ("lower", "upper", "start", "scaling")


class Span(NamedTuple):
    """A free number: lower and upper bound [SI], and the scaling, `None` for the usual one."""

    lower: float
    upper: float
    scaling: str | None = None


@dataclasses.dataclass
class Reading:
    """The free numbers and the lists to choose from that were found while reading the parts."""

    spans: dict[str, Span] = dataclasses.field(default_factory=dict)
    choices: dict[str, tuple[float, ...]] = dataclasses.field(default_factory=dict)

    def number(self, path: str, raw: Any, bounds: Bounds) -> Any:
        """The number [SI] of a field: as given, the start value of a free one, or the first of a
        list; of a vector, the list of its numbers.

        Raises `ValueError` and `TypeError` where it cannot be read or is out of its bounds.
        """

        def read(value: Any, name: str = path) -> float:
            found = amount(name, value, bounds.unit)
            _check.scalar(name, found, **bounds._asdict())
            return found

        if isinstance(raw, Mapping):
            return self._span(path, raw, bounds.unit, read)
        if path.rpartition(".")[2] in VECTORS:
            return [read(value) for value in listed(path, raw, bounds.unit)]
        if isinstance(raw, (list, tuple)):
            if not raw:
                raise ValueError(f"Argument `{path}` must hold at least one number, but is empty.")
            found = [read(value) for value in raw]
            if len(found) > 1:
                self.choices[path] = tuple(found)
            return found[0]
        return read(raw)

    def _span(self, path: str, raw: Table, unit: str, read) -> Any:
        refuse_unknown(path, raw, _SPAN)
        for end in ("lower", "upper"):
            if end not in raw:
                raise ValueError(
                    f"Argument `{path}` must have a lower and an upper bound where it is free, "
                    f"but lacks `{end}`. Write {{lower = ..., upper = ...}}."
                )
        lower, upper = (read(raw[end], f"{path}.{end}") for end in ("lower", "upper"))
        if lower > upper:
            raise ValueError(
                f"Argument `{path}.lower` must be at most `upper` = {upper:g} [{unit}], but is "
                f"{lower:g}."
            )
        vector = path.rpartition(".")[2] in VECTORS
        start = raw.get("start")
        if start is None and vector:
            raise ValueError(
                f"Argument `{path}.start` must be given: a list as long as the vector."
            )
        if vector:
            start = list(listed(f"{path}.start", start, unit))
        if lower < upper:
            scaling = raw.get("scaling", "linear" if lower <= 0 else None)
            if scaling is not None:
                _check.choice(f"{path}.scaling", scaling, ("logarithmic", "linear"))
            self.spans[path] = Span(lower, upper, scaling)
        if isinstance(start, (list, tuple)):
            return [min(max(read(value), lower), upper) for value in start]
        if start is None:
            return math.sqrt(lower * upper) if lower > 0 else 0.5 * (lower + upper)
        found = read(start, f"{path}.start")
        if not lower <= found <= upper:
            raise ValueError(
                f"Argument `{path}.start` must be within {lower:g} ... {upper:g} [{unit}], but is "
                f"{found:g}."
            )
        return found


def _choice(path: str, raw: Any, kinds: Mapping[str, type], default: str) -> tuple[type, Table]:
    """The class named by a table, or by a law's name alone, and the other keys."""
    if isinstance(raw, str):
        raw = {"law": raw}
    if not isinstance(raw, Mapping):
        raise TypeError(
            f"Argument `{path}` must be a table, or one of {', '.join(kinds)}, but is {raw!r}."
        )
    law = raw.get("law", default)
    rest = {key: value for key, value in raw.items() if key != "law"}
    if isinstance(law, type) and issubclass(law, eqx.Module):
        return law, rest
    if law not in kinds:
        raise ValueError(
            f"Argument `{path}.law` must be one of {', '.join(kinds)}, but is {law!r}."
            f"{nearest(str(law), kinds)}"
        )
    return kinds[str(law)], rest


def _made(
    path: str, kind: type, table: Table, reading: Reading, law: str = "", **inner: Any
) -> Any:
    """An instance of a part's class from a table of its numbers; `law` is the name of the class in
    the table, and `inner` are parts of it that exist already."""
    known = inspect.signature(kind).parameters
    refuse_unknown(path, table, known)
    bounds: Mapping[str, Bounds] = getattr(kind, "bounds", {})
    needed = [
        name for name, each in known.items()
        if each.default is each.empty and each.kind not in (each.VAR_POSITIONAL, each.VAR_KEYWORD)
    ]  # fmt: skip
    lacking = [name for name in needed if name not in table and name not in inner]
    if lacking:
        of_law = f" of law {law}" if law else ""
        examples = (as_written(name, bounds.get(name, Bounds()).unit) for name in lacking)
        raise ValueError(
            f"`{path}`{of_law} needs {', '.join(lacking)}, e.g. {', '.join(examples)}."
        )
    values = {
        name: value
        if name in inner or name not in bounds
        else reading.number(f"{path}.{name}", value, bounds[name])
        for name, value in {**table, **inner}.items()
    }
    try:
        return kind(**values)
    except (ValueError, TypeError) as error:
        kind_of_error = TypeError if isinstance(error, TypeError) else ValueError
        raise kind_of_error(f"`{path}`: {error}") from error


def friction(path: str, raw: Any, reading: Reading) -> AbstractFriction | None:
    """A law of friction; `False` for none."""
    if raw is False:
        return None
    return _law(path, raw, AbstractFriction, FRICTIONS, "coulomb", reading)


def belt(raw: Any, reading: Reading) -> Belt:
    """The belt."""
    return _rubbing("belt", raw, Belt, reading)


def border(raw: Any, reading: Reading) -> Border | None:
    """The border; `False` for none."""
    return None if raw is False else _rubbing("border", raw, Border, reading)


def drive(raw: Any, reading: Reading) -> AbstractDrive:
    """The drive's law."""
    return _law("drive", raw, AbstractDrive, DRIVES, "harmonic", reading)


def taper(raw: Any, reading: Reading) -> AbstractTaper:
    """The profile of the fence's thickness."""
    return _law("fence.taper", raw, AbstractTaper, TAPERS, "constant_strength", reading)


_OnFence = Pad | Shaft | RestShape | Shear | SecondOrderLoads
_ON_FENCE: Mapping[str, type[_OnFence]] = {
    "pad": Pad, "shaft": Shaft, "rest_shape": RestShape, "shear": Shear,
    "second_order": SecondOrderLoads,
}  # fmt: skip
IN_FENCE = ("material", "taper", *_ON_FENCE)
"""The parts of a fence."""


def _on_fence(name: str, raw: Any, reading: Reading) -> _OnFence | None:
    """An optional part of a fence: its pad, its shaft, its rest shape, its shear compliance or its
    second-order loads; `False` for none, `True` for the default."""
    kind, path = _ON_FENCE[name], f"fence.{name}"
    if raw is True:
        return kind()
    if raw is False or isinstance(raw, kind):
        return raw or None
    return _made(path, kind, _a_table(path, raw, _example(name, kind), kind), reading)


def _law(
    path: str, raw: Any, kind: type[_P], laws: Mapping[str, type[_P]], usual: str, reading: Reading
) -> _P:
    """A part with one of several laws: the part itself, or from its law's name and numbers."""
    if isinstance(raw, kind):
        return raw
    if isinstance(raw, type):
        _check.part(path, raw, kind, f"{path.rpartition('.')[2]}=fj.{laws[usual].__name__}(...)")
    law, table = _choice(path, raw, laws, usual)
    named = next((name for name, each in laws.items() if each is law), law.__name__)
    return _made(path, law, table, reading, named)


def _rubbing(path: str, raw: Any, kind: type[_P], reading: Reading) -> _P:
    """A part with a friction: the part itself, or from its numbers and those of its friction."""
    if isinstance(raw, kind):
        return raw
    example = f"{path} = {{friction = {{kinetic = 0.6, static = 0.8}}}}"
    table = dict(_a_table(path, raw, example, kind))
    inner = {}
    if "friction" in table:
        inner["friction"] = friction(f"{path}.friction", table.pop("friction"), reading)
    return _made(path, kind, table, reading, **inner)


_LENGTHS = {
    "rigid_length": Bounds("m", least=0, size=1.0),
    "flexible_length": Bounds("m", above=0, size=1.0),
    "reach": Bounds("m", above=0, size=1.0),
    "length_ratio": Bounds(least=0, size=1.0),
}


def fence(raw: Any, reading: Reading) -> tuple[Fence, tuple[DataSheet, ...]]:
    """The fence, made of the first of its materials, and all materials."""
    if isinstance(raw, Fence):
        return raw, (DataSheet("as given", raw.material),)
    table = dict(_a_table("fence", raw, 'fence = {thickness = "45 mm"}', Fence))
    known = ("width", "thickness", "edge_radius", *IN_FENCE, *_LENGTHS)
    refuse_unknown("fence", table, known)
    sheets = _materials(table.pop("material", "PA6 dry"), reading)
    inner: dict[str, Any] = {"material": sheets[0].material}
    if "taper" in table:
        inner["taper"] = taper(table.pop("taper"), reading)
    carried = [name for name in _ON_FENCE if name in table]
    inner |= {name: _on_fence(name, table.pop(name), reading) for name in carried}
    lengths = {name: table.pop(name) for name in _LENGTHS if name in table}
    inner |= _lengths(lengths, reading)
    return _made("fence", Fence, table, reading, **inner), sheets


def _lengths(given: dict[str, Any], reading: Reading) -> dict[str, float]:
    """Rigid and flexible length [m] from two of these, reach and length ratio."""
    if len(given) > 2 or set(given) == {"flexible_length", "length_ratio"}:
        raise ValueError(
            "Argument `fence` must give its length by rigid_length and flexible_length, or by "
            f"reach with length_ratio or rigid_length, but holds {', '.join(given)}."
        )
    found = {
        name: reading.number(f"fence.{name}", raw, _LENGTHS[name]) for name, raw in given.items()
    }
    varied = {*reading.spans, *reading.choices}
    mixed = "reach" in found and {"rigid_length", "flexible_length"} & set(found)
    if mixed and {f"fence.{name}" for name in found} & varied:
        raise ValueError(
            "Argument `fence` must give its length by reach and length_ratio (l_s / l_p), or by "
            "rigid_length and flexible_length, where one of them is free, but holds "
            f"{', '.join(found)}."
        )
    usual = Fence()
    rigid = found.get("rigid_length", float(usual.rigid_length))
    flexible = found.get("flexible_length", float(usual.flexible_length))
    if "reach" in found:
        reach = found["reach"]
        if "rigid_length" in found:
            if rigid >= reach:
                raise ValueError(
                    f"Argument `fence.rigid_length` must be below `reach` = {shown(reach, 'm')}, "
                    f"but is {shown(rigid, 'm')}."
                )
            flexible = reach - rigid
        elif "flexible_length" in found:
            if flexible > reach * (1 + _ROUNDING):
                raise ValueError(
                    "Argument `fence.flexible_length` must be at most `reach` = "
                    f"{shown(reach, 'm')}, but is {shown(flexible, 'm')}."
                )
            rigid = reach - flexible
        else:
            share = found.get("length_ratio", rigid / flexible)
            flexible = reach / (1 + share)
            rigid = reach - flexible
    elif "length_ratio" in found:
        reach = rigid + flexible
        flexible = reach / (1 + found["length_ratio"])
        rigid = reach - flexible
    return {"rigid_length": max(rigid, 0.0), "flexible_length": flexible}


def _materials(raw: Any, reading: Reading) -> tuple[DataSheet, ...]:
    if isinstance(raw, (list, tuple)):
        if not raw:
            raise ValueError("Argument `fence.material` must name one at least, but is empty.")
        sheets = tuple(_material(one, Reading()) for one in raw)
        names = [sheet.name for sheet in sheets]
        if len(set(names)) < len(names):
            raise ValueError(
                f"Argument `fence.material` must not repeat a material, but holds {names}."
            )
        return sheets
    return (_material(raw, reading),)


def _material(raw: Any, reading: Reading) -> DataSheet:
    if isinstance(raw, DataSheet):
        return raw
    if isinstance(raw, Material):
        return DataSheet("as given", raw)
    if isinstance(raw, str):
        return materials.named(raw)
    table = dict(_a_table("fence.material", raw, 'material = "POM"', Material))
    name = table.pop("name", None)
    fields = {**Material.bounds, **DataSheet.bounds}
    refuse_unknown("fence.material", table, (*fields, "conditions", "name"))
    numbers = {
        key: reading.number(f"fence.material.{key}", value, fields[key])
        for key, value in table.items()
        if key in fields
    }
    base: dict[str, Any] = {}
    if isinstance(name, str) and materials.known(name):
        sheet = materials.named(name)
        base = {key: getattr(sheet.material, key) for key in Material.bounds}
        base |= {key: getattr(sheet, key) for key in DataSheet.bounds}
        base["conditions"] = sheet.conditions
    else:
        for key in ("youngs_modulus", "density"):
            if key not in numbers:
                raise ValueError(
                    f"Argument `fence.material` must give `{key}` where it names none of "
                    f"{', '.join(materials.MATERIALS)}, but holds {', '.join(raw)}."
                )
    base |= numbers
    return DataSheet(
        name or "own material",
        Material(**{key: base[key] for key in Material.bounds if key in base}),
        base.get("allowed_stress"),
        base.get("fatigue_strength"),
        table.get("conditions", base.get("conditions", "")),
    )


def _example(name: str, kind: type) -> str:
    """How an optional part of a fence is written in a sorter file."""
    for field, each in getattr(kind, "bounds", {}).items():
        return f"{name} = {{{as_written(field, each.unit)}}}"
    return f"{name} = true"


def _a_table(path: str, raw: Any, example: str, kind: type) -> Table:
    if isinstance(raw, Mapping):
        return raw
    what = f"the class {raw.__name__}" if isinstance(raw, type) else repr(raw)
    raise TypeError(
        f"Argument `{path}` must be a table of numbers or the part itself, but is {what}. Write, "
        f"for example, {example}, or in Python fj.{kind.__name__}(...)."
    )
