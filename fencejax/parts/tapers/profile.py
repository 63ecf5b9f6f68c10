"""A thickness given at stations along the link."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ... import _check
from ..._check import Bounds
from .abstract import AbstractTaper


class ProfileTaper(AbstractTaper):
    """g by linear interpolation of traced `ratios` [1] at equally spaced stations, root to tip.

    >>> f"{fj.ProfileTaper([1.0, 0.8, 0.5])(0.25, 0.75):.2f}"
    '0.90'
    """

    ratios: Array

    bounds: ClassVar[dict[str, Bounds]] = {"ratios": Bounds(above=0, size=1.0)}

    def __init__(self, ratios: ArrayLike):
        """**Arguments:** `ratios`: g [1] at the stations, shape (K,), two at least, each above 0.

        Raises `ValueError` where they are fewer, or out of these bounds.
        """
        self.ratios = _check.vector("ratios", ratios, size_least=2, above=0, size=1.0)

    @property
    def breaks(self) -> tuple[float, ...]:
        spans = self.ratios.shape[-1] - 1
        return tuple(k / spans for k in range(1, spans))

    def __call__(self, position, tip_distance):
        stations = jnp.linspace(0.0, 1.0, self.ratios.shape[-1])
        return jnp.interp(position, stations, self.ratios)
