"""Quantities of a sort besides its blow: crossing time, the impulse on the fence's tip, the
shortest period from parcel to parcel, and the parcel's safety against tipping."""

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ..parts import AbstractDrive, AbstractTorqueDrive, Belt, turned
from ..results import Accumulator, Measure, Step, accumulators
from ..scenes import Scene
from .objectives import Quantity, of_measure


def _crossed(state, step: Step):
    time, over = state
    belt = getattr(step.scene, "belt", None)
    if belt is None:
        return state
    before, now = step.before.body.y - belt.width, step.now.body.y - belt.width
    crosses = (now >= 0) & (over == 0)
    rise = now - before
    share = jnp.where(crosses & (rise > 0), -before / jnp.where(rise > 0, rise, 1.0), 1.0)
    at = step.before.time + jnp.clip(share, 0.0, 1.0) * step.span.length
    at = jnp.where(crosses, at, step.now.time - now)
    over_now = jnp.where(crosses, jnp.ones_like(over), over)
    return jnp.where(over == 0, at, time), over_now


CROSSING_TIME = of_measure(
    Measure(
        "crossing_time", "s", "when C_s passes the belt's far edge; where it does not, the end and "
        "1 s for each metre that it is short of it",
        "either way", Accumulator("crossed", lambda nothing, body: (nothing.time,) * 2, _crossed),
        lambda state: state[0],
    ),
    needs=("belt",),
)  # fmt: skip
"""Between samples C_s moves uniformly: an error of a h^2 / (8 v), some 1e-6 s."""


def _at_tip(state, step: Step):
    fence = getattr(step.scene, "fence", None)
    if fence is None:
        return state
    for was, now in zip(step.before.fence, step.now.fence, strict=True):
        beyond = was.place - fence.reach, now.place - fence.reach
        part = accumulators.mean_where((was.normal, now.normal), beyond)
        state = state + step.span.length * part
    return state


_TIP_IMPULSE = Measure(
    "tip_impulse", "N s", "impulse of the fence's normal force on corners beyond its tip",
    "at least 0", Accumulator("tip impulse", lambda nothing, body: nothing.time, _at_tip),
    lambda state: state,
)  # fmt: skip
# 1e-9 N s is negligible and makes the share 0 where there is no contact.
TIP_SHARE = Quantity(
    "tip_share", "1", "share of the impulse that the fence's tip carries: while the foot of the "
    "corner that presses is beyond it",
    lambda result, scene: result.tip_impulse / (result.impulse + 1e-9),
    needs=("fence",),
    fields=("impulse", "tip_impulse"),
    measures=(_TIP_IMPULSE,),
)  # fmt: skip

_TIMES = 256


def _arriving(scene: Scene) -> tuple[AbstractDrive, Belt, Array, Array]:
    """The drive, the belt, and x and y [m] of the corners of the parcel as it rides in, (4,)."""
    drive, belt, start = scene.drive, scene.belt, scene.start
    if drive is None or belt is None or start.distance() is not None:
        raise ValueError(
            "Argument `scene` must have a drive, a belt and a parcel that rides in on it, but has "
            f"{start!r}. Write fj.scenes.whole_sort(...)."
        )
    body = start.body(scene.parcel, belt, None)
    turn = jnp.cos(body.angle), jnp.sin(body.angle)
    arms = [turned(turn, *scene.parcel.corner(k)) for k in (1, 2, 3, 4)]
    x, y = (at + jnp.stack(arm) for at, arm in zip(body[:2], zip(*arms, strict=True), strict=True))
    return drive, belt, x, y


def constant_push(scene: Scene, past: ArrayLike = 0.0) -> Array:
    """The constant normal force N [N] that would divert the parcel, as a point mass: it acts from
    the start of the drive until the parcel has passed the fence's tip.

    The fence pushes with N and its friction is mu_2 N along the fence, together
    F = N sqrt(1 + mu_2^2) in a constant direction. Where F exceeds the static friction of the belt,
    the parcel moves relative to the belt in that direction, with m a = F - mu_1 m g for the time T,
    and then slides until the belt has stopped it, in total by
    d sqrt(1 + mu_2^2) = a T^2 / 2 (1 + a / (mu_1 g)). Therefore

        F = mu_1 m g / 2 (1 + sqrt(1 + 8 d sqrt(1 + mu_2^2) / (mu_1 g T^2)))

    or, where that is larger, F = mu_1s m g. The distance d is from C_s to `past` [m] beyond the far
    edge; T = (R_z - x + mu_2 d) / v, with x the rearmost corner at the start and mu_2 d the final
    lag of the parcel behind the belt, which makes the force smaller.

    No force below the second value moves the parcel on the belt. The first value is no strict
    bound: a fence turned against the belt stays in contact with the parcel for longer.

    Raises `ValueError` for a scene in which the parcel does not arrive on the belt, or without a
    fence.
    """
    _, belt, x, _ = _arriving(scene)
    if scene.fence is None:
        raise ValueError("Argument `scene` must have a fence, but has none.")
    sliding, _, largest = belt.friction.scales(belt.speed)
    rubbing = 0.0 if scene.fence_friction is None else scene.fence_friction.scales(belt.speed)[0]
    grip = scene.parcel.mass * belt.gravity
    body = scene.start.body(scene.parcel, belt, None)
    way = jnp.maximum(belt.width + past - body.y, 0.0)
    time = (scene.fence.reach - jnp.min(x) + rubbing * way) / belt.speed
    whole = jnp.sqrt(1 + rubbing**2)
    root = jnp.sqrt(sliding**2 + 8 * way * whole * sliding / (belt.gravity * time**2))
    force = jnp.maximum(0.5 * grip * (sliding + root), largest * grip)
    return jnp.where(way > 0, force / whole, 0.0)


