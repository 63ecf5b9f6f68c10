"""A corner that slides on a surface over a step: its speed, and its friction at both ends and in
the mean.

A step passes the fall from static to kinetic friction, over w_s, in a small part of its time, and
the friction at the step's very end may say little about the rest. So the frictions before and after
rest are means over the speeds between w_0 and rest, and between rest and w_1 (`mean_coefficient`).
Where a corner slides on without a reversal, coefficient and direction are means over a speed that
is linear in time,

    mu_k + [w_1 d(w_1) - w_0 d(w_0)] / (w_1 - w_0),   (w_0 + w_1) / (r_0 + r_1),

with d the mean of what static friction adds between rest and w, and r^2 = w^2 + eps^2. Where the
sliding reverses, they are those until rest, w_1 = 0.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Smoothing
from ..model import Coefficient, Mechanics, corner_share, mean_coefficient
from ..parts import AbstractFriction


class MeanFriction(NamedTuple):
    """A coefficient of friction, the smoothed `direction` of the sliding, -1 to 1, and the
    derivative `turn` of the direction in the sliding speed [s/m]."""

    of: Coefficient
    direction: Array
    turn: Array

    @property
    def mu(self) -> Array:
        """The coefficient [1]."""
        return self.of.smooth + self.of.near_rest

    @property
    def mu_slope(self) -> Array:
        """The slope of the coefficient with the sliding speed [s/m]."""
        return self.of.smooth_slope + self.of.near_rest_slope

    @property
    def share(self) -> Array:
        """The friction as a share of the normal force [1]."""
        return -self.mu * self.direction

    @property
    def slope(self) -> Array:
        """The slope of the share with the sliding speed [s/m]."""
        return -(self.mu_slope * self.direction + self.mu * self.turn)


def mean_friction(friction: AbstractFriction, sliding: Array, smoothing: Smoothing) -> MeanFriction:
    """The mean friction from rest to a sliding speed. The direction is that at the speed itself, so
    that a corner at rest has the static friction that acts on it."""
    of = mean_coefficient(friction, sliding, smoothing)
    inverse = jax.lax.rsqrt(sliding * sliding + smoothing.slip_speed**2)
    turn = (smoothing.slip_speed * inverse) ** 2 * inverse
    return MeanFriction(of, sliding * inverse, turn)


class Start(NamedTuple):
    """A corner at a step's start: the sliding speed [m/s], the friction there as a `share` of the
    normal force [1] with its `slope` [s/m], and the mean friction between that speed and rest."""

    speed: Array
    share: Array
    slope: Array
    mean: MeanFriction


def starts(mechanics: Mechanics, sliding: tuple[Array, ...]) -> tuple[Start | None, ...]:
    """The start of each contact. The first contacts slide at the speeds `sliding` [m/s]; the result
    is `None` for a contact without friction, and for one beyond those whose speeds are given. It is
    the same for all Newton iterations."""
    smoothing = mechanics.fidelity.smoothing
    speeds = (*sliding, *[None] * (len(mechanics.frictions) - len(sliding)))
    return tuple(
        None if friction is None or speed is None else Start(
            speed,
            *corner_share(friction, speed, smoothing),
            mean_friction(friction, speed, smoothing),
        )
        for friction, speed in zip(mechanics.frictions, speeds, strict=True)
    )  # fmt: skip


class Corner(NamedTuple):
    """A corner over a step: at its `start`; at its end the sliding speed `after` [m/s], the
    friction as a `share` of the normal force [1], the `slope` of that [s/m], and the mean friction
    between rest and that speed, `end`; `gain` [m/s], the change of the sliding speed by friction of
    mu = 1 in a whole step; and eps [m/s]."""

    start: Start
    after: Array
    share: Array
    slope: Array
    end: MeanFriction
    gain: Array
    eps: float


class MeanShare(NamedTuple):
    """A friction that enters the step's equations, as a `share` of the normal force [1], and the
    `slope` of that with the sliding speed [s/m]."""

    share: Array
    slope: Array


def mean_over_step(corner: Corner) -> tuple[Array, MeanFriction]:
    """Whether the sliding speed changes in the step; and, where it does, the mean coefficient over
    a speed that changes linearly, with the direction at the end.

    What static friction adds is a quotient of differences of numbers that tend to constants far
    from rest, and the smooth part is a plain mean. So round-off of the smooth part is not divided
    by a small change of the speed.
    """
    before, after = corner.start.speed, corner.after
    here, there = corner.start.mean.of, corner.end.of
    change = after - before
    changes = jnp.abs(change) > 1e-4 * corner.eps
    change = jnp.where(changes, change, 1.0)
    near_rest = (after * there.near_rest - before * here.near_rest) / change
    slope = (there.near_rest + after * there.near_rest_slope - near_rest) / change
    smooth = 0.5 * (here.smooth + there.smooth)
    mean = Coefficient(smooth, 0.5 * there.smooth_slope, near_rest, slope)
    return changes, corner.end._replace(of=mean)


def linear_mean(corner: Corner) -> MeanShare:
    """Twice the mean friction of a corner whose sliding speed changes linearly from one end of the
    step to the other, or to rest where it reverses."""
    before, eps = corner.start.speed, corner.eps
    turns = before * corner.after < 0
    after = jnp.where(turns, 0.0, corner.after)
    changes, end = mean_over_step(corner._replace(after=after))
    # The mean of w / sqrt(w^2 + eps^2), the derivative of the root.
    sum_of_sizes = jnp.sqrt(before * before + eps * eps) + jnp.sqrt(after * after + eps * eps)
    direction = (before + after) / sum_of_sizes
    turn = jnp.where(turns, 0.0, (1 - direction * end.direction) / sum_of_sizes)
    fall_slope = jnp.where(turns, 0.0, end.of.near_rest_slope)
    mean = MeanFriction(end.of._replace(near_rest_slope=fall_slope), direction, turn)
    return MeanShare(
        jnp.where(changes, 2 * mean.share, corner.start.share + corner.share),
        jnp.where(changes, 2 * mean.slope, corner.slope),
    )
