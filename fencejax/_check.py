"""Host-side checks of inputs, before anything is compiled; the error names the field."""

import math
import operator
import os
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike

_SPAN = 1e12


class Bounds(NamedTuple):
    """The bounds of a number: its `unit`, bounds, and its ordinary `size`. It is at most 1e12 times
    its size and, where it must be above 0, at least 1e-12 times: beyond, sums in double precision
    lose terms to round-off."""

    unit: str = "1"
    above: float | None = None
    least: float | None = None
    most: float | None = None
    size: float | None = None

    def holds(self, value: Array) -> Array:
        """Whether each of the numbers is within the bounds; False for NaN."""
        fine = jnp.isfinite(value)
        if self.above is not None:
            fine = fine & (value > self.above)
        if self.least is not None:
            fine = fine & (value >= self.least)
        if self.most is not None:
            fine = fine & (value <= self.most)
        if self.size is not None:
            # The square root of the span in single precision.
            span = _SPAN if value.dtype == jnp.float64 else _SPAN**0.5
            fine = fine & (jnp.abs(value) <= self.size * span)
            if self.above == 0:
                fine = fine & (value >= self.size / span)
        return fine


def field(part, name: str, value: ArrayLike) -> Array:
    """Check a field by the `bounds` of its class, as `scalar` does."""
    return scalar(name, value, **part.bounds[name]._asdict())


def fields(part, **values: ArrayLike) -> None:
    """Check the fields of a part as `field` does, and set them, in the order given."""
    for name, value in values.items():
        setattr(part, name, field(part, name, value))


def scalar(name: str, value: ArrayLike, *, above: float | None = None, least: float | None = None,
           most: float | None = None, size: float | None = None, unit: str = "1",
           remedy: str = "") -> Array:
    """Convert `value` to a floating-point array and check it, unless it is traced.

    The array has the default floating-point type, or the type of `value` if that is already
    floating-point. Arrays of more than no dimension are let through (one value a lane).

    Raises `TypeError` where the value is not a real number and `ValueError` where it is not
    finite, out of its bounds, above 1e12 times its ordinary `size` or, where it must be above 0,
    below 1e-12 times; the message names the field, its value and the bound.
    """
    return _checked(name, value, above, least, most, size, unit, remedy)


def on_host(tree: Any) -> Any:
    """The numbers of a tree as arrays of NumPy, whose arithmetic is neither compiled nor traced;
    traced numbers are unchanged."""
    return jax.tree.map(lambda x: x if isinstance(x, Tracer) else np.asarray(x), tree)


def vector(name: str, value: ArrayLike, *, size_least: int = 1, above: float | None = None,
           least: float | None = None, most: float | None = None, size: float | None = None,
           unit: str = "1", remedy: str = "") -> Array:
    """As `scalar`, for a one-dimensional array or sequence of at least `size_least` numbers."""
    if isinstance(value, (list, tuple)):
        numbers = [_checked(name, v, None, None, None, None, unit, remedy) for v in value]
        value = jnp.stack([v.astype(float) for v in numbers]) if numbers else np.zeros(0)
    array = _checked(name, value, above, least, most, size, unit, remedy)
    if array.ndim < 1 or array.shape[-1] < size_least:
        raise ValueError(
            f"Argument `{name}` must be a vector of at least {size_least} numbers, but has the "
            f"shape {array.shape}. {remedy}".rstrip()
        )
    return array


def _checked(name, value, above, least, most, size, unit, remedy) -> Array:
    if isinstance(value, (str, bytes)) or value is None:
        raise TypeError(f"Argument `{name}` [{unit}] must be a real number, but is {value!r}.")
    if isinstance(value, int) and not isinstance(value, bool):
        # An integer that is too large for JAX's integer types may still fit a floating-point type.
        try:
            value = float(value)
        except OverflowError:
            value = math.inf
    try:
        dtype = jnp.result_type(value)
    except TypeError as error:
        raise TypeError(
            f"Argument `{name}` [{unit}] must be a real number, but is {value!r}."
        ) from error
    if jnp.issubdtype(dtype, jnp.complexfloating) or dtype == jnp.bool_:
        raise TypeError(
            f"Argument `{name}` [{unit}] must be a real number, but has the type {dtype}."
        )
    if jnp.issubdtype(dtype, jnp.floating) and jnp.finfo(dtype).bits < 32:
        raise TypeError(
            f"Argument `{name}` [{unit}] must be in single or double precision, but has the type "
            f"{dtype}. Write jnp.float32({name})."
        )
    floating = jnp.issubdtype(dtype, jnp.floating) and hasattr(value, "dtype")
    dtype = dtype if floating else jnp.dtype(jnp.result_type(float))
    if isinstance(value, (float, np.ndarray, np.generic)):
        # On the host: there is no program to compile.
        with np.errstate(over="ignore"):
            value = np.asarray(value, dtype=dtype)
    array = jnp.asarray(value, dtype=dtype)
    if isinstance(array, Tracer):
        return array
    host = np.asarray(array)
    bounds = [
        ("finite", np.isfinite, None),
        ("above", operator.gt, above),
        ("at least", operator.ge, least),
        ("at most", operator.le, most),
    ]
    for word, holds, bound in bounds:
        if word != "finite" and bound is None:
            continue
        fine = holds(host) if bound is None else holds(host, bound)
        if not np.all(fine):
            worst = host if host.ndim == 0 else host[~fine].flat[0]
            limit = word if bound is None else f"{word} {bound:g}"
            raise ValueError(
                f"Argument `{name}` must be {limit} [{unit}], but is {float(worst):g}. "
                f"{remedy}".rstrip()
            )
    if size is not None:
        least = size / _SPAN if above == 0 else 0.0
        away = (np.abs(host) < least) | (np.abs(host) > size * _SPAN)
        if np.any(away):
            worst = host[away].flat[0]
            raise ValueError(
                f"Argument `{name}` must be {least:g} ... {size * _SPAN:g} [{unit}] in size, but "
                f"is {float(worst):g}. Beyond, rounding takes over: check the unit. "
                f"{remedy}".rstrip()
            )
    return array


