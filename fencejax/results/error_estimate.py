"""Estimated errors of a result, measure by measure."""

from jaxtyping import Array

from ..printing import known
from .by_name import AbstractByName
from .measures import ESTIMATED, MEASURES


class ErrorEstimate(AbstractByName):
    """Estimated absolute errors of the measures of a `Result`, by the same names and in their
    units: `result.error.peak_force`.

    With q the value at the fidelity asked for, q_A at the coarser companion and q_B at the one
    with friction smoothed more on top (see `companions`), the estimate is

    e = s (|q - q_A| + |q_A - q_B| / 2) + e_0,

    e_0 = one step for moments and durations, 5e-4 |q| for the rest where the geometry is not
    `"chord"`, else 0. The factor s, 2 or 3, was calibrated on random impacts and sorts such that
    the true error is below e in at least 95 % of them, field by field. It covers what the fidelity
    gives away (modes, elements, geometry, step, smoothing of dry friction), not what the model
    leaves out, and neither the choice of `Fidelity.load` nor `Fidelity.tip_fade`. NaN where the
    value is NaN; infinite where a companion gives no number. A measure that was not asked for is
    `None`.

    Estimates are constants to differentiation: they add nothing to the cost of a derivative.

    >>> found = {"peak_force": jnp.array(12.0), "impulse": jnp.array(0.2)}
    >>> error = fj.ErrorEstimate(found)  # as `fj.simulate(scene, estimate_error=True).error`
    >>> print(f"{error.peak_force:.1f} N, {error.impulse:.1f} N s")
    12.0 N, 0.2 N s
    """

    errors: dict[str, Array]
    """The estimates by name."""

    _table = "errors"
    _known = ESTIMATED

    def _rows(self):
        if not known(*self.errors.values()):
            return None
        rows = []
        for name, leaf in self.errors.items():
            shown = f"{float(leaf):.3g}" if leaf.ndim == 0 else f"up to {float(leaf.max()):.3g}"
            rows.append((name, f"+- {shown} {MEASURES[name].unit}"))
        return rows
