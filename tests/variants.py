"""Copies of a value that differ in one number or choice, for tests of identities."""

import copy
import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np


def variants(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Paths with copies of a value in which a number, a static field or a key is another one."""
    if value is None:
        yield path, jnp.asarray(0.123)
    elif isinstance(value, bool):
        yield path, not value
    elif isinstance(value, int):
        yield path, value + 1
    elif isinstance(value, float):
        yield path, float(np.nextafter(value, np.inf))
    elif isinstance(value, str):
        yield path, value + " of another"
    elif isinstance(value, (np.ndarray, jax.Array)):
        for index in np.ndindex(value.shape):
            changed = np.array(value)
            changed[index] = np.nextafter(changed[index], np.inf)
            yield f"{path}{list(index)}", changed
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        for field in dataclasses.fields(value):
            for at, part in variants(getattr(value, field.name), f"{path}.{field.name}"):
                changed = copy.copy(value)
                object.__setattr__(changed, field.name, part)
                yield at, changed
    elif isinstance(value, Mapping):
        for key, part in value.items():
            for at, other in variants(part, f"{path}[{key!r}]"):
                yield at, {**value, key: other}
            yield f"{path} without {key!r}", {k: v for k, v in value.items() if k != key}
    elif isinstance(value, tuple):
        for index, part in enumerate(value):
            for at, other in variants(part, f"{path}[{index}]"):
                changed = [*value[:index], other, *value[index + 1 :]]
                yield at, type(value)(*changed) if hasattr(value, "_fields") else tuple(changed)
    elif callable(value):
        yield path, lambda *given: given
    else:
        raise TypeError(f"{path} is a {type(value).__name__}, of which no variant is known")
