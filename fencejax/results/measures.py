"""The measures of a result, one row each; every other list of measures is made from this table.

To add a measure, add a row: its meaning, the accumulator it is read from (one of `accumulators`, or
a new one), and how it is read. It is then a field of `fencejax.Result`, in its print, in
`simulate(only=...)`, in error estimates if it has a factor, an output of sweeps and an objective. A
measure of your own is a `Measure` given to `simulate(measures=...)`.
"""

import dataclasses
from collections.abc import Callable, Mapping

import jax.numpy as jnp
from jaxtyping import Array

from . import accumulators
from .accumulators import Accumulator, ContactTimes, Trace

# Factors by which the spread between fidelities is multiplied to give an error estimate. Chosen on
# 240 random impacts and 200 random sorts at `fast` and at `standard`, against `reference`: in each
# of these four sets the spread times the factor, rounded up to 2 or 3, is at least the true error
# in 95 % of the scenes or more. Measured again, and tried on fresh scenes, by
# `pytest tests/results/test_error_estimate.py --bench DIR`.
_USUAL, _WIDE = 2.0, 3.0


@dataclasses.dataclass(frozen=True)
class Measure:
    """One number of a result.

    **Fields:**

    - `name`: the name of the field of `fencejax.Result`.
    - `unit`: SI.
    - `meaning`: a line on what it is.
    - `sign`: `"at least 0"` or `"either way"`; `"NaN if none"` where it may be missing.
    - `accumulator`: the running state that it is read from, or a `Trace`.
    - `read`: the number [`unit`] from that state at the end, or from the trace's `Course`.
    - `of_scene`: whether `read` takes the scene, too, as its second argument.
    - `error_factor`: the factor of the spread between fidelities in an error estimate; `None` for
      no estimate.
    - `moment`: whether it is an instant or a duration, known to a step at best.
    - `label`, `scale`, `shown_unit`, `digits`: the row of a printed result, the value times `scale`
      with so many digits behind the point; no row without a label.
    - `note`: text behind the printed value; `{name}` stands for another measure.

    >>> spin = fj.results.accumulators.peak_of("spin", lambda sample: jnp.abs(sample.body.spin))
    >>> fling = fj.Measure("fling", "rad/s", "", "at least 0", spin, lambda state: state.value)
    >>> fling.name, fling.unit
    ('fling', 'rad/s')
    """

    name: str
    unit: str
    meaning: str
    sign: str
    accumulator: Accumulator | Trace
    read: Callable[..., Array]
    error_factor: float | None = None
    moment: bool = False
    label: str = ""
    scale: float = 1.0
    shown_unit: str = ""
    digits: int = 2
    note: str = ""
    of_scene: bool = False


def _value(state) -> Array:
    return jnp.zeros(()) if state is None else state.value


def _time(state) -> Array:
    return state.time


def _itself(state) -> Array:
    return state


def _of_contact(field: str) -> Callable[[ContactTimes], Array]:
    """A field of the times in contact; NaN where nothing touched."""
    return lambda state: jnp.where(state.touched > 0, getattr(state, field), jnp.nan)


_POSITIVE, _EITHER, _NONE = "at least 0", "either way", "NaN if none"

