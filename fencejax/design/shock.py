"""Severity of a blow for the parcel: load in g, equivalent drop height, velocity change, and
damage.

>>> print(f"{fj.shock.g_load(1100.0, 15.0):.1f} g")
7.5 g
"""

import functools
from collections.abc import Mapping

import jax
import jax.numpy as jnp
from jax.core import Tracer
from jax.scipy.stats import norm
from jaxtyping import Array, ArrayLike

from .. import _check
from ..parts import Parcel
from ..results import Course, Measure, Trace, accumulators
from .objectives import Quantity

_GRAVITY = 9.81
# A pulse lasts while the force is above this share of its peak (ASTM D3332, 3.2.6).
_PULSE = 0.1


def g_load(force: ArrayLike, mass: ArrayLike, gravity: float = _GRAVITY) -> Array:
    """F / (m g) [1] of a force [N] on a mass [kg].

    >>> print(f"{fj.shock.g_load(1100.0, 15.0):.2f} g")
    7.48 g
    """
    return jnp.asarray(force) / (jnp.asarray(mass) * gravity)


def wall_force(speed: ArrayLike, parcel: Parcel) -> Array:
    """N_stiff [N], the peak force of a parcel that meets a rigid wall with a corner at `speed`
    [m/s], above 0: `wall_force` of its contact law.

    >>> print(f"{fj.shock.wall_force(2.426, fj.Parcel()):.0f} N")
    3294 N
    """
    return parcel.contact_law.wall_force(speed, parcel.mass)


def drop_height(force: ArrayLike, parcel: Parcel, gravity: float = _GRAVITY) -> Array:
    """The height [m] from which the parcel, dropped with a corner onto a rigid floor, has the same
    peak force [N]: v^2 / (2 g) with `wall_force`(v) = F, by Newton's method in ln v.

    The parcel's contact law is the same for the floor as for the fence. A force of 0 gives a height
    of 0.

    >>> print(f"{fj.shock.drop_height(1100.0, fj.Parcel()):.3f} m")
    0.073 m
    """
    force = jnp.asarray(force)
    none = force <= 0
    wanted = jnp.log(jnp.where(none, 1.0, force))

    def closer(wanted, parcel, log_speed):
        # For every power law ln F is nearly linear in ln v, so that few steps suffice.
        value, slope = jax.jvp(
            lambda at: jnp.log(wall_force(jnp.exp(at), parcel)),
            (log_speed,),
            (jnp.ones_like(log_speed),),
        )
        return log_speed - (value - wanted) / slope

    fixed = jax.lax.stop_gradient((wanted, parcel))
    begin = jnp.zeros_like(fixed[0] + parcel.mass)
    log_speed = jax.lax.fori_loop(0, 10, lambda _, at: closer(*fixed, at), begin)
    # One more step makes the result differentiable.
    log_speed = closer(wanted, parcel, jax.lax.stop_gradient(log_speed))
    return jnp.where(none, 0.0, jnp.exp(2 * log_speed) / (2 * gravity))


def pulse_impulse(course: Course) -> Array:
    """The impulse [N s] of the pulse with the largest force [N]: from where the force rises through
    a tenth of the peak to where it falls through that again, linear between samples.

    >>> pulse = fj.results.Course(jnp.linspace(0.0, 0.02, 5), jnp.array([0.0, 0, 1000, 0, 0]))
    >>> print(f"{fj.shock.pulse_impulse(pulse):.2f} N s")
    4.95 N s
    """
    time, force = course
    if force is None:
        return jnp.zeros_like(time[0])
    # The largest sample is enough: the peak of `Result.peak_force`, at the vertex of a parabola,
    # changes the level by 1e-4 of the force.
    place = jnp.argmax(jax.lax.stop_gradient(force)).astype(jnp.int32)
    excess = force - _PULSE * force[place]
    low = jax.lax.stop_gradient(excess) <= 0
    here = jnp.arange(force.shape[0], dtype=jnp.int32)
    begin = jnp.max(jnp.where(low & (here < place), here, 0))
    end = jnp.min(jnp.where(low & (here > place), here, force.shape[0] - 1))
    inside = (here[:-1] >= begin) & (here[1:] <= end)
    pairs = ((signal[:-1], signal[1:]) for signal in (force, excess))
    parts = jnp.diff(time) * jax.vmap(accumulators.mean_where)(*pairs)
    return jnp.sum(jnp.where(inside, parts, 0.0))


_PULSE_IMPULSE = Measure(
    "pulse_impulse", "N s", "impulse of the blow with the largest force, above a tenth of it",
    "at least 0", Trace("force", lambda sample: sample.fence_force), pulse_impulse,
)  # fmt: skip
PEAK_LOAD = Quantity(
    "peak_load", "1", "largest force on the parcel over its weight: acceleration in g",
    lambda result, scene: g_load(result.peak_force, scene.parcel.mass),
    fields=("peak_force",),
)  # fmt: skip
VELOCITY_CHANGE = Quantity(
    "velocity_change", "m/s", "change of the parcel's velocity by the blow with the largest force",
    lambda result, scene: result.pulse_impulse / scene.parcel.mass,
    fields=("pulse_impulse",),
    measures=(_PULSE_IMPULSE,),
)  # fmt: skip


