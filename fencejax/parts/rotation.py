"""Vectors turned by an angle."""

from typing import Any


def turned(turn: tuple[Any, Any], x: Any, y: Any) -> tuple[Any, Any]:
    """The vector (x, y) in fixed axes, given in axes that are turned by an angle: (x cos - y sin,
    x sin + y cos). `turn` is (cos, sin) of the angle; of JAX or of NumPy."""
    cosine, sine = turn
    return cosine * x - sine * y, sine * x + cosine * y
