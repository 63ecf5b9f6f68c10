"""Fatigue life of a fence: rainflow counting of its stress over a sort, with Miner's rule.

Comparisons decide which samples are turning points and which of these form a cycle; a small change
of the design does not change that. The derivative is that of the values at the turning points; it
is exact except where two ranges are equal. The exponent m of Basquin's line, N sigma_a^m =
constant, is the material's own (`Material.fatigue_exponent`), or else `EXPONENT`.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ..parts import ENDURANCE as ENDURANCE, EXPONENT as EXPONENT, Material
from ..results import Course, Measure, Trace
from .objectives import of_measure

# Cycles below this share of the range do not count: with an exponent of 10 one does 0.02^10 = 1e-17
# of the damage of the largest.
_GATE = 0.02
# Largest number of turning points.
_MOST = 256
# Number of nodes at which cycles are counted.
_PLACES = 4


class Cycles(NamedTuple):
    """Cycles of a signal: amplitude and mean [its unit], and the count of each, 1 or 1/2 [1]; 0 for
    unused entries. All of shape (k,)."""

    amplitude: Array
    mean: Array
    weight: Array


def _turning(signal: Array, gate: Array, most: int) -> tuple[Array, Array]:
    """Indices of the points at which a signal turns by more than `gate`, with both ends, of shape
    (most,), and their number."""

    def look(carry, sample):
        direction, extreme, place = carry
        value, here = sample
        ahead = (value - extreme) * direction
        resting = direction == 0
        onward = jnp.where(resting, jnp.abs(value - extreme) > gate, ahead > 0)
        back = ~resting & (ahead < -gate)
        moved = onward | back
        turned = jnp.where(resting, jnp.sign(value - extreme), -direction)
        carry = (
            jnp.where(back | (resting & onward), turned, direction),
            jnp.where(moved, value, extreme),
            jnp.where(moved, here, place),
        )
        return carry, (back, place)

    here = jnp.arange(signal.shape[0], dtype=jnp.int32)
    begin = (jnp.zeros_like(signal[0]), signal[0], here[0])
    (_, _, last), (turns, places) = jax.lax.scan(look, begin, (signal, here))
    number = jnp.cumsum(turns.astype(jnp.int32))
    found = jnp.zeros(most, jnp.int32)
    found = found.at[jnp.where(turns, number, most)].set(places, mode="drop")
    count = number[-1] + 2
    return found.at[count - 1].set(last, mode="drop"), count


def _paired(values: Array, count: Array) -> tuple[Array, Array, Array]:
    """The two turning points of each cycle and the count of the cycle; the first `count` values are
    turning points.

    Where of four points in a row the middle range is no larger than the two beside it, the two
    middle points are a cycle and are removed. Each remaining range is half a cycle. This is
    equivalent to ASTM E1049-85, 5.4.4, with its three points in a row.
    """
    most = values.shape[0]
    spare = jnp.int32(most)

    def step(carry, _):
        stack, depth, following = carry
        at = [stack[jnp.maximum(depth - k, 0)] for k in (4, 3, 2, 1)]
        a, b, c, d = (values[place] for place in at)
        inner = jnp.abs(c - b)
        closed = (depth > 3) & (inner <= jnp.abs(b - a)) & (inner <= jnp.abs(d - c))
        pushed = ~closed & (following < count)
        where = jnp.where(closed, depth - 3, jnp.where(pushed, depth, spare))
        stack = stack.at[where].set(jnp.where(closed, at[3], following))
        depth = depth + jnp.where(closed, -2, jnp.where(pushed, 1, 0)).astype(jnp.int32)
        following = following + pushed.astype(jnp.int32)
        return (stack, depth, following), (at[1], at[2], closed)

    begin = (jnp.zeros(most + 1, jnp.int32), jnp.int32(0), jnp.int32(0))
    (stack, depth, _), (one, other, closed) = jax.lax.scan(
        step, begin, None, length=most + most // 2
    )
    left = jnp.arange(most, dtype=jnp.int32) < depth - 1
    count_of = jnp.concatenate([closed.astype(values.dtype), 0.5 * left.astype(values.dtype)])
    return (
        jnp.concatenate([one, stack[:-1]]), jnp.concatenate([other, stack[1:]]), count_of,
    )  # fmt: skip


def _vertices(signal: Array, time: Array) -> Array:
    """The signal, each extreme replaced by the vertex of the parabola through three samples."""
    before, after = time[1:-1] - time[:-2], time[2:] - time[1:-1]
    spaced = (before > 0) & (after > 0)
    ratio = jnp.where(spaced, before, 1.0) / jnp.where(spaced, after, 1.0)
    rise, fall = signal[2:] - signal[1:-1], signal[:-2] - signal[1:-1]
    curve = (rise + fall / ratio) / (1 + ratio)
    slope = rise - curve
    turns = spaced & (rise * fall >= 0) & (curve != 0)
    vertex = signal[1:-1] - slope**2 / jnp.where(turns, 4 * curve, 1.0)
    inner = jnp.where(turns, vertex, signal[1:-1])
    return jnp.concatenate([signal[:1], inner, signal[-1:]])


def rainflow(
    signal: ArrayLike,
    time: ArrayLike | None = None,
    *,
    repeating: bool = False,
    gate: float = 0.0,
    most: int | None = None,
) -> Cycles:
    """Cycles of a sampled signal by rainflow counting (ASTM E1049-85, 5.4.4).

    **Arguments:**

    - `signal`: of shape (n,), n at least 3.
    - `time` [s]: of the samples, of shape (n,). With it, the turning points are the vertices of
      parabolas through three samples, of third order in the step; else the samples themselves.
    - `repeating`: whether the signal is periodic. It is then counted from its largest value on, so
      that all of its cycles are whole ones (5.4.5).
    - `gate` [1]: ranges below this share of the whole range are ignored.
    - `most`: the most turning points, by default as many as n samples can have.

    The counts are NaN where there are more turning points. Differentiable in the signal.
    """
    signal = jnp.asarray(signal)
    values = signal if time is None else _vertices(signal, jnp.asarray(time))
    if repeating:
        order = jnp.argmax(jax.lax.stop_gradient(signal)).astype(jnp.int32)
        order = (order + jnp.arange(signal.shape[0] + 1, dtype=jnp.int32)) % signal.shape[0]
        signal, values = signal[order], values[order]
    most = signal.shape[0] if most is None else min(most, signal.shape[0])
    fixed = jax.lax.stop_gradient(signal)
    places, count = _turning(fixed, gate * (jnp.max(fixed) - jnp.min(fixed)), most)
    points = values[places]
    one, other, counts = _paired(jax.lax.stop_gradient(points), count)
    first, second = points[one], points[other]
    counts = jnp.where(count <= most, counts, jnp.nan)
    return Cycles(0.5 * jnp.abs(first - second), 0.5 * (first + second), counts)


def reversed_amplitude(cycles: Cycles) -> Array:
    """sigma_ar = sqrt(sigma_max sigma_a), the amplitude of the fully reversed cycle that does as
    much damage as the cycle with its mean; 0 where the whole cycle is in compression.

    Smith, Watson and Topper, A stress-strain function for the fatigue of metals, J. Materials 5
    (1970), 767-778: the mean-stress correction that needs no further strength of the material.
    """
    square = jnp.maximum(cycles.mean + cycles.amplitude, 0.0) * cycles.amplitude
    return jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)


def equivalent_amplitude(cycles: Cycles, exponent: ArrayLike = EXPONENT) -> Array:
    """sigma_eq = (sum n_i sigma_ar,i^m)^(1/m), the reversed amplitude of the one cycle that does as
    much damage as all of them (Basquin's line, Miner's sum)."""
    amplitude = reversed_amplitude(cycles)
    largest = jax.lax.stop_gradient(jnp.max(amplitude))
    size = jnp.where(largest > 0, largest, 1.0)
    total = jnp.sum(cycles.weight * (amplitude / size) ** exponent)
    any_ = total != 0
    root = jnp.where(any_, total, 1.0) ** (1 / jnp.asarray(exponent))
    return jnp.where(any_, size * root, 0.0)


def damage(equivalent: ArrayLike, strength: ArrayLike, exponent: ArrayLike = EXPONENT) -> Array:
    """The share of a fence's life [1] that one sort uses up: (sigma_eq / sigma_D)^m / 1e7, with
    sigma_D the amplitude that the fence endures for 1e7 cycles [Pa]."""
    return (jnp.asarray(equivalent) / jnp.asarray(strength)) ** exponent / ENDURANCE


def life(equivalent: ArrayLike, strength: ArrayLike, exponent: ArrayLike = EXPONENT) -> Array:
    """Sorts [1] until a fence breaks: 1 over the `damage` of one."""
    return 1 / damage(equivalent, strength, exponent)


def amplitude_for(sorts: float, strength: ArrayLike, exponent: ArrayLike = EXPONENT) -> Array:
    """The equivalent amplitude [Pa] that the fence endures for a number of sorts."""
    return jnp.asarray(strength) * (ENDURANCE / sorts) ** (1 / jnp.asarray(exponent))


def exponent_of(material: Material) -> Array | float:
    """m of Basquin's line [1] for a material."""
    return EXPONENT if material.fatigue_exponent is None else material.fatigue_exponent


