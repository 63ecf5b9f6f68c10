"""Setting and freeing numbers of a sorter's tables by their paths."""

import dataclasses
import tomllib
from collections.abc import Mapping
from typing import Any

import equinox as eqx

from ..parts import (
    AbstractDrive,
    AbstractFriction,
    AbstractTaper,
    Belt,
    Border,
    DataSheet,
    Fence,
    Motor,
    on_cover,
)
from ..scenes import DERIVED, PATHS, names
from . import parcels
from .amounts import amount, nearest
from .machine import SECTIONS, scene_path
from .reading import IN_FENCE, VECTORS, Table

_PAIRS = (("rigid_length", "flexible_length"), ("reach", "length_ratio"))


def value(text: str) -> Any:
    """The value of a text after `=`: a number, a list, a table or a boolean as in TOML, and else
    the text itself, such as `45 mm` or `POM`."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text.strip()


def span(text: str) -> Any:
    """`"4 mm:90 mm"` as a table, optionally with `:linear` or `:logarithmic` at the end; a text
    without a colon is a value, at which the number is fixed."""
    lower, *rest = text.split(":")
    if not rest:
        return value(text)
    ends = {"lower": value(lower), "upper": value(rest[0])}
    return ends | ({"scaling": rest[1]} if len(rest) > 1 else {})


def path_of(name: str) -> tuple[str, ...]:
    """The path of a number in the tables, from that path itself, its path in a scene, or its short
    name: `"thickness"` is `fence.thickness`, `"mass"` is `parcels.mass`.

    Raises `ValueError` where there is none.
    """
    if name in DERIVED:
        name = f"fence.{name}"
    for full in PATHS.get(name, ()):
        if full.partition(".")[0] in (*SECTIONS, "parcel", "start"):
            name = full
    if name in parcels.FIELDS:
        name = f"parcels.{name}"
    first, *rest = name.split(".")
    if first in ("parcel", "start"):
        first, rest = "parcels", [part.replace("given_", "") for part in rest]
    if first not in SECTIONS:
        meant = f" Did you mean `fence.{name}`?" if name in IN_FENCE else ""
        known = (*SECTIONS, *PATHS, *parcels.FIELDS)
        raise ValueError(
            f"Argument `set` must name a number of the sorter, such as fence.thickness, but names "
            f"{name!r}.{meant or nearest(name, known, 0.75)}"
        )
    return first, *rest


def replaced(tables: Table, name: str, new: Any) -> dict[str, Any]:
    """The tables with the value at a path replaced."""
    path = path_of(name)
    result = {**tables}
    if len(path) == 1:
        result[path[0]] = new
        return result
    table: dict[str, Any] = result
    for depth, part in enumerate(path[:-1]):
        inner = table.get(part, _usual(path[: depth + 1]))
        if isinstance(inner, eqx.Module):
            inner = as_table(inner)
        elif isinstance(inner, Mapping):
            inner = dict(inner)
        elif isinstance(inner, str):
            inner = {"name" if part == "material" else "law": inner}
        elif inner is None or isinstance(inner, bool):
            inner = {}
        else:
            raise ValueError(
                f"Argument `set` must name a number of the sorter, but {name!r} goes through "
                f"`{part}`, which is {inner!r}."
            )
        table[part] = inner
        table = inner
    if path[0] == "fence" and len(path) == 2:
        _paired(table, path[1])
    table[path[-1]] = new
    return result


def _usual(path: tuple[str, ...]) -> AbstractFriction | None:
    """The default friction of a part whose table leaves it out; `None` for other parts."""
    if path == ("fence_friction",):
        return on_cover()
    owner = {"belt": Belt, "border": Border}.get(path[0])
    return owner().friction if owner is not None and path[1:] == ("friction",) else None


def _paired(fence: dict[str, Any], name: str) -> None:
    """Rewrite a fence's two lengths in terms of the pair that a name belongs to."""
    for pair, other in (_PAIRS, _PAIRS[::-1]):
        if name not in pair or not set(fence) & set(other):
            continue
        usual = Fence()
        given = {
            key: amount(f"fence.{key}", fence[key], "1" if key == "length_ratio" else "m")
            for key in (*pair, *other)
            if key in fence and key != name and not isinstance(fence[key], (Mapping, list, tuple))
        }
        if any(key in fence and key not in given and key != name for key in (*pair, *other)):
            return
        rigid = given.get("rigid_length", float(usual.rigid_length))
        flexible = given.get("flexible_length", float(usual.flexible_length))
        reach = given.get("reach", rigid + flexible)
        if "rigid_length" in given:
            ratio = rigid / (reach - rigid) if "reach" in given else rigid / flexible
        else:
            ratio = given.get("length_ratio", rigid / flexible)
        for key in other:
            fence.pop(key, None)
        if pair[0] == "reach":
            fence |= {"reach": reach, "length_ratio": ratio}
        else:
            fence |= {
                "rigid_length": reach * ratio / (1 + ratio), "flexible_length": reach / (1 + ratio),
            }  # fmt: skip


def freed(tables: Table, name: str, new: Any) -> dict[str, Any]:
    """The tables with a number free within a span, starting at its value or at the nearest
    bound."""
    path = path_of(name)
    if isinstance(new, Mapping) and "start" not in new:
        start = _present(tables, path)
        unit = _unit(path)
        if isinstance(start, list):
            new = {**new, "start": start}
        elif start is not None and unit is not None:
            lower, upper = (amount(f"{name}.{end}", new[end], unit) for end in _ENDS)
            new = {**new, "start": min(max(amount(name, start, unit), lower), upper)}
    return replaced(tables, name, new)


_ENDS = ("lower", "upper")


def _unit(path: tuple[str, ...]) -> str | None:
    """The unit of a number; `None` where only its part would define it."""
    known = names.known(scene_path(".".join(path)))
    if known is not None:
        return known.unit
    bounds = Motor.bounds.get(path[-1]) if path[0] == "motor" else None
    return None if bounds is None else bounds.unit


def _present(tables: Table, path: tuple[str, ...]) -> Any:
    """The present number of the tables: a value, or a vector's list; `None` if there is none."""
    found: Any = tables
    for part in path:
        found = as_table(found) if isinstance(found, eqx.Module) else found
        found = found.get(part) if isinstance(found, Mapping) else None
    if isinstance(found, Mapping):
        found = found.get("start")
    if isinstance(found, (list, tuple)):
        return list(found) if path[-1] in VECTORS else None
    return found


def as_table(part: Any) -> dict[str, Any]:
    """The table that describes a part, so that one of its numbers can be changed; inner parts stay
    parts."""
    table = {field.name: getattr(part, field.name) for field in dataclasses.fields(part)}
    if isinstance(part, (AbstractDrive, AbstractTaper, AbstractFriction)):
        table["law"] = type(part)
    if isinstance(part, DataSheet):
        material = table.pop("material")
        table |= as_table(material)
    plain = {}
    for name, value in table.items():
        if value is not None:
            vector = name in VECTORS
            plain[name] = [float(v) for v in value] if vector else value
    return plain
