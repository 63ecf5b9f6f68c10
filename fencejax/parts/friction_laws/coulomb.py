"""Static and kinetic friction after Coulomb."""

from typing import ClassVar, Literal

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ... import _check
from ..._check import Bounds
from .abstract import AbstractFriction, FrictionScales


class Friction(AbstractFriction):
    """Coulomb friction with a static and a kinetic coefficient, smoothed where it jumps at rest:
    mu(w) = mu_k + (mu_s - mu_k) exp(-(w / w_s)^2), w_s the `static_speed` of the fidelity.

    Paper: (2.21)-(2.24). There friction at rest is a case of its own, in balance with the other
    forces; this law tends to it as w_s and eps fall.

    >>> fj.Friction(kinetic=0.35, static=0.5)
    Friction(kinetic=0.35, static=0.5)
    """

    kinetic: Array
    static: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "kinetic": Bounds(least=0, size=1.0),
        "static": Bounds(least=0, size=1.0),
    }

    def __init__(self, kinetic: ArrayLike, static: ArrayLike):
        """**Arguments:** `kinetic`: mu_k [1], at least 0. `static`: mu_s [1], at least 0."""
        _check.fields(self, kinetic=kinetic, static=static)

    def coefficient(self, speed_squared, static_speed):
        scale = 1 / static_speed**2
        excess = (self.static - self.kinetic) * jnp.exp(-scale * speed_squared)
        return self.kinetic + excess, -scale * excess

    def scales(self, speed):
        del speed
        jump = jnp.abs(self.static - self.kinetic)
        return FrictionScales(self.kinetic, jump, jnp.maximum(self.static, self.kinetic))


def on_cover() -> Friction:
    """The default friction of a parcel on the cover of the fence, the border and a deflector:
    kinetic 0.35, static 0.5.

    >>> fj.friction_laws.on_cover()
    Friction(kinetic=0.35, static=0.5)
    """
    return Friction(kinetic=0.35, static=0.5)


def friction_of(
    name: str, friction: AbstractFriction | None | Literal["default"]
) -> AbstractFriction | None:
    """The friction given as the argument `name`: that of covers for `"default"`, `None` for no
    friction.

    Raises `TypeError` where it is no law of friction.

    >>> fj.friction_laws.friction_of("friction", "default")
    Friction(kinetic=0.35, static=0.5)
    """
    friction = on_cover() if friction == "default" else friction
    if friction is None:
        return None
    example = f"{name}=fj.Friction(kinetic=0.35, static=0.5)"
    return _check.part(name, friction, AbstractFriction, example)