_ROWS = (
    Measure(
        "peak_force", "N",
        "largest normal force of the fence on the parcel (all its corners together), refined "
        "between steps; for the rigid wall, N_stiff",
        _POSITIVE, accumulators.FORCE, _value, _USUAL,
        label="peak force", shown_unit="N", note="at {peak_time}",
    ),
    Measure(
        "peak_time", "s", "time of the peak force", _POSITIVE, accumulators.FORCE, _time, _USUAL,
        moment=True, scale=1e3, shown_unit="ms",
    ),
    Measure(
        "impulse", "N s", "integral of the fence's normal force", _POSITIVE,
        accumulators.IMPULSE, _itself, _USUAL, label="impulse", shown_unit="N s", digits=3,
    ),
    Measure(
        "contact_time", "s", "how long the fence's force acts, in all", _POSITIVE,
        accumulators.CONTACT, lambda state: state.total, _USUAL, moment=True,
        label="contact", scale=1e3, shown_unit="ms", note="from {first_contact} to {last_contact}",
    ),
    Measure(
        "first_contact", "s", "time at which the fence's force begins", _NONE,
        accumulators.CONTACT, _of_contact("first"), _USUAL, moment=True,
        scale=1e3, shown_unit="ms",
    ),
    Measure(
        "last_contact", "s", "time at which the fence's force ends for the last time", _NONE,
        accumulators.CONTACT, _of_contact("last"), _USUAL, moment=True,
        scale=1e3, shown_unit="ms",
    ),
    Measure(
        "leave_x", "m", "x of C_s where the fence's force ends for the last time", _NONE,
        accumulators.CONTACT, _of_contact("x"), _WIDE,
        label="leaves at x", shown_unit="m", digits=3, note="y {leave_y} (C_s, end of the force)",
    ),
    Measure(
        "leave_y", "m", "y of C_s where the fence's force ends for the last time", _NONE,
        accumulators.CONTACT, _of_contact("y"), _USUAL, shown_unit="m", digits=3,
    ),
    Measure(
        "tip_deflection", "m", "largest deflection of the tip by bending",
        _POSITIVE, accumulators.TIP, _value, _USUAL,
        label="tip deflection", scale=1e3, shown_unit="mm", note="at {tip_time}",
    ),
    Measure(
        "tip_time", "s", "time of the largest tip deflection", _POSITIVE,
        accumulators.TIP, _time, _USUAL, moment=True, scale=1e3, shown_unit="ms",
    ),
    Measure(
        "peak_stress", "Pa", "largest bending stress in the flexible link", _POSITIVE,
        accumulators.STRESS, _value, _WIDE,
        label="bending stress", scale=1e-6, shown_unit="MPa",
        note="at {stress_place} from the hinge",
    ),
    Measure(
        "stress_place", "m", "arc coordinate of the largest bending stress, from the hinge",
        _POSITIVE, accumulators.STRESS_PLACE, _itself, shown_unit="m", digits=3,
    ),
    Measure(
        "peak_torque", "N m", "largest moment of the drive at the hinge, either way", _POSITIVE,
        accumulators.TORQUE, _value, _WIDE, label="drive torque", shown_unit="N m", note="largest",
    ),
    Measure(
        "peak_border_force", "N", "largest normal force of the border on the parcel", _POSITIVE,
        accumulators.BORDER, _value, _USUAL, label="border force", shown_unit="N", note="largest",
    ),
    Measure(
        "peak_surface_force", "N", "largest normal force of the surfaces besides the border on the "
        "parcel (all together)", _POSITIVE, accumulators.SURFACE, _value, _USUAL,
        label="surface force", shown_unit="N", note="largest",
    ),
    Measure(
        "deepest", "m", "largest gap D of a corner under load: how far it was pressed in",
        _POSITIVE, accumulators.DEEPEST, _itself, _WIDE,
        label="pressed in by", scale=1e3, shown_unit="mm",
    ),
    Measure(
        "furthest_y", "m", "largest y of C_s at a step: how far the parcel got across the belt",
        _EITHER, accumulators.FURTHEST, _itself, _USUAL,
    ),
    Measure(
        "largest_place", "m", "largest arc coordinate of a corner under load: how far out the "
        "contact got", _POSITIVE, accumulators.LARGEST_PLACE, _itself, _USUAL,
    ),
    Measure(
        "defect", "N", "largest force left unbalanced by a step's equations", _POSITIVE,
        accumulators.UNBALANCE, _itself,
    ),
)  # fmt: skip

MEASURES: Mapping[str, Measure] = {measure.name: measure for measure in _ROWS}
"""Every measure by name."""

ESTIMATED = tuple(name for name, measure in MEASURES.items() if measure.error_factor is not None)
"""The names of the measures that have an error estimate."""
