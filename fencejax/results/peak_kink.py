"""The error of a peak's derivatives by the parabola through three samples, also next to a kink.

The parabola through the sample at which the force N is largest and its two neighbours gives the
peak and, by its derivatives N_p at the three, the peak's derivative. It misses the next term of
Newton's series of N_p, with its divided differences,

    (t - t_1) (t - t_2) (t - t_3) N_p[t_0, t_1, t_2, t_3],

t between the sample and half a step from it, on the vertex' side. Both such terms, with the sample
before and with that after the three, are included.

Where the force has a kink in a step next to the peak's sample, as where the fence's tip begins to
take the contact over, N_p jumps in that step. The second divided differences b and c of the force
at the step's ends include the kink; those at the samples before and after, a and d, do not. So

    1 - (|a| + |d|) / |b + c|,

from 0 to 1, is the share of the kink in the second differences: nearly 0 for a force that is smooth
on the scale of the steps. With the differences a_p ... d_p of N_p, the step's length h, those of
the steps before and after it, h_0 and h_1, and the spans s_1, s_2, s_3 of the four samples about
each of the three steps, a jump J contributes to the third divided differences

    (b_p - a_p) / s_1 = J / (h (h_0 + h) s_1),
    (d_p - c_p) / s_3 = J / (h (h + h_1) s_3),
    (c_p - b_p) / s_2 = -J / (h s_2) (1 / (h_0 + h) + 1 / (h + h_1)).

The mean of the first two less the last one gives J; a cubic, of which all three are the same, has
none.

Where the force, extrapolated from either side, rises to the step and falls after it, the kink is
the peak. Its derivative is between those on either side, depending on how fast the force rises and
falls. The parabola does not show that, and may be off by all of the jump. Otherwise the peak is
next to the kink, and only the sample beyond the kink is off by the jump: it counts by its weight in
the parabola.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .peak import Span


def _quotient(value: Array, by: Array) -> Array:
    """`value / by`; 0 where `by` is 0."""
    some = by != 0
    return jnp.where(some, value / jnp.where(some, by, 1.0), 0.0)


class Parabola(NamedTuple):
    """The parabola of a force through a sample and its two neighbours: the second divided
    `difference` [N/s^2], with its derivatives; the lengths of the steps `before` and `after` the
    sample [s]; and the mean rates of change of the force in these, `came` and `went` [N/s]."""

    difference: Array
    before: Array
    after: Array
    came: Array
    went: Array

    @classmethod
    def start(cls, zero: Array) -> "Parabola":
        return cls(*(zero,) * 5)

    @classmethod
    def of(cls, before: Array, now: Array, new: Array, second: Array, span: Span) -> "Parabola":
        """The parabola at the sample `now`, from its neighbours and their `second` difference for
        the length of the last step, whose `span` this is."""
        length = span.length
        first = span.ratio * length
        rates = _quotient(now - before, first), _quotient(new - now, length)
        rates = jax.lax.stop_gradient(rates)
        return cls(_quotient(second, 2 * length**2), first, length, *rates)

    def vertex(self) -> Array:
        """Time of the parabola's vertex after this sample [s]."""
        curve = jax.lax.stop_gradient(self.difference)
        return -0.5 * _quotient(self.came + curve * self.before, curve)

    def next_term(self, third: Array) -> Array:
        """The next term [N] of Newton's series, half a step from this sample on the vertex' side,
        by the `third` divided difference [N/s^3], which the parabola leaves out."""
        opposite, near = self._steps(self.vertex() > 0)
        return 0.25 * near**2 * (opposite + 0.5 * near) * third

    def _steps(self, after: Array | bool) -> tuple[Array, Array]:
        """The lengths [s] of the step on the opposite side, and of that on the side `after` the
        sample, or before it."""
        first, last = self.before, self.after
        return jnp.where(after, first, last), jnp.where(after, last, first)

    def weight(self, after: bool) -> Array:
        """The weight [1] of the sample `after` this one, or before it, in the value at the
        parabola's vertex; at most 1 in size."""
        opposite, near = self._steps(after)
        vertex = self.vertex() if after else -self.vertex()
        weight = _quotient(vertex * (vertex + opposite), near * (opposite + near))
        return jnp.minimum(jnp.abs(weight), 1.0)


def span(last: Parabola, next_: Parabola) -> Array:
    """The time between the first and the last of the four samples about two neighbours [s]."""
    return last.before + last.after + next_.after


def third_difference(last: Parabola, next_: Parabola) -> Array:
    """The third divided difference over the four samples about two neighbours [N/s^3]."""
    return _quotient(next_.difference - last.difference, span(last, next_))


def missed_by_kink(a: Parabola, b: Parabola, c: Parabola, d: Parabola) -> tuple[Array, Array]:
    """The errors [N] by a kink in the step from the second to the third of four samples: of a peak
    at the second sample, and of one at the third."""
    here = jax.lax.stop_gradient([each.difference for each in (a, b, c, d)])
    outside = jnp.abs(here[0]) + jnp.abs(here[3])
    share = jnp.where(outside > 0, 1 - _quotient(outside, jnp.abs(here[1] + here[2])), 1.0)
    rises = b.came + here[0] * b.before > 0
    falls = c.went - here[3] * c.after < 0
    one = jnp.ones_like(b.after)
    begins, ends = (_quotient(one, (each.before + each.after) * b.after) for each in (b, c))
    by_jump = 0.5 * (_quotient(begins, span(a, b)) + _quotient(ends, span(c, d)))
    by_jump = by_jump + _quotient(begins + ends, span(b, c))
    beside = 0.5 * (third_difference(a, b) + third_difference(c, d))
    jump = jnp.clip(share, 0.0, 1.0) * _quotient(beside - third_difference(b, c), by_jump)
    at_second, at_third = (
        jnp.where(rises & falls, 1.0, weight)
        for weight in (b.weight(after=True), c.weight(after=False))
    )
    return at_second * jump, at_third * jump
