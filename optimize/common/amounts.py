"""Numbers and names as a designer reads them."""

_SHOWN = {"m": (1e3, "mm"), "Pa": (1e-6, "MPa")}


def shown(value: float, unit: str, digits: int = 4) -> str:
    """A number in the unit that a designer reads it in."""
    factor, title = _SHOWN.get(unit, (1.0, unit))
    scaled = 0.0 if abs(value) < 1e-9 else factor * value
    # Whole numbers where there are more digits than asked for.
    text = f"{scaled:.0f}" if 10**digits <= abs(scaled) < 1e7 else f"{scaled:.{digits}g}"
    return text + ("" if title == "1" else f" {title}")


def plain(name: str) -> str:
    """A name in words."""
    return name.replace("_", " ")


def changed(new: float, old: float) -> str:
    """By how much a number has changed, in percent; nothing where that has no meaning."""
    return f"{100 * (new / old - 1):+.1f} %" if old else ""
