"""Names, and changes of numbers, as a designer reads them."""


def plain(name: str) -> str:
    """A name in words."""
    return name.replace("_", " ")


def changed(new: float, old: float) -> str:
    """By how much a number has changed, in percent; nothing where that has no meaning."""
    return f"{100 * (new / old - 1):+.1f} %" if old else ""
