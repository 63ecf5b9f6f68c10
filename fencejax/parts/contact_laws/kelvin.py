"""The paper's contact law, a modified Kelvin model."""

import functools
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from ... import _check
from ..._check import Bounds
from .abstract import AbstractContactLaw, NormalForce

_MOST, _POINTS = 60.0, 600


class Kelvin(AbstractContactLaw):
    """Modified Kelvin model: N = max(0, b_p m_p^0.4 Ddot D^2 + k_p D^4) for D > 0, else 0.

    The law is continuously differentiable at D = 0, so that the onset needs no smoothing. Its
    restitution against a rigid wall depends on b_p v^0.2 / k_p^0.6 alone.

    Paper: (2.2).

    >>> f"{fj.contact_laws.Kelvin().wall_force(2.426, mass=15.0):.0f} N"
    '3294 N'
    """

    stiffness: Array
    damping: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "stiffness": Bounds("N/m^4", least=0, size=1e9),
        "damping": Bounds("N s kg^-0.4 m^-3", least=0, size=1e5),
    }

    def __init__(self, stiffness: ArrayLike = 1.72e9, damping: ArrayLike = 3.3e5):
        """**Arguments:**

        - `stiffness`: k_p [N/m^4], at least 0.
        - `damping`: b_p [N s kg^-0.4 m^-3], at least 0.
        """
        _check.fields(self, stiffness=stiffness, damping=damping)

    def viscosity(self, mass):
        """b_p m_p^0.4 [N s / m^3], the coefficient of Ddot D^2 in the law."""
        return self.damping * mass**0.4

    def force(self, gap, gap_rate, viscosity):
        depth = jnp.maximum(gap, 0.0)
        square = depth * depth
        viscous, elastic = viscosity * gap_rate, self.stiffness * square
        force = square * (viscous + elastic)
        pushing = force > 0
        return NormalForce(
            force=jnp.maximum(force, 0.0),
            by_gap=jnp.where(pushing, depth * (2 * viscous + 4 * elastic), 0.0),
            by_rate=jnp.where(pushing, square * viscosity, 0.0),
        )

    def stored_energy(self, gap):
        """k_p D^5 / 5 [J]."""
        return self.stiffness * jnp.maximum(gap, 0.0) ** 5 / 5

    def wall_force(self, speed, mass):
        """N_stiff [N] = k_p^0.2 (m v^2)^0.8 f(b_p v^0.2 / k_p^0.6), f tabulated up to an argument
        of 60, which is 0.9 for the paper's parcel at 1 m/s; (5/2)^0.8 without damping."""
        nodes, peaks = _peak_table()
        log_speed = jnp.log(jnp.asarray(speed))
        beta = self.damping * jnp.exp(0.2 * log_speed) / self.stiffness**0.6
        grid, logs = jnp.asarray(np.arcsinh(nodes)), jnp.asarray(np.log(peaks))
        factor = jnp.interp(jnp.arcsinh(jnp.minimum(beta, _MOST)), grid, logs)
        base = 0.2 * jnp.log(self.stiffness) + 0.8 * (jnp.log(mass) + 2 * log_speed)
        return jnp.exp(base + factor)


@functools.cache
def _peak_table() -> tuple[np.ndarray, np.ndarray]:
    """f(beta) at beta = sinh of equally spaced numbers.

    With D = d delta, t = tau s, d = (m v^2 / k_p)^(1/5) and tau = d / v, a parcel that meets a
    rigid wall at v follows delta'' = -max(0, beta delta' delta^2 + delta^4), delta(0) = 0,
    delta'(0) = 1, with beta = b_p v^0.2 / k_p^0.6, and the peak force is k_p d^4 f(beta). By the
    classical Runge-Kutta method, all beta at once.
    """
    beta = np.sinh(np.linspace(0.0, np.arcsinh(_MOST), _POINTS))
    step, place, rate = 1e-3, np.zeros(_POINTS), np.ones(_POINTS)
    peak, before, now = np.zeros(_POINTS), np.zeros(_POINTS), np.zeros(_POINTS)

    def force(d, v):
        return np.maximum(0.0, beta * v * d**2 + d**4) * (d > 0)

    for _ in range(2500):
        slopes = []
        for share, scale in ((0.0, 0.0), (0.5, 0.5), (0.5, 0.5), (1.0, 1.0)):
            d = place + share * step * (slopes[-1][0] if slopes else 0.0)
            v = rate + scale * step * (slopes[-1][1] if slopes else 0.0)
            slopes.append((v, -force(d, v)))
        place = place + step / 6 * sum(w * s[0] for w, s in zip((1, 2, 2, 1), slopes, strict=True))
        rate = rate + step / 6 * sum(w * s[1] for w, s in zip((1, 2, 2, 1), slopes, strict=True))
        new = force(place, rate)
        difference = before - 2 * now + new
        inner = (now >= before) & (now > new) & (difference < 0)
        safe = np.where(inner, difference, -1.0)
        peak = np.maximum(peak, np.where(inner, now - (new - before) ** 2 / (8 * safe), new))
        before, now = now, new
    return beta, peak
