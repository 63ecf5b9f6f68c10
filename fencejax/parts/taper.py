"""The thickness of the flexible link along its length, h(x) = h_1 g(x / l_p)."""

import abc
from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from .. import _check
from .._check import Bounds
from ..printing import Part


class AbstractTaper(Part):
    """A profile g of the thickness over the relative position x / l_p in [0, 1].

    Any fixed g is self-similar: the mass and stiffness matrices of the link scale with
    rho z h_1 l_p and E z h_1^3 / l_p^3, so one dimensionless eigen-solve, done before the program
    is traced, serves every design. A profile with parameters of its own (array leaves) puts the
    eigen-solve into the program, where it is differentiated.

    >>> class Wedge(fj.AbstractTaper):
    ...     def __call__(self, position, tip_distance):
    ...         return 0.3 + 0.7 * tip_distance
    >>> fence = fj.Fence(taper=Wedge())
    >>> fence.taper
    Wedge()
    """

    @abc.abstractmethod
    def __call__(self, position: Any, tip_distance: Any) -> Any:
        """g(x / l_p) [1] at `position` = x / l_p, of any shape.

        `tip_distance` = 1 - x / l_p is given beside it, free of cancellation. The array functions
        used are those that NumPy and JAX share.
        """

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions x / l_p [1] between root and tip, in order, at which g has a kink or a step:
        integrals of g are taken piece by piece. By default there are none."""
        return ()


class ConstantStrength(AbstractTaper):
    """g = sqrt(1 - x / l_p): under a force at the tip every section carries the same bending
    stress. The thickness at the tip is zero.

    Paper: (2.1).

    >>> fj.ConstantStrength()(0.75, 0.25)
    0.5
    """

    def __call__(self, position, tip_distance):
        return tip_distance**0.5


class Uniform(AbstractTaper):
    """g = 1: a plain strip.

    >>> fence = fj.Fence(taper=fj.Uniform(), thickness=0.03)
    >>> fence.taper
    Uniform()
    """

    def __call__(self, position, tip_distance):
        return tip_distance**0


class PowerTaper(AbstractTaper):
    """g = (1 - x / l_p)^p with a traced exponent p [1], 0 <= p < 1.

    Above p = 1 the tip is so slender that its curvature is no longer square integrable.

    >>> fence = fj.Fence(taper=fj.PowerTaper(0.3))
    >>> fence.taper
    PowerTaper(exponent=0.3)
    """

    exponent: Array

    bounds: ClassVar[dict[str, Bounds]] = {"exponent": Bounds(least=0, most=0.99)}

    def __init__(self, exponent: ArrayLike):
        """**Arguments:** `exponent`: p [1], at least 0 and at most 0.99.

        Raises `ValueError` where it is out of these bounds.
        """
        self.exponent = _check.field(self, "exponent", exponent)

    def __call__(self, position, tip_distance):
        return tip_distance**self.exponent


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


TAPERS: Mapping[str, type[AbstractTaper]] = {
    "constant_strength": ConstantStrength,
    "uniform": Uniform,
    "power": PowerTaper,
    "profile": ProfileTaper,
}
"""The profiles by name."""
