"""Second-order loads: the modal forces of a contact force on the bent fence.

With U on the chain of chords, of the lengths d_k and the angles theta_k, delta_k = theta_k - w' the
angles against the tangent at U, and rho = F_f / N, the virtual work of the force at U is, per
newton of N,

    -Q_i / N = sum_k (cos delta_k + rho sin delta_k) Delta phi_i,k + rho E_i,

Delta phi_i,k the mode's differences along the chords. Friction acts at the face, half the thickness
off the neutral axis: E_i is the integral of (h / 2) phi_i'', which, with h straight along each
chord, is (h / 2) phi_i' at U less the sum of Delta phi_i,k times the chords' slopes of h / 2. In
the frame of the rigid link the force on the fence per newton is (along, -across), along = sin w' +
rho cos w' and across = cos w' - rho sin w'. Its moment about the hinge is across x_U + along y_U,
and that about node j, per newton of N,

    M_j = sum_(k >= j) d_k (cos delta_k + rho sin delta_k) + rho h / 2.

Where only some of the loads act, the others' parts are those of a straight
fence.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from ..parts import SecondOrderLoads

# Least part of an element [1] that the angle of the chord to U is computed with. With a shorter
# chord the difference that its rotation makes is negligible.
_SHORT = 1e-6


class Chords(NamedTuple):
    """The chords from the root to U at the arc coordinate `place` sigma [m]: `inside` says which
    nodes are before U, (n + 1,), `lengths` d_k [m] and `angles` theta_k [rad] are those of the
    chords, (n,), those beyond U of no length; `tapers` are their slopes of h / 2 [1]; and the
    `slope` w' [rad] and half the thickness [m] at U."""

    place: Array
    inside: Array
    lengths: Array
    angles: Array
    tapers: Array
    slope: Array
    half_thickness: Array

    @classmethod
    def to(
        cls, place: Array, position: Array, size: Array, deflection: tuple[Array, Array],
        slope: Array, half_thickness: tuple[Array, Array],
    ) -> "Chords":
        """The chords to U at the `position` [1], in elements of the `size` [m], by the deflections
        [m] and half the thicknesses [m] of the nodes and at U, and the slope there."""
        nodes, end = deflection
        numbers = jnp.arange(nodes.shape[0], dtype=nodes.dtype)
        inside = numbers <= position
        part = jnp.clip(position - numbers[:-1], 0.0, 1.0)
        divisor = size * jnp.maximum(part, _SHORT)
        angles = jnp.diff(jnp.where(inside, nodes, end)) / divisor
        tapers = jnp.diff(jnp.where(inside, *half_thickness)) / divisor
        return cls(place, inside, size * part, angles, tapers, slope, half_thickness[1])

    def rises(self, table: Array, end: Array) -> Array:
        """The difference of a `table` over the nodes, (n + 1,) or (n + 1, m), along each chord,
        with its value `end` at U."""
        inside = self.inside if table.ndim == 1 else self.inside[:, None]
        return jnp.diff(jnp.where(inside, table, end), axis=0)


class Following(NamedTuple):
    """A contact force that follows the bent fence, per newton: its `arm` about the hinge [m]; and
    the differences from a force across a straight fence of its moment at the nodes' sections,
    `moment` [m], (n,), of its share in each chord's rotation, `turns` [1], (n,), and of the
    `couple` [m] at U."""

    arm: Array
    moment: Array
    turns: Array
    couple: Array

    def load(self, chords: Chords, table: Array, end: Array, slope: Array) -> Array:
        """The modes' share of the load beyond phi_i [1], from a `table` of the modes over the nodes
        and their values `end` and slopes [1/m] at U."""
        rises = chords.rises(table, end)
        turns = self.turns if table.ndim == 1 else self.turns[:, None]
        return jnp.sum(turns * rises, axis=0) + self.couple * slope


def following(loads: SecondOrderLoads, chords: Chords) -> tuple[Following, Following]:
    """The normal force at the end of the chords, and the friction there."""
    zero = jnp.zeros_like(chords.place)
    delta = chords.angles - chords.slope
    cosine, sine = jnp.cos(chords.slope), jnp.sin(chords.slope)
    x = chords.place - jnp.sum(chords.lengths * (1 - jnp.cos(chords.angles)))
    y = jnp.sum(chords.lengths * jnp.sin(chords.angles))
    arm, turns = chords.place, jnp.zeros_like(delta)
    if loads.normal_force:
        arm, turns = cosine * x + sine * y, jnp.cos(delta) - 1
    normal = Following(arm, _beyond(chords.lengths * turns), turns, zero)
    arm, turns = zero, jnp.zeros_like(delta)
    if loads.friction_force:
        arm, turns = cosine * y - sine * x, jnp.sin(delta)
    couple = zero
    if loads.friction_moment:
        turns, couple = turns - chords.tapers, chords.half_thickness
    moment = _beyond(chords.lengths * turns) + jnp.where(chords.lengths > 0, couple, 0.0)
    return normal, Following(arm, moment, turns, couple)


def _beyond(parts: Array) -> Array:
    """The sum of `parts` over the chords from each node to U."""
    return jnp.cumsum(parts[::-1])[::-1]