def _blow(result, scene) -> tuple[Array, Array]:
    return PEAK_LOAD(result, scene), VELOCITY_CHANGE(result, scene)


def _critical(scene, given: Mapping[str, float | None]) -> list[ArrayLike]:
    """Critical acceleration and velocity change: those given, or the parcel's own."""
    found = []
    for name, value in given.items():
        value = getattr(scene.parcel, name) if value is None else value
        if value is None:
            raise ValueError(
                f"Argument `{name}` must be given, or be the parcel's own, but is None. Write "
                f"fj.Parcel({name}=...)."
            )
        found.append(value)
    return found


def _of_blow(name: str, meaning: str, read) -> Quantity:
    return Quantity(
        name, "1", meaning, read, fields=("peak_force", "pulse_impulse"),
        measures=(_PULSE_IMPULSE,),
    )  # fmt: skip


@functools.lru_cache
def damage_boundary(
    critical_load: float | None = None, critical_velocity_change: float | None = None
) -> Quantity:
    """How near [1] a blow comes to damaging the parcel, min(A / A_c, dV / dV_c). It is above 1
    where both critical values are exceeded, and only such a blow does damage.

    **Arguments:** `critical_load` A_c [1], an acceleration in g, and `critical_velocity_change`
    dV_c [m/s], by default the parcel's own: the damage boundary of a product, from tests by ASTM
    D3332 (R. E. Newton, Fragility assessment, 1968).

    The quantity raises `ValueError` where they are neither given nor numbers of the parcel.

    >>> fj.shock.damage_boundary(60.0, 2.0)
    damage [1]: how near the blow comes to the parcel's damage boundary
    """
    given = dict(critical_load=critical_load, critical_velocity_change=critical_velocity_change)

    def read(result, scene):
        load, change = _critical(scene, given)
        blow = _blow(result, scene)
        return jnp.minimum(blow[0] / load, blow[1] / change)

    return _of_blow("damage", "how near the blow comes to the parcel's damage boundary", read)


@functools.lru_cache
def damage_chance(
    spread: float,
    critical_load: float | None = None,
    critical_velocity_change: float | None = None,
) -> Quantity:
    """The probability [1] that a blow damages its parcel; the mean over a population is the share
    of damaged parcels (see `share_damaged`).

    **Arguments:** `spread` [1], above 0, as in `share_damaged`; `critical_load` and
    `critical_velocity_change` as in `damage_boundary`, here the medians of equal parcels.

    >>> fj.shock.damage_chance(0.3, critical_load=60.0, critical_velocity_change=2.0)
    share_damaged [1]: share of parcels like this that the blow damages
    """
    _check.number("spread", spread, above=0)
    given = dict(critical_load=critical_load, critical_velocity_change=critical_velocity_change)

    def read(result, scene):
        load, change = _critical(scene, given)
        return share_damaged(*_blow(result, scene), load, change, spread=spread)

    return _of_blow("share_damaged", "share of parcels like this that the blow damages", read)


def share_damaged(
    load: ArrayLike,
    velocity_change: ArrayLike,
    critical_load: ArrayLike,
    critical_velocity_change: ArrayLike,
    *,
    spread: float = 0.0,
    weights: ArrayLike | None = None,
) -> Array:
    """The share [1] of parcels that are damaged: those whose blow exceeds both their critical
    acceleration and their critical velocity change.

    **Arguments:**

    - `load` [1], `velocity_change` [m/s]: of each parcel's blow, of shape (n,).
    - `critical_load` [1], `critical_velocity_change` [m/s]: of each parcel, or of all.
    - `spread` s [1]: the standard deviation of the natural logarithm of both critical values among
      equal parcels, independent of each other; the values given are then medians, and a parcel
      counts with the probability Phi(ln(A / A_c) / s) Phi(ln(dV / dV_c) / s). With s = 0 a parcel
      counts fully or not at all, and the share has no derivative. At least 0.
    - `weights`: the frequency of each parcel, of shape (n,), at least 0 and not all of them 0; by
      default all equal.

    Raises `ValueError` for another `spread` or other `weights`.

    >>> blows = {"load": [5.0, 8.0], "velocity_change": [2.0, 3.0]}
    >>> float(fj.shock.share_damaged(**blows, critical_load=6.0, critical_velocity_change=2.5))
    0.5
    """
    _check.scalar("spread", spread, least=0)
    pairs = ((load, critical_load), (velocity_change, critical_velocity_change))
    ratios = [jnp.asarray(value) / jnp.asarray(critical) for value, critical in pairs]
    if spread == 0:
        damaged = jnp.where((ratios[0] > 1) & (ratios[1] > 1), 1.0, 0.0)
    else:
        # A blow of 0 counts as 1e-30, so that its logarithm is finite.
        chances = [norm.cdf(jnp.log(jnp.maximum(r, 1e-30)) / spread) for r in ratios]
        damaged = chances[0] * chances[1]
    if weights is None:
        return jnp.mean(damaged)
    given = _check.vector("weights", weights, least=0)
    total = jnp.sum(given)
    _check.scalar("weights, in all,", total, above=0)
    return jnp.sum(given * damaged) / total


