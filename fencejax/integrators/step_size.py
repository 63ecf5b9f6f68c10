"""The lengths of steps: the maps over a step of each length, and how long the next step may be.

Steps are long in free flight and where forces change smoothly. They are one unit of the clock where
a contact is about to begin or end, or sliding to reverse.
"""

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Fidelity
from ..model import FlexibleLink, Forces, Mechanics, Propagator, blocks, relaxation
from ..parts import AbstractTorqueDrive


class Stride(NamedTuple):
    """The numbers of a step of one length: its `length` h [s] and `rate` 1 / h [1/s]; the modes'
    exact maps over it; for the load that the modes left out carry, exp(-h / lag) [1] and (1 -
    exp(-h / lag)) / h [1/s]; and the same two for the fence's cover and for its clutch (`None`
    without one).

    A scene begins with a step of length 0, in which nothing moves: it computes the forces that
    belong to the state. Its `rate` is 0, and the modes left out carry the contact forces without
    lag.
    """

    length: Array
    rate: Array
    maps: tuple[Propagator, ...]
    lag_decay: Array
    lag_gain: Array
    pad_decay: Array | None = None
    pad_gain: Array | None = None
    slip_decay: Array | None = None
    slip_gain: Array | None = None

    @property
    def begins(self) -> Array:
        """Whether this is the step of length 0."""
        return self.length == 0


class Clock(eqx.Module):
    """The start time [s] on the drive's clock, the strides and the largest number of Newton
    iterations. The numbers of each stride are one row of the `table`, so that one lookup a step
    finds them all.

    `counts` are the lengths of the strides in the clock's steps [1]: none, one and, where the
    fidelity allows longer ones, the powers of two up to the longest. Under error control the
    clock's step is the shortest one, and `unit` of them make one of `Fidelity.step`; there are also
    strides of a half and a quarter of it for the points inside a step. Otherwise the `unit` is 1.
    """

    start: Array
    table: Array
    iterations: Array
    step: float = eqx.field(static=True)
    counts: tuple[float, ...] = eqx.field(static=True)
    unit: int = eqx.field(static=True)
    structure: Any = eqx.field(static=True)
    shapes: tuple[tuple[int, ...], ...] = eqx.field(static=True)

    def __init__(
        self,
        link: FlexibleLink | None,
        fidelity: Fidelity,
        start: Array,
        step: float,
        maps: Propagator | None,
    ):
        """`maps` are those of all modes over the longer strides of `stride_counts`, that is all but
        the first, whose length is 0: (strides - 1, m)."""
        self.start, self.step = start, step
        self.counts = stride_counts(fidelity)
        self.iterations = jnp.full_like(start, fidelity.iterations)
        self.unit = units(fidelity)
        zero = jnp.zeros_like(start)
        moving = [zero + step * count for count in self.counts[1:]]
        decay, every = jnp.ones(len(self.counts), start.dtype), ()
        gain = jnp.zeros_like(decay)
        if link is not None:
            assert maps is not None
            decay, gain = _lagged(link.lag, moving, zero)
            named = {
                name: jnp.concatenate([jnp.full_like(values[:1], name in ("qq", "vv")), values])
                for name, values in maps._asdict().items()
            }
            every = (Propagator(**named),)
        pad = slip = (None, None)
        if link is not None and link.cover is not None:
            pad = _lagged(link.cover.lag, moving, zero)
        if link is not None and link.hinge is not None and link.hinge.clutch is not None:
            slip = _lagged(link.hinge.clutch.lag, moving, zero)
        strides = Stride(
            length=jnp.stack([zero, *moving]),
            rate=jnp.stack([zero, *(1 / h for h in moving)]),
            maps=every,
            lag_decay=decay,
            lag_gain=gain,
            pad_decay=pad[0],
            pad_gain=pad[1],
            slip_decay=slip[0],
            slip_gain=slip[1],
        )
        leaves, self.structure = jax.tree.flatten(strides)
        self.shapes = tuple(leaf.shape[1:] for leaf in leaves)
        self.table = jnp.concatenate([leaf.reshape(len(self.counts), -1) for leaf in leaves], 1)

    def stride(self, count: Array) -> Stride:
        """The stride of `count` steps [1]."""
        kind = sum((count >= each).astype(jnp.uint32) for each in self.counts[1:])
        row = jax.lax.dynamic_index_in_dim(self.table, kind, keepdims=False)
        leaves, at = [], 0
        for shape in self.shapes:
            size = math.prod(shape)
            leaves.append(row[at : at + size].reshape(shape))
            at += size
        stride = jax.tree.unflatten(self.structure, leaves)
        by_mode = [
            Propagator(*parts)
            for every in stride.maps
            for parts in zip(*map(blocks, every), strict=True)
        ]
        return stride._replace(maps=tuple(by_mode))

    def time(self, index: Array) -> Array:
        """Time [s] of a sample since the scene's start."""
        return self.step * index


