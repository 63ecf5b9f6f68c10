"""The error of the derivatives of the fence's force by the steps that they are computed in.

A step takes the force N as linear in time. The error of the impulse is h^3 |N''| / 12, and that of
the impulse's derivative in a parameter p has N_p = dN/dp in the place of N. So until the force is
largest the errors of the steps add up to

    R = sum of h^3 |N_p''| / 12.

Where the belt lets the parcel go within a step, or stops it, friction changes by J. The impulse
then has a term of J times that instant, which is unknown within the step: its derivative lacks J
times that of the instant. J d^2 is taken for it, with d J the distance of friction from its line
inside the step: d^2 falls with the fourth power of a step that is short compared with the change,
and the error of the trapezoidal rule falls faster still. The derivative of the instant is that of
the instant at which the gap has its value at the step's end, -D_p / Ddot.

Where a step ends amid the fall from static to kinetic friction, as a corner on the fence comes to
rest or sets off, its sliding speed w has not been linear as the step assumes: the fall takes far
less time than a step. The effect on friction is taken to be what static friction adds at the
sample, times the instant's derivative -w_p / wdot, as far as the change of w in the step exceeds
the range of the fall. A corner that sticks in the next step has no such error: static friction
takes away whatever speed is left. The same estimate serves where a step ends within eps of rest as
friction reverses: there the step's equations begin to include the reversal, with a kink.

The error R of the impulse shows as an error of N_p at the rate at which N_p changes: e = R V / I,
with V the sum of |change of N_p| and I the integral of |N_p|. Sizes are summed, not signed terms,
which would cancel even where each is wrong.

Where friction reverses at the peak, as a corner stops on the fence, the force has a kink there. Its
derivative at the kink is between those on either side, depending on how fast the force rises before
and falls after it, which the parabola through three samples does not show. The error is taken as
the second difference of N_p there. Other kinks next to the peak, and the error of the parabola
without one, are in `peak_kink`.

A running sum of sizes of derivatives cannot be had by differentiating a function of the motion. It
is the tangent of a number that is always 0, as in `rivals`.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Smoothing
from ..model import BeltContact, mean_coefficient
from ..parts import AbstractFriction
from ..scenes import NormalScene
from .accumulators import FORCE, OVER_TIP, Accumulator, Step
from .peak import Peak, signed_second_difference
from .peak_kink import Parabola, missed_by_kink, third_difference
from .resolution import ends_over_tip
from .rivals import Rivals


class Sums(NamedTuple):
    """Numbers that are 0, whose derivatives are sums of sizes: of the steps' errors R [N s],
    `missed`; of the changes V of N_p [N], `varied`; and of the integral I of N_p [N s],
    `lasted`."""

    missed: Array
    varied: Array
    lasted: Array


class Slopes(NamedTuple):
    """The running state of the estimate.

    - `now`, `at_peak`: the sums so far, and those when the fence's force was largest.
    - `kink` [N]: a number that is 0, whose derivative is the size of the second difference of N_p
      where friction reverses at the peak's sample or a neighbour, and of the error of the parabola.
    - `since`: the number of steps since the force was largest.
    - `turned`: 1.0 where friction has reversed in the last step.
    - `parabolas`: those at the three samples before the last, the last one first.
    - `falls` [N s], by corner: numbers that are 0, whose derivatives are the sizes of the last
      step's errors of the impulses of friction at the fence.
    """

    now: Sums
    at_peak: Sums
    kink: Array
    since: Array
    turned: Array
    parabolas: tuple[Parabola, ...]
    falls: tuple[Array, ...]


class SlopeEvidence(NamedTuple):
    """The evidence on the error of the peak force's derivatives: the peak force [N] with its
    derivatives, the sums until then, the `kink` there, and other maxima that are about as high."""

    force: Array
    sums: Sums
    kink: Array
    rivals: Rivals

    @classmethod
    def of(cls, force: Peak, slopes: Slopes | None, rivals: Rivals | None) -> "SlopeEvidence":
        """From the running states; zeros where the error is not estimated."""
        if slopes is None or rivals is None:
            zero = jnp.zeros_like(force.value)
            return cls(force.value, Sums(*(zero,) * 3), zero, Rivals(*(zero,) * 4))
        return cls(force.value, slopes.at_peak, slopes.kink, rivals)


@jax.custom_jvp
def _with_size(total: Array, change: Array) -> Array:
    """`total`, to whose derivative the size of that of `change` is added."""
    del change
    return total


@_with_size.defjvp
def _(primals, tangents):
    total_dot, change_dot = tangents
    return primals[0], total_dot + jnp.abs(change_dot)


def _start(nothing, body) -> Slopes:
    del body
    sums, corners = Sums(*(nothing.time,) * 3), len(nothing.fence)
    parabolas, falls = (Parabola.start(nothing.time),) * 3, (nothing.time,) * corners
    return Slopes(sums, sums, *(nothing.time,) * 3, parabolas=parabolas, falls=falls)


def _friction_missed(step: Step) -> list[Array]:
    """Numbers [N s] whose derivatives are the step's errors of the derivative of the belt's
    impulse, one for each corner at the fence."""
    scene, now = step.scene, step.now
    if isinstance(scene, NormalScene) or scene.belt is None:
        return []
    belt, parcel, was, body, corners = jax.lax.stop_gradient(
        (scene.belt, scene.parcel, step.before.body, now.body, now.fence)
    )
    off, most, _ = BeltContact.of(belt, parcel).defect(step.smoothing, was, body)
    jump, found = off / jnp.sqrt(jnp.where(most > 0, most, 1.0)), []
    for still, corner in zip(corners, now.fence, strict=True):
        pressed = (still.normal > 0) & (still.gap_rate != 0)
        rate = jnp.where(pressed, jnp.abs(still.gap_rate), 1.0)
        found.append(jnp.where(pressed, jump / rate, 0.0) * corner.gap)
    return found


def _near_rest(friction: AbstractFriction, sliding: Array, smoothing: Smoothing) -> Array:
    """What static friction adds to the coefficient [1] at a sliding speed [m/s]."""
    mu, _ = friction.coefficient(sliding**2, smoothing.static_speed)
    return mu - mean_coefficient(friction, sliding, smoothing).smooth


def _turning(friction: AbstractFriction, sliding: Array, smoothing: Smoothing) -> Array:
    """The error of the coefficient [1] in a step's equations as friction reverses within eps of
    rest: eps^2 / (w^2 + eps^2) of the sliding one."""
    square = smoothing.slip_speed**2
    mu = mean_coefficient(friction, sliding, smoothing).smooth
    return mu * square / (sliding**2 + square)


class _Falls(NamedTuple):
    """Numbers whose derivatives are the errors of those of the impulse of friction at a corner of
    the fence: as it `sets_off` from rest in a step that ends or begins amid the fall from static to
    kinetic friction; where a step `ends` amid it, or as friction reverses; and where the step
    before ended so and the corner then `slides_on`."""

    sets_off: Array
    ends: Array
    slides_on: Array


def _falls_missed(state: Slopes, step: Step) -> list[_Falls]:
    """The step's errors where it passes the fall from static to kinetic friction, by corner."""
    scene, found = step.scene, []
    if isinstance(scene, NormalScene) or scene.fence_friction is None:
        return found
    friction, rests = jax.lax.stop_gradient(scene.fence_friction), step.smoothing.holds_below
    for corner, moving, ended in zip(step.before.fence, step.now.fence, state.falls, strict=True):
        was, now = jax.lax.stop_gradient((corner, moving))
        change = jnp.abs(now.sliding - was.sliding)
        some = (was.normal > 0) & (now.normal > 0) & (change > 0)
        lasts = jnp.where(some, step.span.length / jnp.where(some, change, 1.0), 0.0)
        lasts = lasts * change**2 / (change**2 + step.smoothing.static_speed**2)
        slides = jnp.abs(now.sliding) > rests

        def missed(share, sample, own, counts, lasts=lasts):
            more = sample.normal * share(friction, sample.sliding, step.smoothing)
            return jnp.where(counts, more * lasts, 0.0) * own.sliding

        # A sample at rest has an error where the corner sets off from it, not where it sticks.
        rested = jnp.abs(was.sliding) <= rests
        on = slides | (now.normal <= 0)
        found.append(
            _Falls(
                missed(_near_rest, was, corner, slides & rested),
                missed(_near_rest, now, moving, slides)
                + missed(_turning, now, moving, ~rested),
                jnp.where(on, ended, 0.0),
            )
        )
    return found


