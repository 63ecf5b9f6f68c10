"""Friction after Stribeck: falling from static to kinetic over a speed of its own, then rising."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ... import _check
from ..._check import Bounds
from .abstract import AbstractFriction, FrictionScales


class Stribeck(AbstractFriction):
    """mu(w) = mu_k + (mu_s - mu_k) exp(-(w / v_S)^2) + c w, with w the speed of sliding.

    The fall from static to kinetic friction takes place over the Stribeck speed v_S, which is a
    property of the surfaces and has a derivative, unlike the `static_speed` of a fidelity, over
    which the jump of `fencejax.Friction` is smoothed. The last term is the growth with the speed
    that rubber and lubricated surfaces show. The fidelity's `slip_speed` should be well below v_S:
    the force still goes through zero over it.

    B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, A survey of models, analysis tools and
    compensation methods for the control of machines with friction, Automatica 30 (1994) 1083-1138.

    >>> fj.friction_laws.Stribeck(0.35, 0.5, stribeck_speed=0.1)
    Stribeck(kinetic=0.35, static=0.5, stribeck_speed=0.1 m/s, viscous=0 s/m)
    """

    kinetic: Array
    static: Array
    stribeck_speed: Array
    viscous: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "kinetic": Bounds(least=0, size=1.0),
        "static": Bounds(least=0, size=1.0),
        "stribeck_speed": Bounds("m/s", above=0, size=1.0),
        "viscous": Bounds("s/m", least=0, size=1.0),
    }

    def __init__(
        self,
        kinetic: ArrayLike,
        static: ArrayLike,
        stribeck_speed: ArrayLike,
        viscous: ArrayLike = 0.0,
    ):
        """**Arguments:**

        - `kinetic`: mu_k [1], at least 0. `static`: mu_s [1], at least 0.
        - `stribeck_speed`: v_S [m/s], above 0.
        - `viscous`: c [s/m], at least 0.
        """
        _check.fields(
            self, kinetic=kinetic, static=static, stribeck_speed=stribeck_speed, viscous=viscous,
        )  # fmt: skip

    def coefficient(self, speed_squared, static_speed):
        del static_speed
        scale = 1 / self.stribeck_speed**2
        excess = (self.static - self.kinetic) * jnp.exp(-scale * speed_squared)
        # The root has no derivative at 0, where a parcel rests on the belt.
        slides = speed_squared > 0
        speed = jnp.sqrt(jnp.where(slides, speed_squared, 1.0))
        growth = jnp.where(slides, self.viscous * speed, 0.0)
        slope = jnp.where(slides, 0.5 * self.viscous / speed, 0.0)
        return self.kinetic + excess + growth, slope - scale * excess

    def scales(self, speed):
        coefficient, _ = self.coefficient(speed**2, 0.0)
        largest = jnp.maximum(self.static, self.kinetic)
        return FrictionScales(coefficient, jnp.zeros_like(coefficient), largest)