STRESS = Trace("stress", lambda sample: sample.stresses)
"""The bending stress at the flexible link's nodes at every sample."""


def worst_amplitude(course: Course, exponent: ArrayLike = EXPONENT) -> Array:
    """The largest equivalent amplitude [Pa] of the stresses over a periodic sort, of shape
    (n, nodes), on either side of the fence. Cycles are counted at the four nodes whose largest
    cycle does most damage."""
    if course.signal is None:
        return jnp.zeros_like(course.time[0])

    def at(stress: Array) -> Array:
        cycles = rainflow(stress, course.time, repeating=True, gate=_GATE, most=_MOST)
        other = cycles._replace(mean=-cycles.mean)
        return jnp.maximum(*(equivalent_amplitude(side, exponent) for side in (cycles, other)))

    fixed = jax.lax.stop_gradient(course.signal)
    high, low = jnp.max(fixed, axis=0), jnp.min(fixed, axis=0)
    largest = jnp.maximum(high, -low) * (high - low)
    _, places = jax.lax.top_k(largest, min(_PLACES, largest.shape[0]))
    return jnp.max(jax.vmap(at, in_axes=1)(course.signal[:, places]))


def _of_sort(course: Course, scene) -> Array:
    fence = scene.fence
    return worst_amplitude(course, EXPONENT if fence is None else exponent_of(fence.material))


FATIGUE_STRESS = of_measure(
    Measure(
        "fatigue_stress", "Pa", "reversed amplitude of the one bending cycle a sort that does as "
        "much harm as the stress over the sort, at the worst place of the flexible link",
        "at least 0", STRESS, _of_sort, of_scene=True,
    ),
    needs=("fence",),
)  # fmt: skip
"""The amplitude that the fence's material has to endure for as many cycles as there are sorts. The
stress is taken at the time loop's samples, 0.25 to 2 ms apart, and at the elements' nodes. Turning
points are refined between samples: with steps of 0.5 ms the peak of a mode of 100 Hz has a relative
error of (2 pi 100 Hz 0.5 ms)^4 / 384 = 3e-5."""
