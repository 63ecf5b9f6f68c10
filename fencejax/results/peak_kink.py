"""What a parabola through three samples misses of the derivatives of a peak, beside a kink.

The parabola through the sample at which the force N is largest and its two neighbours gives the
peak and, by its derivatives N_p at the three, the peak's derivative. It misses the next term of
Newton's series of N_p, with its divided differences,

    (t - t_1) (t - t_2) (t - t_3) N_p[t_0, t_1, t_2, t_3],

t between the sample and half a step from it, on the vertex' side. The two terms, with the samples
before and after the three, are both counted.

Where the force has a kink in a step beside the peak's sample, as where the fence's tip begins to
take the contact over, N_p jumps in that step. The second divided differences b and c of the force
at the step's ends show the kink, those at the samples before and after, a and d, do not. So

    1 - (|a| + |d|) / |b + c|,

from 0 to 1, is the share of a kink in how the force bends: next to none of a force that is even on
the scale of the steps. With the differences a_p ... d_p of N_p, the step's length h, those of the
steps before and after it, h_0 and h_1, and the spans s_1, s_2, s_3 of the four samples about each
of the three steps, a jump J makes of the third divided differences

    (b_p - a_p) / s_1 = J / (h (h_0 + h) s_1),
    (d_p - c_p) / s_3 = J / (h (h + h_1) s_3),
    (c_p - b_p) / s_2 = -J / (h s_2) (1 / (h_0 + h) + 1 / (h + h_1)).

The mean of the first two less the last one gives J; a cubic, of which all three are the same, has
none.

Where the force, as it goes on either side, rises to the step and falls after it, the kink is the
peak. Its derivative is between those on either side, by how soon the force rises and falls: the
parabola knows nothing of that, and may be off by all of the jump. Else the peak is beside the kink,
and only the sample beyond that is off by the jump: it counts by its weight in the parabola.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .peak import Span


def _over(value: Array, by: Array) -> Array:
    """0 where what divides is."""
    some = by != 0
    return jnp.where(some, value / jnp.where(some, by, 1.0), 0.0)


class Bend(NamedTuple):
    """How a force bends at a sample: its second divided `difference` [N/s^2] there, with its
    derivatives; the lengths of the steps `before` and `after` it [s], and how fast it `came` to the
    sample and `went` on from it in these [N/s]."""

    difference: Array
    before: Array
    after: Array
    came: Array
    went: Array

    @classmethod
    def start(cls, zero: Array) -> "Bend":
        return cls(*(zero,) * 5)

    @classmethod
    def of(cls, before: Array, now: Array, new: Array, second: Array, span: Span) -> "Bend":
        """At the sample `now`, from its neighbours and their `second` difference for the length of
        the last step, whose `span` this is."""
        length = span.length
        first = span.ratio * length
        rates = jax.lax.stop_gradient((_over(now - before, first), _over(new - now, length)))
        return cls(_over(second, 2 * length**2), first, length, *rates)

    def vertex(self) -> Array:
        """Of the parabola, after this sample [s]."""
        bend = jax.lax.stop_gradient(self.difference)
        return -0.5 * _over(self.came + bend * self.before, bend)

    def next_term(self, third: Array) -> Array:
        """Newton's series' next term [N] half a step from this sample on the vertex' side, with the
        `third` divided difference [N/s^3] that the parabola leaves out."""
        own, far = self._steps(self.vertex() > 0)
        return 0.25 * far**2 * (own + 0.5 * far) * third

    def _steps(self, after: Array | bool) -> tuple[Array, Array]:
        """The lengths [s] of the step away from a side, `after` the sample or not, and of that
        on it."""
        first, last = self.before, self.after
        return jnp.where(after, first, last), jnp.where(after, last, first)

    def weight(self, after: bool) -> Array:
        """That of the sample `after` this one, or before it, in the value at the parabola's vertex
        [1], at most 1 in size."""
        own, far = self._steps(after)
        vertex = self.vertex() if after else -self.vertex()
        return jnp.minimum(jnp.abs(_over(vertex * (vertex + own), far * (own + far))), 1.0)


def span(last: Bend, next_: Bend) -> Array:
    """Of the four samples about two neighbours [s]."""
    return last.before + last.after + next_.after


def third_difference(last: Bend, next_: Bend) -> Array:
    """The third divided difference over the four samples about two neighbours [N/s^3]."""
    return _over(next_.difference - last.difference, span(last, next_))


def missed_by_kink(a: Bend, b: Bend, c: Bend, d: Bend) -> tuple[Array, Array]:
    """What is missed for a kink [N] in the step from the second to the third of four samples: of a
    peak at the second one, and of one at the third."""
    here = jax.lax.stop_gradient([each.difference for each in (a, b, c, d)])
    outside = jnp.abs(here[0]) + jnp.abs(here[3])
    share = jnp.where(outside > 0, 1 - _over(outside, jnp.abs(here[1] + here[2])), 1.0)
    rises = b.came + here[0] * b.before > 0
    falls = c.went - here[3] * c.after < 0
    one = jnp.ones_like(b.after)
    begins, ends = (_over(one, (each.before + each.after) * b.after) for each in (b, c))
    by_jump = 0.5 * (_over(begins, span(a, b)) + _over(ends, span(c, d)))
    by_jump = by_jump + _over(begins + ends, span(b, c))
    beside = 0.5 * (third_difference(a, b) + third_difference(c, d))
    jump = jnp.clip(share, 0.0, 1.0) * _over(beside - third_difference(b, c), by_jump)
    at_second, at_third = (
        jnp.where(rises & falls, 1.0, weight)
        for weight in (b.weight(after=True), c.weight(after=False))
    )
    return at_second * jump, at_third * jump
