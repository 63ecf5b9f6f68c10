"""Error control: a step whose defect is too large is taken again, shorter; the next one follows.

The defect of a step (`step_defect`) is held against what is allowed of a contact's force: a share
of the largest one so far, `Fidelity.step_tolerance`, or what changes the speed of approach by a
tenth of that share, whichever is more: at the first touch there is no force yet to compare with. So
one number bounds what each step may add, and a search for large errors finds them in proportion to
it (`tests/robustness/search.py`).

The friction of a contact is held against the same share of the largest normal force. It asks for
short steps where sliding comes to rest: the peak force hardly minds what these bring, its
derivatives do, as the time of rest moves with the parameters. Where the shortest steps still miss
it, they are taken; only what normal forces miss makes the status `STEP_TOO_COARSE`. So it is with
the belt's friction, where the parcel lets go of it or its slip turns while the fence is touched: a
share of that friction itself. And so it is where a force begins to end at the fence's tip.

A step whose equations are not solved, as Newton's method has come to no end, is taken again as
well: friction that holds is less stiff over a shorter one, next to the inertia.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..model import BeltDefect, FenceState, Forces, force_tolerance
from ..parts import AbstractFriction
from .fence_response import FenceEnd
from .step_defect import INNER, Ends, Pair, defects, friction_defect, share_defect
from .step_size import Clock, StepSize, Stride, is_whole

# Share of the tolerance by which a defect may change the speed of approach.
_OF_SPEED = 0.1
# Share of itself by which the belt's friction may be off its line inside a step, as it is where a
# parcel lets go of the belt and where its slip turns (by 0.08 rad: by 3 a^2 / 32). It changes the
# speed by this share of mu g h, or not, as the instant falls in the step. So the speed's derivative
# in that instant is off by the share of mu g, however short the steps: next to an approach at 1.5
# m/s that begins after 0.35 s, later in proportion to a drive's speed, by 0.1 % for this one. Where
# static friction is largest it changes little and the slip much: a parcel that is pressed off the
# belt by a load that grows for a time T lets go early or late by up to this share of T. By how much
# hangs on where in a step of h that falls, so the instant's derivative is off by it times T / h, 6
# % for 25 ms and 0.25 ms. Of four times as much a search found derivatives off by a third for that.
# A tolerance so small that twenty of it are less is kept by the belt, too.
_OF_BELT, _IN_TOLERANCES = 0.0006, 20.0
# Where the belt's friction falls as the slip grows, by k [N s/m], the slip and its derivatives grow
# as exp(2 z), z = k h / (2 m), in a step: by the trapezoidal rule as (1 + z) / (1 - z), which is
# more by 2 z^3 / 3, 0.07 % for this one, and without bound as z comes to 1. By 1 %, a quarter, the
# instant at which a parcel lets go had derivatives off by a twentieth.
_GROWS = 0.1
# The defect of a smooth force goes with the square of the step: a step of twice the length has four
# times as much of it, with room for half as much again.
_GROWTH = 6.0


class Control(NamedTuple):
    """What the control carries from step to step: whether the last trial was `accepted` (1.0 or
    0.0), the `largest` contact force so far [N], the impulses [N s] that the steps in contact were
    `allowed` to miss and that those at their shortest missed in `excess` of it, and the contacts
    at the end of the last step."""

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
        """Whether the steps missed more, in excess of what is allowed, than what is allowed."""
        return self.excess > self.allowed


def contacts(
    forces: Forces,
    shares: tuple[Array, ...],
    frictions: tuple[AbstractFriction | None, ...],
) -> tuple[Ends, ...]:
    """What the control of the next step has to know of each contact; `shares` [1] of the contact
    law act at the fence's corners."""
    found = []
    for k, (what, touch, _, _) in enumerate(forces.meetings):
        share = touch.remaining(shares[k]) if k < len(shares) else None
        rubs = () if frictions[k] is None else (what.friction, what.sliding)
        found.append(Ends(what.normal, what.gap, what.gap_rate, share, *rubs))
    return tuple(found)


def _over(found: Array, allowed: Array) -> Array:
    """A defect over what is allowed of it [1]; 0 where nothing is yet."""
    some = allowed > 0
    return jnp.where(some, found / jnp.where(some, allowed, 1.0), 0.0)