def _lagged(lag: Array, lengths: list[Array], zero: Array) -> tuple[Array, Array]:
    """exp(-h / lag) [1] and (1 - exp(-h / lag)) / h [1/s] for h = 0 and for the `lengths` h [s]."""
    decay = [zero + 1, *(relaxation(lag, h) + zero for h in lengths)]
    gain = [zero, *((1 - d) / h for d, h in zip(decay[1:], lengths, strict=True))]
    return jnp.stack(decay), jnp.stack(gain)


def is_whole(end: Array, count: Array | float) -> Array:
    """Whether the time `end` is a multiple of `count`, a power of two, both in the clock's steps
    [1]."""
    return jnp.floor(end / count) * count == end


def units(fidelity: Fidelity) -> int:
    """The number of a clock's steps in one of `Fidelity.step`."""
    return 1 if fidelity.step_tolerance is None else 2**fidelity.halvings


def stride_counts(fidelity: Fidelity) -> tuple[float, ...]:
    """The lengths of a clock's strides in its steps [1], for a fidelity whose settings are all
    numbers."""
    assert fidelity.longest_stride is not None
    longest = fidelity.longest_stride.bit_length()
    if fidelity.step_tolerance is None:
        return (0, *(2**k for k in range(longest)))
    return (0, 0.25, 0.5, *(2**k for k in range(fidelity.halvings + longest)))


# Bound on the acceleration of a gap in free flight [m/s^2], by the drive's swing, friction and the
# vibration of the fence, with a margin.
_CHANGE = 50.0


class StepSize(NamedTuple):
    """The lengths of the `last` step and of the `next` one, at most, in the clock's steps [1]; and
    the state of error control, if there is one (`fencejax.integrators.step_control`)."""

    last: Array
    next: Array
    control: Any = None


def next_step_size(
    mechanics: Mechanics,
    clock: Clock,
    last: Array,
    jump: Array,
    forces: Forces,
    normals_before: tuple[Array, ...],
) -> StepSize:
    """The largest length of the next step after one of the length `last`, in the clock's steps [1].

    - The forces are expected to leave their linear extrapolation by no more than
      `Fidelity.stride_tolerance`. Over the last step they left it by `jump` [1], relative to their
      size, and this grows with the square of the length. The next step is at most twice as long as
      the last one.
    - A corner without contact has none within the step either: D + 3 |Ddot| h + a h^2 / 2 < 0, or
      it stays beyond the ends of the fence.
    - A corner whose normal force at the fence falls still has one at the end of the step.
      `normals_before` are the forces at the fence [N] one step back.
    """
    tolerance, longest = mechanics.fidelity.stride_tolerance, jnp.maximum(last, 1.0)
    best = jnp.full_like(last, clock.unit)
    corners = tuple(meeting.contact for meeting in forces.meetings)
    changes = [
        (now.contact.normal - before) / longest
        for now, before in zip(forces.fence, normals_before, strict=True)
    ]
    changes += [0.0 * meeting.contact.normal for meeting in forces.still]
    rise = _CHANGE
    if mechanics.link is not None and isinstance(mechanics.drive, AbstractTorqueDrive):
        # The torque at the tip of a fence that nothing meets.
        link = mechanics.link
        inertia = link.root_inertia + link.swing_inertia
        rise = rise + link.reach * mechanics.drive.largest / inertia
    for count in clock.counts:
        if count <= clock.unit:
            continue
        length, ratio = count * clock.step, count / longest
        fine = (jump * ratio**2 <= tolerance) & (ratio <= 2)
        for k, change in enumerate(changes):
            corner = corners[k]
            reach = corner.gap + 3 * jnp.abs(corner.gap_rate) * length + 0.5 * rise * length**2
            free = reach < 0
            if k < len(forces.fence):
                slide = 3 * jnp.abs(corner.sliding) * length
                begin, end = _span(mechanics, k)
                free = free | (corner.place - slide > end) | (corner.place + slide < begin)
            stays = corner.normal + 2 * count * change > 0
            fine = fine & jnp.where(corner.normal > 0, stays, free)
        best = jnp.where(fine, float(count), best)
    return StepSize(last, best)


def _span(mechanics: Mechanics, k: int) -> tuple[float, Array]:
    """The arc coordinates [m] between which the k-th corner at the fence can meet it. A corner that
    is further beyond the tip than its side is long cannot have the tip on that side."""
    assert mechanics.link is not None
    fade = mechanics.fidelity.tip_fade
    side = mechanics.sides.get(mechanics.fence_corners[k], 0.0)
    end = mechanics.link.reach + fade + side
    return -fade, end if mechanics.edge_radius is None else end + mechanics.edge_radius
