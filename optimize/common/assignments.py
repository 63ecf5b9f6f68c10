"""Names with numbers in the values of flags: `name=value,...`, `name=lower:upper`."""

from fencejax.scenes import names
from fencejax.sorter import amount


def values(field: str, text: str, form: str) -> dict[str, float]:
    """`"distance=0.9,mass=10"` as numbers by name.

    Raises `ValueError` where one is not a number: that the `field` must `form`.
    """
    try:
        return dict(_pair(part) for part in text.split(","))
    except ValueError as error:
        raise refusal(field, text, form) from error


def span(field: str, text: str, form: str) -> tuple[str, float, float, list[str]]:
    """`"mass=1:30:logarithmic"` as a name, two numbers [SI] and the words behind them; a number may
    have a unit, as in `"thickness=20mm:60mm"`.

    Raises `ValueError` where there are no two numbers: that the `field` must `form`.
    """
    name, _, rest = text.partition("=")
    ends = rest.split(":")
    try:
        return name, _number(name, ends[0]), _number(name, ends[1]), ends[2:]
    except IndexError as error:
        raise refusal(field, text, form) from error
    except ValueError as error:
        raise ValueError(f"{refusal(field, text, form)} {error}") from error


def _number(name: str, text: str) -> float:
    known = names.known(name)
    return float(text) if known is None else amount(name, _plain(text), known.unit)


def _plain(text: str) -> float | str:
    """A number, or else the text: one with a unit."""
    try:
        return float(text)
    except ValueError:
        return text


def refusal(field: str, text: str, form: str) -> ValueError:
    """The error for a text that cannot be read."""
    return ValueError(f"Argument `{field}` must {form}, but holds {text!r}.")


def _pair(text: str) -> tuple[str, float]:
    name, _, number = text.partition("=")
    return name.strip(), float(number)