def _turned(step: Step) -> Array:
    """1.0 where a corner in contact with the fence has come to rest on it in this step, has
    reversed or has broken away."""
    rests = step.smoothing.holds_below
    found = jnp.zeros_like(step.now.time)
    for was, now in jax.lax.stop_gradient(
        tuple(zip(step.before.fence, step.now.fence, strict=True))
    ):
        pressed = (was.normal > 0) & (now.normal > 0)
        stops = (jnp.abs(was.sliding) < rests) != (jnp.abs(now.sliding) < rests)
        turns = stops | (was.sliding * now.sliding < 0)
        found = jnp.where(pressed & turns, 1.0, found)
    return found


def _update(state: Slopes, step: Step) -> Slopes:
    known, new, span = step.known["force"], step.now.fence_force, step.span
    second = signed_second_difference(known.before, known.now, new, span, step.second)
    missed = jnp.where(ends_over_tip(step), 0.0, span.length / 12 * second)
    changes = Sums(missed, jnp.where(span.first, 0.0, new - known.now), span.length * new)
    now = Sums(*map(_with_size, state.now, changes))
    falls = _falls_missed(state, step)
    of_falls = [more for each in falls for more in (each.sets_off, each.slides_on)]
    for more in _friction_missed(step) + of_falls:
        now = now._replace(missed=_with_size(now.missed, more))
    # Without friction the state is unchanged.
    ends = tuple(_with_size(jnp.zeros_like(new), each.ends) for each in falls) or state.falls
    higher = new > known.value
    at_peak = jax.tree.map(lambda old, sums: jnp.where(higher, sums, old), state.at_peak, now)
    since = jnp.where(higher, 0.0, state.since + 1)
    turned = _turned(step)
    inside = ~ends_over_tip(step)
    near = (since <= 2) & (turned + state.turned > 0) & inside
    kink = _with_size(jnp.where(higher, 0.0, state.kink), jnp.where(near, second, 0.0))
    c, b, a = state.parabolas
    d = Parabola.of(known.before, known.now, new, second, span)
    third = third_difference(c, d)
    of_b, of_c = missed_by_kink(a, b, c, d)
    # By the number of steps since the peak's sample.
    for ago, missed in (
        (1, d.next_term(third)), (2, c.next_term(third)), (2, of_c), (3, of_b),
    ):  # fmt: skip
        kink = _with_size(kink, jnp.where(inside & (since == ago), missed, 0.0))
    return Slopes(now, at_peak, kink, since, turned, (d, c, b), ends)


