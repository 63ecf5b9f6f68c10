"""Error control: a step whose defect is too large is repeated with a shorter length.

The defect of a step (`step_defect`) is compared with what is allowed of a contact's force: the
share `Fidelity.step_tolerance` of the largest force so far, or the force that changes the speed of
approach by a tenth of that share, whichever is larger, as at the first contact there is no force
yet to compare with. So one number bounds the error that each step may add, and a search for large
errors finds them in proportion to it (`tests/robustness/search.py`).

The defect of a contact's friction is compared with the same share of the largest normal force. It
makes steps short where sliding comes to rest. The peak force hardly depends on them there, but its
derivatives do, as the time of rest moves with the parameters. Where even the shortest steps exceed
what is allowed of friction, they are accepted: the status `STEP_TOO_COARSE` depends on the defects
of normal forces alone. The same holds for a contact that begins to end at the fence's tip; and for
the belt's friction, with a share of that friction itself, where the parcel lets go of the belt or
its slip reverses, before the first contact too: from a slip that the belt should have ended,
another motion follows.

A step whose equations Newton's method has not solved is repeated as well: over a shorter step, the
friction at sticking corners is less stiff compared with the inertia.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..model import BeltDefect, FenceState, Forces, force_tolerance
from ..parts import AbstractFriction
from .fence_response import FenceResponse
from .step_defect import INNER, ContactData, Ends, defects, friction_defect, share_defect
from .step_size import Clock, StepSize, Stride, is_whole

# Share of the tolerance by which a defect may change the speed of approach.
_OF_SPEED = 0.1
# Share of itself by which the belt's friction may differ from its line inside a step, as it does
# where a parcel lets go of the belt and where its slip reverses (by an angle a of 0.08 rad: by 3
# a^2 / 32). Depending on where in the step the instant is, the speed changes by this share of mu g
# h or not. So the derivative of the speed in that instant is off by this share of mu g, however
# short the steps: by 0.1 % for this share, for an approach at 1.5 m/s that begins after 0.35 s,
# later in proportion to a drive's speed. Where static friction is largest it changes little and the
# slip much: a parcel that is pressed off the belt by a load that grows for a time T lets go early
# or late by up to this share of T. How much depends on where in a step of h the instant is, so the
# derivative of the instant is off by this share times T / h, 6 % for 25 ms and 0.25 ms. With four
# times this share a search found derivatives that were off by a third. The belt's share is never
# more than twenty tolerances of the steps.
_OF_BELT, _IN_TOLERANCES = 0.0006, 20.0
# Where the belt's friction falls as the slip grows, by k [N s/m], the slip and its derivatives grow
# as exp(2 z), z = k h / (2 m), in a step. By the trapezoidal rule they grow as (1 + z) / (1 - z),
# which is more by 2 z^3 / 3, 0.07 % for this limit of z, and without bound as z goes to 1. At a
# quarter, where it is 1 %, the derivatives of the instant at which a parcel lets go were off by a
# twentieth.
_GROWS = 0.1
# The next step may be twice as long if the defect, times this number, is allowed. The defect of a
# smooth force grows with the square of the step, by four; the rest is a margin.
_GROWTH = 6.0


class Control(NamedTuple):
    """The state of error control: whether the last trial was `accepted` (1.0 or 0.0), the `largest`
    contact force so far [N], the sum of the `allowed` errors of the steps in contact [N s], the
    `excess` over it by the steps of the shortest length [N s], and the contacts at the end of the
    last step."""

    accepted: Array
    largest: Array
    allowed: Array
    excess: Array
    ends: tuple[Ends, ...]

    @classmethod
    def start(
        cls, frictions: tuple[AbstractFriction | None, ...], ending: int, zero: Array
    ) -> "Control":
        """Before the first step of a scene with contacts of these `frictions`, the first `ending`
        of which may end at the fence's tip."""
        ends = tuple(
            Ends(
                zero, zero, zero, zero if k < ending else None,
                *(() if friction is None else (zero, zero)),
            )
            for k, friction in enumerate(frictions)
        )  # fmt: skip
        return cls(zero + 1, zero, zero, zero, ends)

    @property
    def unmet(self) -> Array:
        """Whether the excess of the steps' errors is larger than the errors allowed in all."""
        return self.excess > self.allowed


def contacts(
    forces: Forces,
    shares: tuple[Array, ...],
    frictions: tuple[AbstractFriction | None, ...],
) -> tuple[Ends, ...]:
    """The contacts as the control of the next step needs them. `shares` [1] are those of the
    contact law that act at the fence's corners."""
    found = []
    for k, (what, touch, _, _) in enumerate(forces.meetings):
        share = touch.remaining(shares[k]) if k < len(shares) else None
        rubs = () if frictions[k] is None else (what.friction, what.sliding)
        found.append(Ends(what.normal, what.gap, what.gap_rate, share, *rubs))
    return tuple(found)


def _ratio(found: Array, allowed: Array) -> Array:
    """A defect over the allowed one [1]; 0 where nothing is allowed yet."""
    some = allowed > 0
    return jnp.where(some, found / jnp.where(some, allowed, 1.0), 0.0)


