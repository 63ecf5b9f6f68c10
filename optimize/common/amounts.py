"""Names and changes of numbers in words."""


def plain(name: str) -> str:
    """A name in words."""
    return name.replace("_", " ")


def changed(new: float, old: float) -> str:
    """The change of a number in percent; empty where the old one is 0."""
    return f"{100 * (new / old - 1):+.1f} %" if old else ""
