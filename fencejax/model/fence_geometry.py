"""The position of a point of the bent fence, in the frame that turns with the rigid link.

Three geometries: the paper's chain of chords; an arc, to the third order in the slope; and a small
deflection normal to the straight line.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from ..parts import turned


class FencePoint(NamedTuple):
    """A point of the fence in the frame that turns with the rigid link: position (x, y) [m],
    velocity (x_rate, y_rate) [m/s] relative to that frame, slope [rad]."""

    x: Array
    y: Array
    x_rate: Array
    y_rate: Array
    slope: Array


    def turned_by(self, angle: Array, rate: Array) -> "FencePoint":
        """The point of a rigid link that is ahead of the frame by an `angle` [rad] and turns in it
        at a `rate` [rad/s]."""
        axes = jnp.cos(angle), jnp.sin(angle)
        x, y = turned(axes, self.x, self.y)
        swept = self.x_rate - rate * self.y, self.y_rate + rate * self.x
        return FencePoint(x, y, *turned(axes, *swept), self.slope + angle)


class Arc(NamedTuple):
    """The terms that the small-deflection geometry leaves out: points of a bent fence are nearer to
    the hinge by `short` [m] and lower by `lower` [m]; and their rates [m/s]."""

    short: Array
    lower: Array
    short_rate: Array
    lower_rate: Array


def small_point(place: Array, deflection: Array, rate: Array, slope: Array) -> FencePoint:
    """U = sigma t_alpha + w n_alpha: a small deflection normal to the straight line.

    `place` sigma [m], `deflection` w [m], its `rate` [m/s] and the `slope` [rad] there.
    """
    return FencePoint(place, deflection, jnp.zeros_like(rate), rate, slope)


def arc(pairs: Sequence[Array], cube: Array, q: Sequence[Array], v: Sequence[Array]) -> Arc:
    """The displacements of a point back and down by an arc, and their rates.

    `pairs` [1/m] are the integrals of phi_i' phi_j' / 2 from the root to the point, i <= j, and
    `cube` [1/m^2] that of phi_1'^3 / 6; `q` and `v` are the amplitudes [m] of the first modes and
    their rates [m/s]. The second order includes all of them, the third order the first one.
    """
    short = short_rate = jnp.zeros_like(cube)
    at = 0
    for i in range(len(q)):
        for j in range(i, len(q)):
            short = short + pairs[at] * q[i] * q[j]
            short_rate = short_rate + pairs[at] * (q[i] * v[j] + v[i] * q[j])
            at += 1
    lower, lower_rate = cube * q[0] ** 3, 3 * cube * q[0] ** 2 * v[0]
    return Arc(short, lower, short_rate, lower_rate)


def arc_point(place: Array, arc: Arc, y: Array, y_rate: Array, slope: Array) -> FencePoint:
    """The chords' geometry in the limit of many elements, to the third order in the slope:
    U = (sigma - integral of w'^2 / 2, w - integral of w'^3 / 6), the integrals as `arc`; `y` and
    `y_rate` are the deflection [m] and its rate."""
    return FencePoint(
        place - arc.short, y - arc.lower, -arc.short_rate, y_rate - arc.lower_rate, slope
    )


def chord_angles(deflection: Array, size: Array) -> Array:
    """(q_3(k+1) - q_3(k)) / Delta l [rad]: the angles of the chords of all elements, by the
    deflections (n + 1,) [m] of the nodes and the length [m] of an element.

    Paper: (2.15).
    """
    return jnp.diff(deflection) / size


def partial_chord_angle(
    ends: tuple[Array, Array], slopes: tuple[Array, Array], s: Array, size: Array
) -> Array:
    """(q_3(d) - q_3(i)) / d [rad]: angle of the chord from node i to the point at d = s Delta l.

    It is the element's cubic divided by d, free of 0 / 0 at the node. `ends` are the deflections
    [m] of the element's nodes and `slopes` their slopes times its length `size` [m].

    Paper: (2.16).
    """
    (a, c), (b, d) = ends, slopes
    return (b + s * (3 * (c - a) - 2 * b - d) + s**2 * (2 * (a - c) + b + d)) / size


def chain(
    place: Array,
    index: Array,
    s: Array,
    lengths: tuple[Array, Array],
    deflection: Array,
    slope: Array,
) -> tuple[Array, Array]:
    """Position (x, y) [m] of the point at arc coordinate `place` [m] on the chain of chords:

        x = l_s + Delta l sum_{k < i} cos(theta_k) + d cos(theta_N),  y likewise with the sine.

    `index` is its element i and `s` = d / Delta l; `lengths` are l_s and l_p [m]; `deflection` [m]
    and `slope` [rad] those of the nodes (n + 1,). On the rigid link and beyond the tip the line
    goes on straight.

    Paper: (2.14). There in fixed axes, turned by alpha_w.
    """
    rigid, flexible = lengths
    elements = deflection.shape[0] - 1
    size = flexible / elements
    angles = chord_angles(deflection, size)
    whole = jnp.arange(elements, dtype=index.dtype) < index
    x = rigid + size * jnp.sum(jnp.where(whole, jnp.cos(angles), 0.0))
    y = size * jnp.sum(jnp.where(whole, jnp.sin(angles), 0.0))
    ends = deflection[index], deflection[index + 1]
    slopes = slope[index] / elements, slope[index + 1] / elements
    angle = partial_chord_angle(ends, slopes, s, size)
    before = jnp.minimum(place - rigid, 0.0)
    beyond = jnp.maximum(place - (rigid + flexible), 0.0)
    end_slope = slopes[1] / size
    return (
        x + s * size * jnp.cos(angle) + before + beyond * jnp.cos(end_slope),
        y + s * size * jnp.sin(angle) + beyond * jnp.sin(end_slope),
    )
