"""A corner that slides on a surface, over a step: its speed and its friction at either end and in
the mean.

A step passes the fall from static to kinetic friction, over w_s, in a small part of its time, and
what friction is at the step's very end may say little of the rest. So frictions on the way to rest
and from it are means over the speeds between w_0 and rest, and between rest and w_1
(`mean_coefficient`). Where a corner slides on, coefficient and direction are means over a speed
that goes straight,

    mu_k + [w_1 d(w_1) - w_0 d(w_0)] / (w_1 - w_0),   (w_0 + w_1) / (r_0 + r_1),

with d what static friction adds in the mean from rest to w, and r^2 = w^2 + eps^2. Where it turns
round, they are so on the way to rest, w_1 = 0.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Smoothing
from ..model import Coefficient, Mechanics, corner_share, mean_coefficient
from ..parts import AbstractFriction


class MeanFriction(NamedTuple):
    """A coefficient of friction, the `direction` of the sliding, -1 to 1, and its `turn` with the
    sliding speed [s/m]."""

    of: Coefficient
    direction: Array
    turn: Array

    @property
    def mu(self) -> Array:
        """The coefficient [1]."""
        return self.of.smooth + self.of.near_rest

    @property
    def mu_slope(self) -> Array:
        """That of the coefficient with the sliding speed [s/m]."""
        return self.of.smooth_slope + self.of.near_rest_slope

    @property
    def share(self) -> Array:
        """The friction as a share of the normal force [1]."""
        return -self.mu * self.direction

    @property
    def slope(self) -> Array:
        """That of the share [s/m]."""
        return -(self.mu_slope * self.direction + self.mu * self.turn)


def mean_friction(friction: AbstractFriction, sliding: Array, smoothing: Smoothing) -> MeanFriction:
    """In the mean from rest to a sliding speed; its direction is that at the speed itself, so that
    a corner at rest has the friction that holds it."""
    of = mean_coefficient(friction, sliding, smoothing)
    inverse = jax.lax.rsqrt(sliding * sliding + smoothing.slip_speed**2)
    turn = (smoothing.slip_speed * inverse) ** 2 * inverse
    return MeanFriction(of, sliding * inverse, turn)


class Start(NamedTuple):
    """A corner at a step's start: the sliding speed [m/s], the friction there as a `share` of the
    normal force [1] with its `slope` [s/m], and in the mean on the way from there to rest."""

    speed: Array
    share: Array
    slope: Array
    mean: MeanFriction


def starts(mechanics: Mechanics, sliding: tuple[Array, ...]) -> tuple[Start | None, ...]:
    """Of each contact, the first of which slide at these speeds [m/s]; `None` where there is no
    friction, or no speed. They are the same for all of Newton's iterations."""
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
    """The corner at the step's `start`, and at its end: the sliding speed `after` [m/s], the
    friction as a `share` of the normal force [1] with its `slope` [s/m], and that in the mean on
    the way from rest (`end`); and what friction of mu = 1 changes the sliding by in a whole step
    [m/s], and eps [m/s]."""

    start: Start
    after: Array
    share: Array
    slope: Array
    end: MeanFriction
    gain: Array
    eps: float


class Counted(NamedTuple):
    """What is counted of friction, as a `share` of the normal force [1], and its `slope` with the
    sliding speed [s/m]."""

    share: Array
    slope: Array


def passed(corner: Corner) -> tuple[Array, MeanFriction]:
    """Whether the sliding speed changes at all, and the coefficient in its mean as it goes straight
    from one end of the step to the other, with the direction at the end. What static friction adds
    is a quotient of differences, of numbers that far from rest do not go with the speed: so it has
    no roundings of theirs. Where the speed does not change, the end tells instead."""
    before, after = corner.start.speed, corner.after
    here, there = corner.start.mean.of, corner.end.of
    change = after - before
    some = jnp.abs(change) > 1e-4 * corner.eps
    change = jnp.where(some, change, 1.0)
    near_rest = (after * there.near_rest - before * here.near_rest) / change
    slope = (there.near_rest + after * there.near_rest_slope - near_rest) / change
    smooth = 0.5 * (here.smooth + there.smooth)
    mean = Coefficient(smooth, 0.5 * there.smooth_slope, near_rest, slope)
    return some, corner.end._replace(of=mean)


def straight(corner: Corner) -> Counted:
    """Twice the mean friction of a corner whose sliding speed goes straight from one end of the
    step to the other, or to rest where it turns round."""
    before, eps = corner.start.speed, corner.eps
    turns = before * corner.after < 0
    after = jnp.where(turns, 0.0, corner.after)
    some, end = passed(corner._replace(after=after))
    # The mean of w / sqrt(w^2 + eps^2), which goes with the root.
    both = jnp.sqrt(before * before + eps * eps) + jnp.sqrt(after * after + eps * eps)
    direction = (before + after) / both
    turn = jnp.where(turns, 0.0, (1 - direction * end.direction) / both)
    falls = jnp.where(turns, 0.0, end.of.near_rest_slope)
    mean = MeanFriction(end.of._replace(near_rest_slope=falls), direction, turn)
    return Counted(
        jnp.where(some, 2 * mean.share, corner.start.share + corner.share),
        jnp.where(some, 2 * mean.slope, corner.slope),
    )
