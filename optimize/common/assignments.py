"""Names with numbers in the texts of flags: `name=value,...`, `name=lower:upper`."""


def values(field: str, text: str, form: str) -> dict[str, float]:
    """`"distance=0.9,mass=10"` as numbers by name.

    Raises `ValueError` where one is not a number: that the `field` must `form`.
    """
    try:
        return dict(_pair(part) for part in text.split(","))
    except ValueError as error:
        raise refusal(field, text, form) from error


def span(field: str, text: str, form: str) -> tuple[str, float, float, list[str]]:
    """`"mass=1:30:logarithmic"` as a name, two numbers and the words behind them.

    Raises `ValueError` where there are no two numbers: that the `field` must `form`.
    """
    name, _, rest = text.partition("=")
    ends = rest.split(":")
    try:
        return name, float(ends[0]), float(ends[1]), ends[2:]
    except (ValueError, IndexError) as error:
        raise refusal(field, text, form) from error


def refusal(field: str, text: str, form: str) -> ValueError:
    """What is raised for a text that cannot be read."""
    return ValueError(f"Argument `{field}` must {form}, but holds {text!r}.")


def _pair(text: str) -> tuple[str, float]:
    name, _, number = text.partition("=")
    return name.strip(), float(number)