def count(
    name: str, value: int, *, least: int = 0, most: float = math.inf, remedy: str = ""
) -> int:
    """Check a count, which is static: it changes the program."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise TypeError(f"Argument `{name}` must be a whole number, but is {value!r}.")
    if value < least:
        raise ValueError(
            f"Argument `{name}` must be at least {least}, but is {value}. {remedy}".rstrip()
        )
    if value > most:
        raise ValueError(
            f"Argument `{name}` must be at most {most}, but is {value}. {remedy}".rstrip()
        )
    return int(value)


def _memory() -> float:
    """The memory [bytes] of this machine; infinite where it is not known."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return math.inf


def room(
    name: str, rows: int, columns: int, *, what: str = "points",
    remedy: str = "Write a smaller number.",
) -> None:  # fmt: skip
    """Raise `ValueError` where a table of numbers, with the results computed from it (at least
    another table of its size), does not fit into this machine's memory; the message calls its rows
    `what`."""
    wanted, there = 16.0 * rows * columns, _memory()
    if wanted > there:
        raise ValueError(
            f"Argument `{name}` must ask for {what} that fit into memory, but {rows:.3g} of them "
            f"take {wanted / 1e9:.3g} GB, and this machine has {there / 1e9:.3g} GB. {remedy}"
        )


def number(name: str, value: float, *, above: float = -math.inf, unit: str = "1",
           remedy: str = "") -> float:
    """Check a static number, which is part of the program (a step, a smoothing)."""
    try:
        result = float(value)
    except (TypeError, ValueError) as error:
        raise TypeError(
            f"Argument `{name}` [{unit}] must be a plain number, known before the program is "
            f"compiled, but is {value!r}."
        ) from error
    if not math.isfinite(result) or result <= above:
        bound = f" and above {above:g}" if above > -math.inf else ""
        raise ValueError(
            f"Argument `{name}` must be finite{bound} [{unit}], but is {result:g}. "
            f"{remedy}".rstrip()
        )
    return result


def choice(name: str, value: str, options: tuple[str, ...]) -> str:
    """Check a name against the `options`."""
    if value not in options:
        raise ValueError(f"Argument `{name}` must be one of {options}, but is {value!r}.")
    return value


def several(name: str, value: str | Sequence[str]) -> tuple[str, ...]:
    """Names as a tuple, from a sequence of names or a single one."""
    return (value,) if isinstance(value, str) else sequence(name, value, "names")


def sequence(name: str, value: Iterable[Any], what: str, size: int | None = None) -> tuple:
    """A sequence as a tuple. Raises `TypeError` for what is none and `ValueError` for one that is
    not of the `size`; the message calls its members `what`."""
    try:
        found = tuple(value)
    except TypeError:
        raise TypeError(
            f"Argument `{name}` must be a sequence of {what}, but is {value!r}."
        ) from None
    if size is not None and len(found) != size:
        raise ValueError(
            f"Argument `{name}` must be {size} {what}, but is {len(found)}: {value!r}."
        )
    return found


def flag(name: str, value: object) -> bool:
    """Check that `value` is True or False. Raises `TypeError` otherwise."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"Argument `{name}` must be True or False, but is {value!r}.")
    return bool(value)


def part(name: str, value, kind: type | tuple[type, ...], example: str):
    """Check that a part is an instance of `kind`; `example` shows a correct argument.

    Raises `TypeError` otherwise, with a message of its own for a class in place of an instance.
    """
    if isinstance(value, kind):
        return value
    wanted = " or ".join(k.__name__ for k in (kind if isinstance(kind, tuple) else (kind,)))
    what = f"the class {value.__name__}, not made yet" if isinstance(value, type) else repr(value)
    raise TypeError(
        f"Argument `{name}` must be an instance of {wanted}, but is {what}. Write, for example, "
        f"{example}."
    )