SLOPES = Accumulator("slopes", _start, _update, needs=(FORCE, OVER_TIP))
"""For forward mode: in reverse mode a derivative must be linear in the derivatives before it."""


def relative_error(columns: SlopeEvidence, values: SlopeEvidence, at: Array) -> Array:
    """Estimated error of the peak force's gradient [1], relative to its norm, or to the force if
    that is larger. It is the largest of three: the error by the steps, the difference from the
    derivatives of other maxima about as high, and the error of the parabola at the peak.

    `columns` are the derivatives in numbers whose values are `at`, each of the shape (numbers,).
    The norm is that of the derivatives times these values. Each of these products is limited to the
    size of the force. Otherwise two numbers whose effects nearly cancel would dominate it, such as
    the fence's length and the place of the impact: each alone changes the force by up to twenty
    times its value, both together hardly.
    """
    some = values.force > 0
    scale = jnp.where(some, at / jnp.where(some, values.force, 1.0), 0.0)
    along = scale * columns.force
    counts = 1 / jnp.maximum(jnp.abs(along), 1.0)

    def norm(shares: Array) -> Array:
        return jnp.sqrt(jnp.sum((counts * shares) ** 2))

    missed, varied, lasted = columns.sums
    ever = lasted > 0
    by_steps = norm(scale * jnp.where(ever, missed * varied / jnp.where(ever, lasted, 1.0), 0.0))
    _, _, least, most = columns.rivals
    by_rivals = norm(scale * jnp.maximum(most - columns.force, columns.force - least))
    rivals = values.rivals.largest >= (1 - values.rivals.apart) * values.force
    off = jnp.maximum(by_steps, jnp.where(rivals, by_rivals, 0.0))
    off = jnp.maximum(off, norm(scale * columns.kink))
    return off / jnp.maximum(norm(along), 1.0)