def pseudo_velocity_spectrum(
    time: ArrayLike, acceleration: ArrayLike, frequencies: ArrayLike, damping_ratio: float = 0.05
) -> Array:
    """The pseudo-velocity shock spectrum [m/s] of an acceleration history: omega times the largest
    |z| of an oscillator z'' + 2 zeta omega z' + omega^2 z = -a(t) on the parcel, initially at rest,
    during the history and after it.

    The acceleration is linear between samples and 0 after the last one. The oscillator's motion is
    exact; its largest value is taken at the samples and in the free oscillation afterwards. With
    samples h apart, up to the share (pi f h)^2 / 2 may be missed: 5 % with 10 samples a period.

    **Arguments:** `time` [s] and `acceleration` [m/s^2], of shape (n,); `frequencies` f [Hz], of
    shape (k,), above 0; `damping_ratio` zeta [1], from 0 to below 1.

    Raises `ValueError` for other frequencies and damping ratios, for times that go back, and where
    times and accelerations are not of one shape.

    Source: H. A. Gaberson, Shock severity estimation, Sound and Vibration 46 (1), 2012.

    >>> time = np.linspace(0.0, 0.01, 101)
    >>> blow = 100.0 * np.sin(np.pi * time / 0.01)
    >>> fj.shock.pseudo_velocity_spectrum(time, blow, [1.0, 10.0]).round(3).tolist()
    [0.59, 0.584]
    """
    time, acceleration = jnp.asarray(time), jnp.asarray(acceleration)
    if time.ndim != 1 or time.shape != acceleration.shape:
        raise ValueError(
            "Arguments `time` and `acceleration` must be of one shape (n,), but are of the shapes "
            f"{time.shape} and {acceleration.shape}."
        )
    if time.size > 1:
        remedy = "Sort the samples by their time."
        _check.scalar("time's steps", jnp.diff(time), least=0, unit="s", remedy=remedy)
    frequencies = _check.vector("frequencies", frequencies, above=0, unit="Hz")
    zeta = _check.scalar("damping_ratio", damping_ratio, least=0)
    if not isinstance(zeta, Tracer) and float(zeta) >= 1:
        raise ValueError(
            f"Argument `damping_ratio` must be below 1 [1], but is {float(zeta):g}: the oscillator "
            "of a shock spectrum rings."
        )
    steps = jnp.diff(time)

    def of(frequency):
        omega = 2 * jnp.pi * frequency
        decay, free = damping_ratio * omega, omega * (1 - damping_ratio**2) ** 0.5

        def advance(state, sample):
            (place, rate), (length, before, now) = state, sample
            # z = -(a_0 + k t) / omega^2 + 2 zeta k / omega^3 is the particular solution; the rest
            # of the state oscillates freely.
            slope = jnp.where(length > 0, now - before, 0.0) / jnp.where(length > 0, length, 1.0)
            lag = 2 * damping_ratio * slope / omega**3
            ringing = place + before / omega**2 - lag, rate + slope / omega**2
            place, rate = _free_motion(ringing, length, decay, free)
            place, rate = place - now / omega**2 + lag, rate - slope / omega**2
            return (place, rate), jnp.abs(place)

        zero = jnp.zeros_like(omega + acceleration[0])
        samples = (steps, acceleration[:-1], acceleration[1:])
        state, during = jax.lax.scan(advance, (zero, zero), samples)
        # The first time after the end at which the free motion turns.
        place, rate = state
        turn = jnp.arctan2(rate * free, omega**2 * place + decay * rate) / free
        turn = jnp.where(turn > 0, turn, turn + jnp.pi / free)
        after = jnp.abs(_free_motion(state, turn, decay, free)[0])
        return omega * jnp.maximum(jnp.max(during), after)

    return jax.vmap(of)(frequencies)


def _free_motion(state, time, decay, free):
    """A free oscillator's state after a time."""
    place, rate = state
    sine, cosine = jnp.sin(free * time), jnp.cos(free * time)
    other = (rate + decay * place) / free
    shrink = jnp.exp(-decay * time)
    moved = shrink * (place * cosine + other * sine)
    speed = shrink * (rate * cosine - (decay * other + free * place) * sine)
    return moved, speed
