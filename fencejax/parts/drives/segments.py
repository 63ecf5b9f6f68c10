"""Motions made of polynomial segments, out and back, and the limits of a phase."""

import abc

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from .abstract import AbstractDrive

ROUNDING = 1e-6


class AbstractSegmentDrive(AbstractDrive):
    """A stroke of polynomial segments, a dwell at its end, and the same way back."""

    dwell: eqx.AbstractVar[Array]

    @property
    @abc.abstractmethod
    def _stroke(self) -> Array:
        """Time [s] of the way out."""

    @property
    def cycle(self) -> Array:
        return 2 * self._stroke + self.dwell

    @property
    def turning_time(self) -> Array:
        return self._stroke


def out_and_back(time, dwell, stroke, impulses, power):
    """Sum of c (t - t_k)_+^power over the knots of the way out, and the same reversed for the way
    back after the dwell."""
    total = jnp.zeros_like(time)
    for start, sign in ((0.0, 1.0), (stroke + dwell, -1.0)):
        for knot, weight in impulses:
            since = time - start - knot
            total = total + sign * weight * jnp.where(since < 0, 0.0, since) ** power
    return total


def within(phase):
    """Clip to [0, 1] with the derivative from within at both ends (`jnp.clip` halves it there)."""
    return jnp.where(phase < 0, 0.0, jnp.where(phase > 1, 1.0, phase))


def span_at(phase, spans: int) -> tuple[Array, Array]:
    """The index of the one of `spans` equal parts of [0, 1] that a phase lies in, and its place in
    it [1]."""
    place = within(phase) * spans
    floor = jnp.clip(jnp.floor(jax.lax.stop_gradient(place)), 0.0, spans - 1.0)
    return floor.astype(int), place - floor