def _defect_ratios(
    contact: ContactData,
    tolerance: float,
    clock: Clock,
    before: Control,
    stride: Stride,
    count: Array,
    now: tuple[Ends, ...],
    fence: FenceResponse | None,
    was: FenceState | None,
    after: FenceState | None,
    prediction_errors: tuple[Array, ...],
) -> tuple[Array, Array, Array, Array]:
    """Four numbers: the largest ratio [1] of a normal force's defect to the allowed one; the
    largest such ratio of what only makes steps shorter (frictions, and forces that end at the tip);
    the largest allowed defect [N]; and the largest force so far [N]."""
    strides = tuple(clock.stride(theta * count) for theta in INNER)
    found = defects(contact, strides, stride.length, before.ends, now, fence, was, after)
    largest = before.largest
    for each in now:
        largest = jnp.maximum(largest, each.normal)
    force_ratio = most = jnp.zeros_like(largest)
    # The residual of the Newton iteration is no defect of the step.
    tolerance = max(tolerance, 2 * force_tolerance(largest.dtype))
    for k, (force, a, b) in enumerate(zip(found, before.ends, now, strict=True)):
        speed = jnp.maximum(jnp.abs(a.gap_rate), jnp.abs(b.gap_rate))
        give_rate = 0.5 * stride.length / contact.mass
        if fence is not None and fence.flexible and k < len(fence.shapes):
            give_rate = give_rate + fence.compliance(k, k, b.normal)[1]
        slows = give_rate > 0
        by_speed = _OF_SPEED * speed / jnp.where(slows, give_rate, 1.0)
        allowed = tolerance * jnp.maximum(largest, jnp.where(slows, by_speed, 0.0))
        force_ratio = jnp.maximum(force_ratio, _ratio(force, allowed))
        touches = (a.normal > 0) | (b.normal > 0)
        most = jnp.maximum(most, jnp.where(touches, allowed, 0.0))
    other_ratio = jnp.zeros_like(largest)
    for a, b in zip(before.ends, now, strict=True):
        other_ratio = jnp.maximum(other_ratio, _ratio(share_defect(a, b), tolerance * largest))
    for off in prediction_errors:
        other_ratio = jnp.maximum(other_ratio, _ratio(jnp.abs(off), tolerance * largest))
    for friction, a, b in zip(contact.frictions, before.ends, now, strict=False):
        if friction is not None:
            assert contact.smoothing is not None
            off = friction_defect(friction, contact.smoothing, a, b)
            other_ratio = jnp.maximum(other_ratio, _ratio(off, tolerance * largest))
    # No shorter step makes a non-finite state finite.
    force_ratio, other_ratio = (
        jnp.where(jnp.isfinite(found), found, 0.0) for found in (force_ratio, other_ratio)
    )
    return force_ratio, other_ratio, most, largest


def controlled(
    contact: ContactData,
    tolerance: float,
    clock: Clock,
    before: Control,
    proposed: StepSize,
    end: Array,
    stride: Stride,
    now: tuple[Ends, ...],
    fence: FenceResponse | None,
    was: FenceState | None,
    after: FenceState | None,
    unsolved: Array | bool = False,
    belt: BeltDefect | None = None,
    prediction_errors: tuple[Array, ...] = (),
) -> StepSize:
    """Whether the step of `proposed.last` that ends at `end`, with the contacts `now`, is accepted,
    and the length of the next trial. Up to the clock's unit the length follows from the defect
    alone; beyond it, it is also at most `proposed.next`.

    The fence, if any, was in the state `was` and is in the state `after`. `unsolved` is whether the
    step's equations are not balanced, `belt` is the result of `BeltContact.defect` (`None` without
    a belt), and `prediction_errors` [N] are the errors of the bending forces at the corners that
    the step was computed with. The result has no derivative.
    """
    count = proposed.last
    force_ratio, other_ratio, allowed, largest = _defect_ratios(
        contact, tolerance, clock, before, stride, count, now, fence, was, after, prediction_errors
    )
    if belt is not None and now:
        of_belt = min(_OF_BELT, _IN_TOLERANCES * tolerance)
        square = jnp.maximum((tolerance * largest) ** 2, of_belt**2 * belt.magnitude)
        growth = 0.5 * stride.length * belt.fall / contact.mass
        over = jnp.maximum(jnp.sqrt(_ratio(belt.deviation, square)), growth / _GROWS)
        other_ratio = jnp.maximum(other_ratio, jnp.where(jnp.isfinite(over), over, 0.0))
    worst = jnp.maximum(force_ratio, other_ratio)
    unsolved = jnp.asarray(unsolved)
    first, shortest = count == 0, count <= 1
    accepted = ((worst <= 1) & ~unsolved) | shortest
    grown = (worst * _GROWTH < 1) & is_whole(end, 2 * count)
    step = jnp.where(grown, 2 * count, count)
    step = jnp.minimum(step, jnp.maximum(proposed.next, clock.unit))
    # Steps begin at multiples of their length, so that a step ends at each of the clock's units.
    for longer in reversed([each for each in clock.counts if each > clock.unit]):
        step = jnp.where((step >= longer) & ~is_whole(end, longer), longer / 2, step)
    # The defect goes with the square of the length, at least where the force is smooth.
    shorter = jnp.where(worst > 256, 0.125, jnp.where((worst > 16) | unsolved, 0.25, 0.5))
    step = jnp.where(accepted, step, jnp.maximum(shorter * count, 1.0))
    step = jnp.where(first, float(clock.unit), step)
    allowed_impulse = jnp.where(first, 0.0, stride.length * allowed)
    control = Control(
        accepted=accepted.astype(step.dtype),
        largest=largest,
        allowed=before.allowed + allowed_impulse,
        excess=before.excess + allowed_impulse * jnp.maximum(force_ratio - 1, 0.0),
        ends=now,
    )
    return jax.lax.stop_gradient(StepSize(count, step, control))
