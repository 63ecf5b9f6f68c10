"""A thickness milled in steps."""

import equinox as eqx
import numpy as np

from ... import _check
from .abstract import AbstractTaper


class SteppedTaper(AbstractTaper):
    """Another profile milled in `steps` equal steps, each as thick as the profile at its middle.

    >>> f"{fj.SteppedTaper(fj.ConstantStrength(), 4)(0.1, 0.9):.4f}"
    '0.9354'
    """

    profile: AbstractTaper
    steps: int = eqx.field(static=True)

    def __init__(self, profile: AbstractTaper, steps: int):
        """**Arguments:**

        - `profile`: the profile that is milled in steps.
        - `steps`: how many there are, static, at least 1.

        Raises `ValueError` where there is none, and `TypeError` where `steps` is no whole number
        or `profile` no taper.
        """
        example = "fj.SteppedTaper(fj.ConstantStrength(), 4)"
        self.profile = _check.part("profile", profile, AbstractTaper, example)
        self.steps = _check.count("steps", steps, least=1)

    @property
    def breaks(self) -> tuple[float, ...]:
        return tuple(k / self.steps for k in range(1, self.steps))

    def __call__(self, position, tip_distance):
        step = np.minimum(np.floor(position * self.steps), self.steps - 1)
        middle = (step + 0.5) / self.steps
        return self.profile(middle, 1 - middle)
