"""The displacement that a step adds to its cubic where a corner comes to rest or settles in it.

The step's cubic takes friction as linear in time from the step's start to its end. Where friction
is not, the change of the parcel's velocity is right all the same (`friction_turn`), but in truth it
happens sooner or later than in the cubic. The difference in displacement may be less than a
thousandth of the whole, but its derivative is not: the instant at which a corner comes to rest
depends on every number of the scene.

**A corner slides at the start and comes to rest** after the share theta of the impulse of the
normal force and the share t of the time. If friction kept its sliding value until the end, its mean
over the step would be F_m + G, with F_m the mean that the step's equations find, and the sliding
speed would change by w_1 - w_0 + h lambda G, with the corner's lightness lambda [1/kg]. So theta is
the share of that change which takes away w_0. A force that acts early in a step displaces the
parcel further than the same force later. Compared with the cubic, for which a mean force acts at a
third of the step, it is further by

    h^2 G / m [N_1 (3 t - 1) + (N_1 - N_0) (1 - t) (1 - 2 t)] / [3 (N_t + N_1)].

The cubic begins with the friction at the step's very start, though, while the jump is that from the
mean until rest, which static friction near rest makes larger: by a difference F of the two the
parcel goes h^2 F / m (1 - t) / 6 further.

**A corner sticks from the start on.** Its friction is throughout the same share of the normal
force, that at the step's end, whatever it was at the start: this adds h^2 / 6 times the difference
in acceleration. The corner also settles: it loses the speed that it had, up to some tens of eps in
a short step, or gains the speed that reversing friction allows. The speed changes by I_G through
the mean friction that `friction_turn` adds, and by I_E through the friction at the end, together by
w_1 - w_0 where the corner slows down and is near rest in the end. In truth all of this happens at
the share c of the step in the mean; in the cubic I_G happens at 2/3 and I_E at 1/2. So the corner
goes further by

    h [(2/3 - c) I_G + (1/2 - c) I_E].

With the stiffness k [1] of friction, its slope with the speed times h lambda N, its difference from
that at the end decays as exp(-k t / h): c goes from 1/3 for small k to 1/k, and is
1 / (3 + k^2 / (k + 3)) to within 12 % in between. A corner that passes through rest is
near it for the share (|w_0| + eps) / |w_1 - w_0| of the step, and c is at most half of that.
"""

import jax.numpy as jnp
from jaxtyping import Array

from .sliding_corner import Corner, MeanShare


def _until_rest(before: Array, after: Array, change: Array) -> Array:
    """theta of a corner with the sliding speeds `before` and `after` a step [m/s]. Sliding friction
    changes the speed by `change` [m/s] more than the mean friction does. 1 where it slides on."""
    slows = before - after - change
    rests = (slows * before > 0) & (jnp.abs(before) < jnp.abs(slows))
    return jnp.where(rests, before / jnp.where(rests, slows, 1.0), 1.0)


def comes_to_rest(
    corner: Corner,
    sliding: MeanShare,
    mean: Array,
    pressed: tuple[Array, Array],
    others: Array | float = 0.0,
) -> Array:
    """The force [N] that displaces the parcel for a corner that comes to rest (`Turn.displacing`).

    `sliding` is the mean friction until rest (`linear_mean`) and `mean` that over the step, as
    shares [1] of the normal force, which is `pressed` [N] at the start and at the end. Frictions at
    other corners that reverse in the step change the sliding speed by `others` more [m/s] until the
    corner rests. A corner that comes to rest at the very end has a speed of some eps there.
    Smoothing then has reduced the friction already, but too late to displace the parcel.
    """
    # The normal force of a contact that has just begun may be below 0 within Newton's tolerance.
    start, (first, last) = corner.start, (jnp.maximum(n, 0.0) for n in pressed)
    sliding_share = 0.5 * sliding.share
    onward = start.speed * corner.after > 0
    until = _until_rest(
        start.speed,
        jnp.where(onward, 0.0, corner.after),
        corner.gain * (sliding_share - mean) + others,
    )
    # The friction until rest, without the reduction by smoothing at the step's end, where the
    # corner is slow only there.
    fast, fast_after = jnp.abs(start.speed), jnp.where(onward, jnp.abs(corner.after), 0.0)
    scale = jnp.where(fast > 0, fast, 1.0)
    lost = (jnp.sqrt(fast_after * fast_after + corner.eps**2) - fast_after) / (scale + fast_after)
    until_rest = sliding_share * (1 + lost * jnp.maximum(1 - fast_after / scale, 0.0) ** 2)
    normal_squared = first * first + until * (last * last - first * first)
    exists = (normal_squared > 0) & (fast > 0)
    normal_at_rest = jnp.sqrt(jnp.where(exists, normal_squared, 1.0))
    time_share = (first + last) * until / (first + normal_at_rest)
    lever = last * (3 * time_share - 1) + (last - first) * (1 - time_share) * (1 - 2 * time_share)
    further = (until_rest - mean) * (first + last) * lever / (6 * (normal_at_rest + last))
    further = further + (until_rest - start.share) * first * (1 - time_share) / 6
    return jnp.where(exists, further, 0.0)


def settles(corner: Corner, added: Array) -> Array:
    """The force that displaces the parcel for a corner that sticks from the start on and settles
    within the step (`Turn.displacing`), as a share of the normal force [1]. `added` is the share
    that settling adds to twice the mean friction."""
    before, after, gain = corner.start.speed, corner.after, corner.gain
    # k, as the mean of both ends.
    stiffness = jnp.maximum(-0.5 * gain * (corner.start.slope + corner.slope), 0.0)
    passes = (jnp.abs(before) + corner.eps) / (jnp.abs(before - after) + corner.eps)
    centre = jnp.minimum(1 / (3 + stiffness * stiffness / (stiffness + 3)), 0.5 * passes)
    ratio = after / jnp.where(before != 0, before, 1.0)
    stops = (ratio < 1) & (before != 0) & (gain > 0)
    # Nothing where the corner passes through rest and is as fast again.
    stays = jnp.where(stops, jnp.maximum(1 + jnp.minimum(ratio, 0.0), 0.0), 0.0)
    lost = (before - after) / jnp.where(gain > 0, gain, 1.0)
    by_end = -stays * (lost + 0.5 * added)
    return (2 / 3 - centre) * 0.5 * added + (0.5 - centre) * by_end
