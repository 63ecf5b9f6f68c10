"""The lengths of steps: what advances with a step of each length, and how long the next one may be:
long in free flight and where forces change smoothly, one step where something is about to touch,
to part or to turn round."""


from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Fidelity
from ..model import FlexibleLink, Propagator, blocks, relaxation
from ..results import Sample


class Stride(NamedTuple):
    """A step of one length: `length` h [s] and `rate` 1 / h [1/s]; the modes' exact maps over it;
    of the load that the modes left out carry, exp(-h / lag) [1] and (1 - exp(-h / lag)) / h [1/s].

    A scene begins with a step of no length: nothing moves in it and the forces come out that belong
    to the state. Its `rate` is 0, and the modes left out carry the contact forces without lag.
    """

    length: Array
    rate: Array
    maps: tuple[Propagator, ...]
    lag_decay: Array
    lag_gain: Array

    @property
    def begins(self) -> Array:
        """Whether this is the step of no length."""
        return self.length == 0


class Clock(eqx.Module):
    """The start time [s] on the drive's clock, the strides, one after the other along the first
    axis, and the most Newton iterations.

    `counts` is how many steps [1] each stride stands for: none, one and, where the fidelity allows
    longer ones, the powers of two up to the longest.
    """

    start: Array
    strides: Stride
    iterations: Array
    step: float = eqx.field(static=True)
    counts: tuple[int, ...] = eqx.field(static=True)

    def __init__(
        self,
        link: FlexibleLink | None,
        fidelity: Fidelity,
        start: Array,
        step: float,
        maps: Propagator | None,
    ):
        """`maps` are those of all modes over the `lengths` but the first, (strides - 1, m)."""
        self.start, self.step = start, step
        self.counts = stride_counts(fidelity)
        self.iterations = jnp.full_like(start, fidelity.iterations)
        zero = jnp.zeros_like(start)
        moving = [zero + step * count for count in self.counts[1:]]
        decay, by_mode = [jnp.ones_like(start)] * len(self.counts), ()
        if link is not None:
            assert maps is not None
            decay = [jnp.ones_like(start), *(relaxation(link.lag, h) + zero for h in moving)]
            every = [
                jnp.concatenate([jnp.full_like(values[:1], name in ("qq", "vv")), values])
                for name, values in maps._asdict().items()
            ]
            by_mode = tuple(
                Propagator(*parts)
                for parts in zip(*(blocks(values) for values in every), strict=True)
            )
        gains = [zero, *((1 - d) / h for d, h in zip(decay[1:], moving, strict=True))]
        self.strides = Stride(
            length=jnp.stack([zero, *moving]),
            rate=jnp.stack([zero, *(1 / h for h in moving)]),
            maps=by_mode,
            lag_decay=jnp.stack(decay),
            lag_gain=jnp.stack(gains),
        )

    def stride(self, count: Array) -> Stride:
        """The stride of so many steps [1]."""
        kind = sum((count >= each).astype(jnp.uint32) for each in self.counts[1:])
        return jax.tree.map(
            lambda each: jax.lax.dynamic_index_in_dim(each, kind, keepdims=False), self.strides
        )

    def time(self, index: Array) -> Array:
        """Time [s] of a sample since the scene's start."""
        return self.step * index


def stride_counts(fidelity: Fidelity) -> tuple[int, ...]:
    """How many steps [1] each of a clock's strides stands for, of a settled fidelity."""
    assert fidelity.longest_stride is not None
    return (0, *(2**k for k in range(fidelity.longest_stride.bit_length())))

# What the rate of a gap may change by in free flight [m/s^2]: the drive's swing, friction and the
# ringing of the fence, with room to spare.
_CHANGE = 50.0


class Pace(NamedTuple):
    """What the length of the next step is chosen by.

    `steps` is how many steps [1] the last one stood for; `surprise` [1] how far the forces at its
    end were from their straight continuation, relative to their size. It grows with the square of
    the length.
    """

    steps: Array
    surprise: Array


def next_count(
    pace: Pace,
    sample: Sample,
    normals_before: tuple[Array, ...],
    counts: tuple[int, ...],
    step: float,
    tolerance: float,
    ends: tuple[tuple[float, Array], ...],
) -> Array:
    """The largest of `counts` steps [1] that may be taken in one, each of `step` [s].

    - The forces are expected to leave their straight continuation by no more than `tolerance`, and
      the step is at most twice the last one.
    - A corner that is free stays free: D + 3 |Ddot| h + a h^2 / 2 < 0, or it stays off the fence,
      between whose `ends`, arc coordinates [m] for each corner, it can be met.
    - A corner at the fence that is being let go is not gone by the end of the step.
    """
    best = jnp.ones_like(pace.steps)
    corners = (*sample.fence, *sample.border)
    changes = [
        (now.normal - before) / jnp.maximum(pace.steps, 1.0)
        for now, before in zip(sample.fence, normals_before, strict=True)
    ]
    changes += [0.0 * corner.normal for corner in sample.border]
    for count in counts:
        length, ratio = count * step, count / jnp.maximum(pace.steps, 1.0)
        fine = (pace.surprise * ratio**2 <= tolerance) & (ratio <= 2)
        for k, change in enumerate(changes):
            corner = corners[k]
            reach = corner.gap + 3 * jnp.abs(corner.gap_rate) * length + 0.5 * _CHANGE * length**2
            free = reach < 0
            if k < len(sample.fence):
                slide = 3 * jnp.abs(corner.sliding) * length
                near, far = ends[k]
                free = free | (corner.place - slide > far) | (corner.place + slide < near)
            stays = corner.normal + 2 * count * change > 0
            fine = fine & jnp.where(corner.normal > 0, stays, free)
        best = jnp.where(fine, float(count), best)
    return best
