"""The flexible link's curve at rest, as the geometry of the bent fence needs it.

With w_0' the slope at rest and w' that of the bending, an arc brings a point back to the hinge by
the integral of (w_0' + w')^2 / 2 and down by that of (w_0' + w')^3 / 6. Beside what each has alone
there are

    short: sum_i q_i I_i,  I_i = integral of w_0' phi_i',
    lower: q_1 A + q_1^2 B,  A = integral of w_0'^2 phi_1' / 2,  B = integral of w_0' phi_1'^2 / 2,

with phi_1 alone in the third order, as in `fencejax.model.fence_geometry.arc`.
"""

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..parts import Fence, RestLine, RestShape
from .beam import BeamTables, integrated
from .fence_geometry import Arc
from .mode_shapes import cubics, entry


class Rest(NamedTuple):
    """The rest shape at one place: its `line`, and what it adds to an arc by the amplitudes of the
    modes, I_i [1], and of the first alone A [1] and B [1/m]; empty unless the geometry needs
    them."""

    line: RestLine
    pairs: tuple[Array, ...]
    cubes: tuple[Array, ...]

    def bent(self, arc: Arc, q: Sequence[Array], v: Sequence[Array]) -> Arc:
        """An `arc` of a fence that is straight at rest, corrected for this rest shape; `q` [m] and
        `v` [m/s] are the amplitudes of the first modes and their rates."""
        short, lower, short_rate, lower_rate = arc
        for pair, amplitude, rate in zip(self.pairs, q, v, strict=True):
            short, short_rate = short + pair * amplitude, short_rate + pair * rate
        linear, square = self.cubes
        lower = lower + q[0] * (linear + square * q[0])
        lower_rate = lower_rate + v[0] * (linear + 2 * square * q[0])
        return Arc(short + self.line.short, lower + self.line.lower, short_rate, lower_rate)


class RestTable(eqx.Module):
    """A fence's rest `shape` on a flexible link of the `length` l_p [m]: its deflection [m] and
    slope in x / l_p [m] at the nodes, (n + 1,) each, and the elements' polynomials of its
    integrals."""

    shape: RestShape
    length: Array
    deflection: Array
    slope: Array
    columns: tuple[tuple[Array, ...], ...]

    def __init__(self, fence: Fence, tables: BeamTables, arc_modes: int):
        """`tables` are those of the clamped link; an arc takes its first `arc_modes`."""
        assert fence.rest_shape is not None
        self.shape, self.length = fence.rest_shape, fence.flexible_length
        elements = tables.deflection.shape[0] - 1
        nodes = jnp.asarray(np.arange(elements + 1) / elements, dtype=self.length.dtype)
        line = self.shape.at(nodes, self.length)
        self.deflection, self.slope = line.deflection, line.slope * self.length
        self.columns = ()
        if arc_modes:
            # Slopes in x / l_p: w_0', and those of the modes. Both are cubic in each element.
            own = jnp.stack([line.deflection / self.length, line.slope], -1)
            first = [tables.deflection[:, :arc_modes], tables.slope[:, :arc_modes]]
            modes = jnp.stack([jnp.asarray(part) for part in first], 1)
            modes = modes.reshape(2 * (elements + 1), -1)
            full = jnp.concatenate([own.reshape(-1, 1), modes], axis=1)
            parts = integrated(_products, full, jnp)
            scales = [*([1.0] * (arc_modes + 1)), 1 / self.length]
            self.columns = tuple(
                tuple(scale * part[:, 0] for part in cubics(table[:, :1], table[:, 1:], elements))
                for scale, table in zip(scales, jnp.moveaxis(parts, 1, 0), strict=True)
            )

    def at(self, share: Array, index: Array, s: Array) -> Rest:
        """The rest shape at the `share` x / l_p [1], in the element `index` at its local coordinate
        s [1]."""
        found = []
        for column in self.columns:
            a, b, c, d = (entry(part, index) for part in column)
            found.append(a + s * (b + s * (c + s * d)))
        line = self.shape.at(share, self.length)
        return Rest(line, tuple(found[:-2]), tuple(found[-2:]))


def _products(slopes: Array) -> Array:
    """w_0' phi_i' of each mode, w_0'^2 phi_1' / 2 and w_0' phi_1'^2 / 2, by w_0' and the phi_i' in
    the last axis."""
    own, modes = slopes[..., :1], slopes[..., 1:]
    first = modes[..., :1]
    return jnp.concatenate([own * modes, 0.5 * own**2 * first, 0.5 * own * first**2], -1)
