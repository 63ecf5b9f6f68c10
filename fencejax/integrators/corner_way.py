"""How much further a parcel goes in a step in which a corner comes to rest on a surface or settles.

The step's cubic takes friction to go straight from that at the step's start to that at its end.
Where it does not, what it makes the parcel's speed change by is right all the same
(`friction_turn`), but comes earlier or later than the cubic has it. Such a way may be less than a
thousandth of the parcel's; its derivative is not: the instant at which a corner comes to rest goes
with every number of the scene.

**A corner that slides at the start and comes to rest**, at the share theta of the impulse of the
normal force and the share t of the time. Were friction all along what it is while the corner
slides, it would be larger by G in the mean than the F_m which the step's equations have found, and
the sliding speed change by w_1 - w_0 + h lambda G, with the corner's lightness lambda [1/kg]. So
theta is the share of that which takes w_0 away. And a parcel that is pushed early in a step goes
further than by the same push later: than by the cubic, for which a push in the mean acts at a third
of it,

    h^2 G / m [N_1 (3 t - 1) + (N_1 - N_0) (1 - t) (1 - 2 t)] / [3 (N_t + N_1)].

The cubic begins with the friction at the step's very start, though, and the jump is that from the
mean on the way to rest, which static friction near rest makes larger: by F more the parcel goes
h^2 F / m (1 - t) / 6 further.

**A corner that is held from the start on** is so by the friction's share of the normal force at the
step's end, whatever it was at its start: h^2 / 6 times what that changes the acceleration by. And
it settles: it loses the speed it came with, up to some tens of eps in a short step, or gains what
friction that turns lets it. That changes the speed by I_G through what the turn adds to the mean
friction, and by I_E through the friction at the end, together w_1 - w_0 where the corner slows
down and is near rest in the end. In truth all of it comes at the share c of the step in the mean,
for the cubic at 2/3 and at 1/2 of it. So the corner goes further by

    h [(2/3 - c) I_G + (1/2 - c) I_E].

A friction of the stiffness k [1], its slope with the speed times h lambda N, falls as exp(-k t / h)
to that at the end: c goes from 1/3, where k is small, to 1/k, and is 1 / (3 + k^2 / (k + 3)) to
within a tenth of that in between. A corner that passes by its rest is near it for the share
(|w_0| + eps) / |w_1 - w_0| of the step, and c is half of that at most.
"""

import jax.numpy as jnp
from jaxtyping import Array

from .sliding_corner import Corner, Counted


def _until_rest(before: Array, after: Array, change: Array) -> Array:
    """theta of a corner that slides at the speeds `before` and `after` a step [m/s], whose sliding
    friction changes that by `change` [m/s] more than its mean one; 1 where it slides on."""
    slows = before - after - change
    rests = (slows * before > 0) & (jnp.abs(before) < jnp.abs(slows))
    return jnp.where(rests, before / jnp.where(rests, slows, 1.0), 1.0)


def comes_to_rest(
    corner: Corner,
    sliding: Counted,
    mean: Array,
    pressed: tuple[Array, Array],
    others: Array | float = 0.0,
) -> Array:
    """How much further the parcel goes for a corner that comes to rest, as a force [N] (`Turn`).

    `sliding` is the friction on its way until then (`straight`); `mean` that over the step, as a
    share [1] of the normal force, which is `pressed` [N] at the start and at the end. Frictions of
    `others` that turn in the step change the sliding by that more [m/s] until the corner rests. It
    is at rest at the step's end at the latest, to within some eps: there smoothing has taken some
    of the friction, of which the parcel feels nothing yet.
    """
    # Newton's method may leave the first touch a little below 0.
    start, (first, last) = corner.start, (jnp.maximum(n, 0.0) for n in pressed)
    slides = 0.5 * sliding.share
    on = start.speed * corner.after > 0
    until = _until_rest(
        start.speed, jnp.where(on, 0.0, corner.after), corner.gain * (slides - mean) + others
    )
    # Without what smoothing takes from it at its end, where the step comes to that from afar.
    fast, slow = jnp.abs(start.speed), jnp.where(on, jnp.abs(corner.after), 0.0)
    ahead = jnp.where(fast > 0, fast, 1.0)
    lost = (jnp.sqrt(slow * slow + corner.eps**2) - slow) / (ahead + slow)
    whole = slides * (1 + lost * jnp.maximum(1 - slow / ahead, 0.0) ** 2)
    square = first * first + until * (last * last - first * first)
    some = (square > 0) & (fast > 0)
    then = jnp.sqrt(jnp.where(some, square, 1.0))
    at = (first + last) * until / (first + then)
    lever = last * (3 * at - 1) + (last - first) * (1 - at) * (1 - 2 * at)
    further = (whole - mean) * (first + last) * lever / (6 * (then + last))
    further = further + (whole - start.share) * first * (1 - at) / 6
    return jnp.where(some, further, 0.0)


def settles(corner: Corner, added: Array) -> Array:
    """How much further the parcel goes for a corner that was held and settles within the step, as a
    share of the normal force [1] (`Turn`), where that has `added` to twice the mean friction."""
    before, after, gain = corner.start.speed, corner.after, corner.gain
    # k, by its mean over the two ends.
    stiff = jnp.maximum(-0.5 * gain * (corner.start.slope + corner.slope), 0.0)
    passes = (jnp.abs(before) + corner.eps) / (jnp.abs(before - after) + corner.eps)
    centre = jnp.minimum(1 / (3 + stiff * stiff / (stiff + 3)), 0.5 * passes)
    ratio = after / jnp.where(before != 0, before, 1.0)
    stops = (ratio < 1) & (before != 0) & (gain > 0)
    # None of it where the corner passes by its rest and is as fast again.
    stays = jnp.where(stops, jnp.maximum(1 + jnp.minimum(ratio, 0.0), 0.0), 0.0)
    lost = (before - after) / jnp.where(gain > 0, gain, 1.0)
    by_end = -stays * (lost + 0.5 * added)
    return (2 / 3 - centre) * 0.5 * added + (0.5 - centre) * by_end