def _clear_of(angle: Array, time: Array, x: Array, y: Array, speed: Array, end: Array) -> Array:
    """The period from which on a corner at (x, y) is clear of a fence at an `angle` at a `time`."""
    # A fence below 1e-9 rad is home.
    out = angle > 1e-9
    cotangent = jnp.cos(angle) / jnp.where(out, jnp.sin(angle), 1.0)
    return jnp.where(out, time + (x - y * cotangent) / speed, -end)


def shortest_period(scene: Scene) -> Array:
    """The shortest time [s] from parcel to parcel at which the next parcel does not touch the
    returning fence.

    The next parcel arrives as this one did, a period T later. Its corner k, at (x_k, y_k) when its
    own drive starts, is clear of the fence's line, y = x tan(alpha), at the time t of this sort
    where x_k - v (T - t) <= y_k / tan(alpha(t)): for all corners and all t of the drive's cycle,

        T = max (t + (x_k - y_k / tan(alpha(t))) / v).

    For a corner on the border the fence has to be home. The fence is a straight line of unlimited
    length here; the drive returns home without jumps of its speed.

    Raises `ValueError` for a scene in which the parcel does not arrive on the belt.
    """
    drive, belt, x, y = _arriving(scene)
    speed = jnp.maximum(belt.speed, 1e-9)
    end = jnp.asarray(drive.cycle)

    def wanted(time, x, y):
        return _clear_of(drive.angle(time), time, x, y, speed, end)

    def least(x, y):
        # The maximum on a grid of times, refined twice around it: to 1e-7 of the cycle. At the
        # maximum the slope in time is 0, so that the derivative of the time does not matter.
        low, high = jnp.zeros_like(end), end
        at = low
        for _ in range(3):
            spacing = (high - low) / _TIMES
            times = low + spacing * jnp.arange(_TIMES + 1, dtype=end.dtype)
            at = times[jnp.argmax(jax.vmap(wanted, in_axes=(0, None, None))(times, x, y))]
            low, high = at - spacing, jnp.minimum(at + spacing, end)
        return wanted(jax.lax.stop_gradient(at), x, y)

    return jnp.max(jnp.where(y <= 1e-9, end + x / speed, jax.vmap(least)(x, y)))


CLEAR_PERIOD = Quantity(
    "clear_period", "s", "shortest time from parcel to parcel at which the returning fence is "
    "clear of the next parcel",
    lambda result, scene: shortest_period(scene),
    needs=("belt", "drive"),
    # It depends on the parcel: a field of the result makes it one number for every sort.
    fields=("status",),
)  # fmt: skip


def _cleared(state: Array, step: Step) -> Array:
    if not isinstance(getattr(step.scene, "drive", None), AbstractTorqueDrive):
        return state
    drive, belt, x, y = _arriving(step.scene)  # pyright: ignore[reportArgumentType]
    assert step.now.drive is not None
    speed, end = jnp.maximum(belt.speed, 1e-9), jnp.asarray(drive.cycle)
    every = _clear_of(step.now.drive.angle, step.now.time, x, y, speed, end)
    home = jnp.where(y <= 1e-9, end + x / speed, every)
    return jnp.maximum(state, jnp.max(jnp.where(step.now.time <= end, home, 0.0)))


CLEAR_PERIOD_OF_TORQUE = of_measure(
    Measure(
        "clear_period", "s", "shortest time from parcel to parcel at which the fence that a torque "
        "has swung is clear of the next parcel", "at least 0",
        Accumulator("cleared", lambda nothing, body: nothing.time, _cleared),
        lambda state: state,
    ),
    needs=("belt", "drive"),
)  # fmt: skip
"""The same for a torque drive, whose angle is part of the simulated motion: at its samples during
the cycle. Another limit ensures that the fence is home at the end of the cycle."""


@functools.lru_cache
def tipping(
    center_height: float | None, contact_height: float, depth: float | None = None
) -> Quantity:
    """How near [1] a parcel comes to tipping over, N |h_C - z| / (m g b / 2) at the largest force;
    it does not tip where this is below 1.

    The fence presses at the height z, the parcel's inertia acts at the height h_C of its centre of
    gravity, and the weight counteracts with the lever arm b / 2 to the edge of the base. The belt's
    friction, which reduces the moment, is left out, on the safe side.

    **Arguments:** `center_height` h_C [m] above the belt, `None` for half of the parcel's own
    `height`; `contact_height` z [m] above the belt; `depth` b [m] of the base in the direction of
    the force, by default the parcel's shorter side.

    The quantity raises `ValueError` where no height is given and the parcel has none.
    """

    def read(result, scene):
        parcel = scene.parcel
        if center_height is None and parcel.height is None:
            raise ValueError(
                "Argument `center_height` [m] must be given, or the parcel have a height, but both "
                "are None. Write fj.Parcel(height=0.3)."
            )
        center = 0.5 * parcel.height if center_height is None else center_height
        base = jnp.minimum(parcel.length, parcel.breadth) if depth is None else depth
        lever = jnp.abs(center - contact_height)
        return result.peak_force * lever / (0.5 * base * parcel.mass * scene.belt.gravity)

    return Quantity(
        "tipping", "1", "moment of the largest force that tips the parcel, over that of its weight",
        read, needs=("belt",), fields=("peak_force",),
    )  # fmt: skip
