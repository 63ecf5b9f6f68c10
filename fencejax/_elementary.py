"""Cosine, sine and arc tangent as arithmetic alone, and the mean of a Gaussian.

On a CPU XLA calls the C library for these one number at a time, also in a batch, while it
vectorises additions and multiplications. In double precision they are exact to two units in the
last place, for angles up to 1e5 rad; in single precision they are the compiler's own.

Polynomials: S. L. Moshier, Cephes mathematical library, `sin.c` and `atan.c`: sine and cosine
within pi / 4 of a multiple of pi / 2; the arc tangent within 0.66, as a quotient.
"""

import math

import jax
import jax.numpy as jnp
from jaxtyping import Array

# pi / 2 in three parts, the first two of so few bits that their multiples are exact.
_HALF_PI = 1.5707962512969970703125, 7.549789415861596e-8, 5.390302858158119e-15
_SINE = (
    1.58962301576546568060e-10, -2.50507477628578072866e-8, 2.75573136213857245213e-6,
    -1.98412698295895385996e-4, 8.33333333332211858878e-3, -1.66666666666666307295e-1,
)  # fmt: skip
_COSINE = (
    -1.13585365213876817300e-11, 2.08757008419747316778e-9, -2.75573141792967388112e-7,
    2.48015872888517045348e-5, -1.38888888888730564116e-3, 4.16666666666665929218e-2,
)  # fmt: skip


def _polynomial(coefficients: tuple[float, ...], x: Array) -> Array:
    value = jnp.full_like(x, coefficients[0])
    for each in coefficients[1:]:
        value = value * x + each
    return value


@jax.custom_jvp
def cos_sin(angle: Array) -> tuple[Array, Array]:
    """The cosine and the sine of an `angle` [rad]."""
    if angle.dtype != jnp.float64:
        return jnp.cos(angle), jnp.sin(angle)
    quarters, rest = jnp.round(angle * (2 / math.pi)), angle
    for part in _HALF_PI:
        rest = rest - quarters * part
    square = rest * rest
    sine = rest + rest * square * _polynomial(_SINE, square)
    cosine = 1 - 0.5 * square + square * square * _polynomial(_COSINE, square)
    # Quarter turns beyond the last full turn: 0, 1, 2 or 3.
    quarter = quarters - 4 * jnp.floor(0.25 * quarters)
    within = jnp.abs(quarter - 1.5)
    odd, behind = jnp.abs(quarter - 2) == 1, within < 1
    along, across = jnp.where(odd, sine, cosine), jnp.where(odd, cosine, sine)
    return jnp.where(behind, -along, along), jnp.where(quarter >= 2, -across, across)


@cos_sin.defjvp
def _(primals, tangents):
    (angle,), (dot,) = primals, tangents
    cosine, sine = cos_sin(angle)
    return (cosine, sine), (-sine * dot, cosine * dot)


_ABOVE = (
    -8.750608600031904122785e-1, -1.615753718733365076637e1, -7.500855792314704667340e1,
    -1.228866684490136173410e2, -6.485021904942025371773e1,
)  # fmt: skip
_BELOW = (
    1.0, 2.485846490142306297962e1, 1.650270098316988542046e2, 4.328810604912902668951e2,
    4.853903996359136964868e2, 1.945506571482613964425e2,
)  # fmt: skip


@jax.custom_jvp
def arctan(x: Array) -> Array:
    """The angle [rad] whose tangent is `x`."""
    if x.dtype != jnp.float64:
        return jnp.arctan(x)
    size = jnp.abs(x)
    # Beyond tan(3 pi / 8) as pi / 2 - atan(1 / x), beyond 0.66 as pi / 4 + atan((x - 1) / (x + 1)).
    steep, middling = size > 2.414213562373095, size > 0.66
    above = jnp.where(steep, -1.0, jnp.where(middling, size - 1, size))
    below = jnp.where(steep, size, jnp.where(middling, size + 1, 1.0))
    start = jnp.where(steep, math.pi / 2, jnp.where(middling, math.pi / 4, 0.0))
    rest = above / below
    square = rest * rest
    share = square * _polynomial(_ABOVE, square) / _polynomial(_BELOW, square)
    return jnp.copysign(start + (rest + rest * share), x)


arctan.defjvps(lambda dot, _, x: dot / (1 + x * x))


# Below it the series is used, as a difference would lose digits. The next term of the mean is z^12
# / (13 6!), 1e-16, and that of its derivative over z twelve times 1 / (13 6!) z^10, 1e-13.
_SHORT = 0.1


@jax.custom_jvp
def gaussian_mean(z: Array) -> tuple[Array, Array]:
    """The mean of exp(-x^2) over x from 0 to z >= 0, sqrt(pi) / 2 erf(z) / z, and its derivative in
    z over z."""
    square = z * z
    falling = jnp.exp(-square)
    whole = jax.scipy.special.erf(z)
    some = z > _SHORT
    mean = 0.5 * math.sqrt(math.pi) * whole / jnp.where(some, z, 1.0)
    rate = (falling - mean) / jnp.where(some, square, 1.0)
    series = _polynomial((-1 / 1320, 1 / 216, -1 / 42, 1 / 10, -1 / 3, 1.0), square)
    slope = _polynomial((-1 / 132, 1 / 27, -1 / 7, 2 / 5, -2 / 3), square)
    return jnp.where(some, mean, series), jnp.where(some, rate, slope)


@gaussian_mean.defjvp
def _(primals, tangents):
    (z,), (dot,) = primals, tangents
    mean, rate = gaussian_mean(z)
    square = z * z
    some = z > _SHORT
    bend = -(2 * jnp.exp(-square) + 3 * rate) / jnp.where(some, z, 1.0)
    series = z * _polynomial((2 / 9, -4 / 7, 4 / 5), square)
    return (mean, rate), (rate * z * dot, jnp.where(some, bend, series) * dot)
