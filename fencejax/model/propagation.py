"""Exact propagation of a damped oscillator under a force that varies linearly over a step."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .._xla import fusion_barrier, sound

# Terms of the power series, and the largest size of its argument: the first term left out is
# 0.5^14 / 14! = 7e-16 of the first one.
_SERIES_TERMS = 14
_SERIES_RANGE = 0.5


class Propagator(NamedTuple):
    """The exact map of q'' + c q' + w^2 q = f, f linear from f0 to f1, over one step:

        q1  = qq q0 + qv v0 + q_start f0 + q_end f1
        v1  = vq q0 + vv v0 + v_start f0 + v_end f1
    """

    qq: Array
    qv: Array
    vq: Array
    vv: Array
    q_start: Array
    q_end: Array
    v_start: Array
    v_end: Array


def _series(stiffness, damping, step):
    """g', g and its first and second integrals by their power series, for small frequency x step.

    g'' + c g' + w^2 g = 0, g(0) = 0, g'(0) = 1: g = sum a_k t^(k+1) / (k+1)!, with
    a_k = -c a_(k-1) - w^2 a_(k-2). Summed in units of the step, so that nothing over- or
    underflows in single precision.
    """
    stiffness, damping = stiffness * step**2, damping * step
    one, zero = jnp.ones_like(stiffness), jnp.zeros_like(stiffness)

    def term(k, carry):
        before, now, share, sums = carry
        # share = 1 / k!
        first = share / (k + 1)
        second = first / (k + 2)
        third = second / (k + 3)
        sums = tuple(
            total + now * part
            for total, part in zip(sums, (share, first, second, third), strict=True)
        )
        return now, -damping * now - stiffness * before, first, sums

    carry = (zero, one, one, (zero, zero, zero, zero))
    velocity, value, first, second = jax.lax.fori_loop(0, _SERIES_TERMS, term, carry)[3]
    return velocity, value * step, first * step**2, second * step**3


def _closed(stiffness, damping, step):
    """g', g and its integrals in closed form, for underdamped and overdamped oscillators.

    Near critical damping sin(s)/s and sinh(s)/s are taken from their common series in s^2.
    """
    half = 0.5 * damping
    square = (stiffness - half**2) * step**2
    near = jnp.abs(square) < 1e-2
    under = square > 0
    # Underdamped: decay x (cos, sin).
    angle = jnp.sqrt(jnp.where(under & ~near, square, 1.0))
    decay = jnp.exp(-half * step)
    # Overdamped: two real rates; the slow one free of cancellation.
    root = jnp.sqrt(jnp.where(~under & ~near, -square, 1.0)) / step
    fast = half + root
    slow = jnp.where(~under & ~near, stiffness, 1.0) / fast
    slow_decay, fast_decay = jnp.exp(-slow * step), jnp.exp(-fast * step)
    # Near critical: series in the square, exact to 1e-16 below 1e-2.
    x = jnp.where(near, square, 0.0)
    cosine = 1 - x / 2 * (1 - x / 12 * (1 - x / 30 * (1 - x / 56)))
    sine = 1 - x / 6 * (1 - x / 20 * (1 - x / 42 * (1 - x / 72)))

    value = jnp.where(
        near,
        decay * step * sine,
        jnp.where(
            under,
            decay * step * jnp.sin(angle) / angle,
            (slow_decay - fast_decay) / (2 * root),
        ),
    )
    velocity = jnp.where(
        near,
        decay * (cosine - half * step * sine),
        jnp.where(
            under,
            decay * (jnp.cos(angle) - half * step * jnp.sin(angle) / angle),
            (fast * fast_decay - slow * slow_decay) / (2 * root),
        ),
    )
    first = (1 - velocity - damping * value) / stiffness
    second = (step - value - damping * first) / stiffness
    return velocity, value, first, second


def _response(stiffness, damping, step):
    """g', g and its first and second integrals over the step."""
    size = jnp.maximum(jnp.sqrt(stiffness), damping) * step
    small = size < _SERIES_RANGE
    safe = jnp.where(small, 0.0, 1.0)
    # Each branch gets harmless numbers where the other one is used, so that neither makes a
    # derivative non-finite.
    outer = _closed(safe * stiffness + (1 - safe) / step**2, safe * damping, step)
    inner = _series((1 - safe) * stiffness, (1 - safe) * damping, step)
    return tuple(jnp.where(small, a, b) for a, b in zip(inner, outer, strict=True))


def propagator(stiffness: Array, damping: Array, step: Array | float) -> Propagator:
    """The exact one-step map for `stiffness` = w^2 [1/s^2], above 0, `damping` = c [1/s], at least
    0, and `step` [s]. Elementwise; no limit of stability and no numerical damping.

    With g the response to a unit impulse, G1 and G2 its first and second integrals,
    q = (g' + c g) q0 + g v0 + G1 f0 + G2 (f1 - f0) / h, and the velocity is its derivative.
    """
    parts = fusion_barrier(sound((stiffness, damping)), _response, stiffness, damping, step)
    velocity, value, first, second = parts
    q_end = second / step
    v_end = first / step
    return Propagator(
        qq=1 - stiffness * first,
        qv=value,
        vq=-stiffness * value,
        vv=velocity,
        q_start=first - q_end,
        q_end=q_end,
        v_start=value - v_end,
        v_end=v_end,
    )


def relaxation(lag: Array, step: Array | float) -> Array:
    """exp(-h / lag) [1], the share of a rate with this lag [s] that is left after a step h [s]; 0,
    with no derivative, where the lag is negligible."""
    slow = lag > 1e-2 * step
    return jnp.where(slow, jnp.exp(-step / jnp.where(slow, lag, 1.0)), 0.0)
