"""The belt's edge under the parcel: the weight that the belt still carries, and where.

While C_s is above the belt, by d inside the edge, the part of the parcel that lies on it carries
the whole weight. The resultant of the pressure must be under C_s, to balance the weight's moment.
Here the pressure is uniform over the part of the rectangle that is within d of C_s across the belt,
on either side. No other uniform pressure balances the weight without pressing beyond the edge; the
linear one without tension has a mean distance c of the carrying points that is larger by at most 5
%. So F <= mu_1 m_p g is unchanged, and c falls from the rectangle's to a quarter of the edge's
length inside it.

Beyond, the parcel begins to tip about the edge. A body that turns about a line at the distance
delta from its centre of gravity, from rest, presses on it with

    m_p g k^2 / (k^2 + delta^2),

k its radius of gyration, for which that about the vertical axis is taken, sqrt(I_p / m_p). The belt
carries this at the foot E of C_s on the edge, with a pressure that is uniform along the edge as far
as it is inside the rectangle on both sides of E: u is the velocity at E, and the moment of the
force about C_s has the arm delta. The force ends where this part of the edge ends. That the parcel
is tilted by then, and the support by the chute, are not modelled.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from ..parts import Belt, Parcel
from ..scenes import Body
from .fading import fade

# Least distance of C_s to the edge [m], and least sine between the parcel's sides and the edge.
# Smaller values are taken as these.
_NEAR, _PARALLEL = 1e-5, 1e-9
# Half the length of the edge under the parcel [m] over which its load ends, so that forces are
# smooth. What half and twice of it change is in `tests/reference/belt_edge.py`.
FADE = 0.02


class Carried(NamedTuple):
    """The load on the belt: the `weight` [N], the mean distance c [m] of the pressing points from
    their middle, and the distance of this middle behind C_s across the belt, `lever` [m]."""

    weight: Array
    mean_distance: Array
    lever: Array


def _part(p: Array, s: Array) -> Array:
    """Twice the integral over t from 0 to s of sqrt(t^2 + p^2)."""
    return s * jnp.sqrt(s**2 + p**2) + p**2 * jnp.arcsinh(s / p)


def strip_mean_distance(length: Array, breadth: Array, angle: Array, half_width: Array) -> Array:
    """Mean distance [m] from its centre of the points of a rectangle, turned by an `angle` [rad],
    within `half_width` [m] of its centre across the belt.

    Three pairs of lines r.n_j = p_j bound these points. A line's part between the others, from s to
    s', makes a triangle with the centre, of the area p (s' - s) / 2 and with the integral of the
    distance p / 3 times that of sqrt(t^2 + p^2) over it.
    """
    cosine, sine = jnp.cos(angle), jnp.sin(angle)
    one, zero = jnp.ones_like(angle), jnp.zeros_like(angle)
    normals = ((cosine, sine), (-sine, cosine), (zero, one))
    reaches = (0.5 * length, 0.5 * breadth, jnp.maximum(half_width, _NEAR))
    distance = area = zero
    for j, ((x, y), p) in enumerate(zip(normals, reaches, strict=True)):
        low, high = -jnp.inf * one, jnp.inf * one
        for k, ((a, b), q) in enumerate(zip(normals, reaches, strict=True)):
            if k == j:
                continue
            across = b * x - a * y
            across = jnp.where(jnp.abs(across) < _PARALLEL, _PARALLEL, across)
            middle, reach = -p * (a * x + b * y) / across, q / jnp.abs(across)
            low, high = jnp.maximum(low, middle - reach), jnp.minimum(high, middle + reach)
        high = jnp.maximum(low, high)
        distance = distance + p * (_part(p, high) - _part(p, low)) / 6
        area = area + 0.5 * p * (high - low)
    return distance / area


class BeltEdge(eqx.Module):
    """The edge of a belt of the `width` s [m] under a rectangle of `length` and `breadth` [m], with
    the mean distance c [m] of the whole rectangle, the same for a C_s in its middle, `centred` [m],
    and the square of its radius of gyration [m^2]."""

    width: Array
    length: Array
    breadth: Array
    mean_distance: Array
    centred: Array
    gyration: Array

    def __init__(self, belt: Belt, parcel: Parcel):
        self.width, self.length, self.breadth = belt.width, parcel.length, parcel.breadth
        self.mean_distance = parcel.mean_distance
        zero = jnp.zeros_like(belt.width + parcel.length)
        whole = parcel.length + parcel.breadth
        self.centred = strip_mean_distance(parcel.length, parcel.breadth, zero, whole)
        self.gyration = parcel.inertia / parcel.mass

    def carried(self, body: Body, weight: Array) -> Carried:
        """The part of the `weight` m_p g [N] that the belt carries. C_s is taken to be in the
        rectangle's middle, except for c of the whole rectangle."""
        inside = self.width - body.y
        beyond = jnp.maximum(-inside, 0.0)
        # Half of the edge inside the rectangle, on the shorter side of E.
        cosine, sine = jnp.cos(body.angle), jnp.sin(body.angle)
        half = jnp.inf * jnp.ones_like(inside)
        for (a, b), q in (((cosine, sine), self.length), ((-sine, cosine), self.breadth)):
            along = jnp.where(jnp.abs(a) < _PARALLEL, _PARALLEL, jnp.abs(a))
            half = jnp.minimum(half, (0.5 * q - jnp.abs(b) * beyond) / along)
        half = jnp.maximum(half, 0.0)
        strip = strip_mean_distance(self.length, self.breadth, body.angle, inside)
        mean = jnp.where(inside > _NEAR, strip, 0.5 * half)
        share = self.gyration / (self.gyration + beyond**2) * fade(FADE - half, FADE)
        return Carried(weight * share, mean * self.mean_distance / self.centred, beyond)