def _judged(
    pair: Pair,
    tolerance: float,
    clock: Clock,
    before: Control,
    stride: Stride,
    count: Array,
    now: tuple[Ends, ...],
    fence: FenceEnd | None,
    was: FenceState | None,
    after: FenceState | None,
    unforeseen: tuple[Array, ...],
) -> tuple[Array, Array, Array, Array]:
    """The largest defect over what is allowed of it [1], of normal forces and of what only asks for
    short steps (frictions, and what happens to forces at the tip), the largest of what is allowed
    [N], and the largest force so far [N]."""
    strides = tuple(clock.stride(theta * count) for theta in INNER)
    found = defects(pair, strides, stride.length, before.ends, now, fence, was, after)
    largest = before.largest
    for each in now:
        largest = jnp.maximum(largest, each.normal)
    worst = most = jnp.zeros_like(largest)
    # What the Newton iteration leaves unbalanced is no defect of the step.
    tolerance = max(tolerance, 2 * force_tolerance(largest.dtype))
    for k, (force, a, b) in enumerate(zip(found, before.ends, now, strict=True)):
        speed = jnp.maximum(jnp.abs(a.gap_rate), jnp.abs(b.gap_rate))
        give_rate = 0.5 * stride.length / pair.mass
        if fence is not None and fence.flexible and k < len(fence.shapes):
            give_rate = give_rate + fence.compliance(k, k, b.normal)[1]
        slows = give_rate > 0
        by_speed = _OF_SPEED * speed / jnp.where(slows, give_rate, 1.0)
        allowed = tolerance * jnp.maximum(largest, jnp.where(slows, by_speed, 0.0))
        worst = jnp.maximum(worst, _over(force, allowed))
        touches = (a.normal > 0) | (b.normal > 0)
        most = jnp.maximum(most, jnp.where(touches, allowed, 0.0))
    asked = jnp.zeros_like(largest)
    for a, b in zip(before.ends, now, strict=True):
        asked = jnp.maximum(asked, _over(share_defect(a, b), tolerance * largest))
    for off in unforeseen:
        asked = jnp.maximum(asked, _over(jnp.abs(off), tolerance * largest))
    for friction, a, b in zip(pair.frictions, before.ends, now, strict=False):
        if friction is not None:
            assert pair.smoothing is not None
            off = friction_defect(friction, pair.smoothing, a, b)
            asked = jnp.maximum(asked, _over(off, tolerance * largest))
    # A state that is no longer finite has no step that helps.
    worst, asked = (jnp.where(jnp.isfinite(found), found, 0.0) for found in (worst, asked))
    return worst, asked, most, largest


def controlled(
    pair: Pair,
    tolerance: float,
    clock: Clock,
    before: Control,
    foreseen: StepSize,
    end: Array,
    stride: Stride,
    now: tuple[Ends, ...],
    fence: FenceEnd | None,
    was: FenceState | None,
    after: FenceState | None,
    unsolved: Array | bool = False,
    belt: BeltDefect | None = None,
    unforeseen: tuple[Array, ...] = (),
) -> StepSize:
    """Whether the step of `foreseen.last` that came to `end`, with the contacts `now`, is accepted,
    and how long the next trial is: up to the clock's unit by the defect, beyond it at most
    `foreseen.next` too.

    The fence, if any, was in the state `was` and is in the state `after`; `unsolved` is whether the
    step's equations are left out of balance; `belt` is what `BeltContact.defect` gives, `None`
    without a belt; `unforeseen` [N] is how far what bends the fence at each corner was from what
    the step took it to be. No derivative follows from it.
    """
    count = foreseen.last
    missed_force, asked, allowed, largest = _judged(
        pair, tolerance, clock, before, stride, count, now, fence, was, after, unforeseen
    )
    if belt is not None and now:
        of_belt = min(_OF_BELT, _IN_TOLERANCES * tolerance)
        square = jnp.maximum((tolerance * largest) ** 2, of_belt**2 * belt.most)
        growth = 0.5 * stride.length * belt.fall / pair.mass
        over = jnp.maximum(jnp.sqrt(_over(belt.off, square)), growth / _GROWS)
        # Without contact it moves no peak.
        over = jnp.where(allowed > 0, over, 0.0)
        asked = jnp.maximum(asked, jnp.where(jnp.isfinite(over), over, 0.0))
    worst = jnp.maximum(missed_force, asked)
    unsolved = jnp.asarray(unsolved)
    first, shortest = count == 0, count <= 1
    accepted = ((worst <= 1) & ~unsolved) | shortest
    grown = (worst * _GROWTH < 1) & is_whole(end, 2 * count)
    step = jnp.where(grown, 2 * count, count)
    step = jnp.minimum(step, jnp.maximum(foreseen.next, clock.unit))
    # Steps begin at multiples of their length, so that the clock's units are all met.
    for longer in reversed([each for each in clock.counts if each > clock.unit]):
        step = jnp.where((step >= longer) & ~is_whole(end, longer), longer / 2, step)
    # As the defect goes with the square of the length, at least where the force is smooth.
    shorter = jnp.where(worst > 256, 0.125, jnp.where((worst > 16) | unsolved, 0.25, 0.5))
    step = jnp.where(accepted, step, jnp.maximum(shorter * count, 1.0))
    step = jnp.where(first, float(clock.unit), step)
    missed = jnp.where(first, 0.0, stride.length * allowed)
    control = Control(
        accepted=accepted.astype(step.dtype),
        largest=largest,
        allowed=before.allowed + missed,
        excess=before.excess + missed * jnp.maximum(missed_force - 1, 0.0),
        ends=now,
    )
    return jax.lax.stop_gradient(StepSize(count, step, control))
