"""Estimated errors of a result, field by field."""

import dataclasses

import equinox as eqx
from jax.core import Tracer
from jaxtyping import Array


class ErrorEstimate(eqx.Module):
    """Estimated absolute errors of the fields of a `Result` of the same name, in their units.

    With q the value at the fidelity asked for, q_A at the coarser companion and q_B at the one
    with friction smoothed more on top (see `companions`), the estimate is

    e = s (|q - q_A| + |q_A - q_B| / 2) + e_0,

    e_0 = one step for moments and durations, 5e-4 |q| for the rest where the geometry is not
    `"chord"`, else 0. The factor s, 2 or 3, was calibrated on random impacts and sorts such that
    the true error is below e in at least 95 % of them, field by field. It covers what the fidelity
    gives away (modes, elements, geometry, step, smoothing of dry friction), not what the model
    leaves out, and neither the choice of `Fidelity.load` nor `Fidelity.tip_fade`. NaN where the
    value is NaN; infinite where a companion gives no number. A field that was not asked for is
    `None`.

    Estimates are constants to differentiation: they add nothing to the cost of a derivative.
    """

    peak_force: Array | None
    peak_time: Array | None
    tip_deflection: Array | None
    tip_time: Array | None
    peak_stress: Array | None
    impulse: Array | None
    contact_time: Array | None
    first_contact: Array | None
    last_contact: Array | None
    leave_x: Array | None
    leave_y: Array | None
    furthest_y: Array | None
    largest_place: Array | None
    peak_border_force: Array | None
    peak_torque: Array | None
    deepest: Array | None

    def __str__(self) -> str:
        named = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        named = {name: leaf for name, leaf in named.items() if leaf is not None}
        if any(isinstance(leaf, Tracer) for leaf in named.values()):
            return "ErrorEstimate(traced)"
        rows = []
        for name, leaf in named.items():
            shown = f"{float(leaf):.3g}" if leaf.ndim == 0 else f"up to {float(leaf.max()):.3g}"
            rows.append(f"{name:>18}  +- {shown} {UNITS[name]}")
        return "\n".join(rows)


FIELDS = tuple(field.name for field in dataclasses.fields(ErrorEstimate))
"""The fields of `Result` that have an error estimate."""

_UNITS = ("N", "s", "m", "s", "Pa", "N s", *"sss", *"mmmm", "N", "N m", "m")
UNITS = dict(zip(FIELDS, _UNITS, strict=True))
