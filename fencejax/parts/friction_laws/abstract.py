"""The interface of a friction law."""

import abc
from typing import NamedTuple

from jaxtyping import Array

from ...printing import Part


class FrictionScales(NamedTuple):
    """The coefficients by which the effect of a friction law's smoothing is estimated [1].

    `sliding` is the coefficient at the speed asked for, `largest` the largest one near rest, and
    `jump` the change of the coefficient over `Fidelity.static_speed` that is due to smoothing
    alone; 0 for a law that is continuous in the speed.

    >>> scales = fj.Friction(0.35, 0.5).scales(0.2)
    >>> f"{scales.sliding:.2f} {scales.jump:.2f} {scales.largest:.2f}"
    '0.35 0.15 0.50'
    """

    sliding: Array
    jump: Array
    largest: Array


class AbstractFriction(Part):
    """The coefficient of friction mu(w) [1] between two surfaces that slide at the speed w [m/s].

    A law is a property of a pair of surfaces. The force that follows from it, its direction and its
    smoothing at rest over `Fidelity.slip_speed` belong to the model (`fencejax.model`). All its
    numbers are array fields, checked against the `bounds` of the class by `fencejax._check.fields`.

    >>> law = fj.friction_laws.Stribeck(0.35, 0.5, stribeck_speed=0.1)
    >>> [f"{law.coefficient(jnp.array(v**2), 1e-3)[0]:.3f}" for v in (0.01, 0.1, 1.0)]
    ['0.499', '0.405', '0.350']
    """

    @abc.abstractmethod
    def coefficient(self, speed_squared: Array, static_speed: float) -> tuple[Array, Array]:
        """mu [1] at w^2 = `speed_squared` [m^2/s^2], and its derivative in w^2 [s^2/m^2].

        `static_speed` [m/s] is the speed over which a coefficient that jumps from static to kinetic
        friction is smoothed. Both numbers and their derivatives are finite at w = 0, where a parcel
        sticks to the belt exactly.
        """

    @abc.abstractmethod
    def scales(self, speed: Array) -> FrictionScales:
        """The coefficients that the diagnostics need, for sliding at `speed` [m/s]."""
