"""Whole sorts at the limits of their arguments: a result within its fidelity's promise, or a status
that says what happened, in value and in gradient.

Every row of `extreme_sorts` is a lane of one compiled program a fidelity. The truth is
`Fidelity.reference` with steps of 0.1 ms and eight modes. `test_extreme_stages` does the same for
the stages.
"""

import functools

import jax
import numpy as np
import pytest
from robustness.extreme_sorts import (
    FIELDS,
    ORDINARY,
    ROWS,
    VARIED,
    differences,
    lane,
    program,
    rung,
    scene,
    truth,
)

import fencejax as fj

KIND = "sort"
PROMISE = {"coarse": 0.011, "standard": 0.0045}
"""Of the peak force; the fidelities promise 2.5 % of any scene with a good status."""
# Rows whose numbers every fidelity must give: a status that warned of all would pass all else.
GIVEN = {
    "ordinary", "thickness-0.1m", "thickness-0.3m", "one-link", "tip-2cm", "steel", "foam",
    "undamped", "overdamped", "mass-1g", "mass-100g", "mass-1kg", "mass-100kg", "size-1m",
    "centre-at-an-edge", "centre-low", "no-damping", "no-friction", "friction-5",
    "belt-friction-5", "static-is-kinetic", "drive-fast", "never-touched", "drive-still",
    "flat-impact", "all-but-flat", "corner-first", "other-corner-first", "far-out", "at-the-tip",
    "grazing", "chatter", "jam",
}
# They stick and are let go, over a speed that is not small beside theirs at the peak; or, light,
# bounce so often that the errors of all blows in the gradient, summed in size, are half of it; or
# bounce three times before the force is largest, which no fidelity is trusted with; or, without
# damping, bounce so high that a later blow may be the largest, as far as the tolerance tells.
WARNED = {
    ("jam", "coarse"), ("grazing", "coarse"), ("belt-friction-5", "coarse"), ("mass-1g", "coarse"),
    ("mass-100g", "coarse"), ("chatter", "coarse"), ("chatter", "standard"),
    ("no-damping", "coarse"),
}
# What the rungs cannot give is said, and by which status.
SAID = {
    ("chatter", "coarse"): fj.Status.STEP_TOO_COARSE,
    ("chatter", "standard"): fj.Status.STEP_TOO_COARSE,
    ("static-far-above", "coarse"): fj.Status.FRICTION_SMOOTHED,
    ("belt-still", "coarse"): fj.Status.STEP_TOO_COARSE,
    ("drive-slow", "coarse"): fj.Status.MODES_TOO_FEW,
    ("belt-20", "standard"): fj.Status.MODES_TOO_FEW,
    ("thickness-5mm", "standard"): fj.Status.MODES_TOO_FEW,
    ("size-1cm", "standard"): fj.Status.DEEP_PENETRATION,
    ("never-touched", "coarse"): fj.Status.NEVER_TOUCHED,
    ("drive-still", "standard"): fj.Status.NEVER_TOUCHED,
    ("at-the-tip", "coarse"): fj.Status.NEVER_TOUCHED,
    ("centre-at-an-edge", "standard"): fj.Status.LEFT_OVER_TIP,
}
# A fence of 1 MPa swings beyond all bounds: by which status that is said is rounding's doing.
REFUSED = {("rubber", "coarse"), ("rubber", "standard")}


@pytest.mark.parametrize("fidelity", PROMISE)
@pytest.mark.parametrize("name", ROWS[KIND])
def test_right_or_said(name, fidelity):
    at = lane(KIND, name)
    status, values = (each[at] for each in rung(KIND, fidelity)[:2])
    if (name, fidelity) in REFUSED:
        assert status > fj.Status.LEFT_OVER_TIP
    if name in GIVEN and (name, fidelity) not in WARNED:
        assert status <= fj.Status.LEFT_OVER_TIP
    if (name, fidelity) in SAID:
        assert status == SAID[name, fidelity]
    if status > fj.Status.LEFT_OVER_TIP:
        return
    assert np.all(np.isfinite(values))
    true_status, true = truth(KIND).status[at], truth(KIND).peak[at]
    assert true_status <= fj.Status.LEFT_OVER_TIP
    assert (status == fj.Status.NEVER_TOUCHED) == (true_status == fj.Status.NEVER_TOUCHED)
    assert abs(values[0] - true) <= PROMISE[fidelity] * true


# --- Gradients ----------------------------------------------------------------------------------

GRADIENT_PROMISE = 0.10
"""Of the peak force at `coarse`, as elasticities and relative to their norm."""


@functools.cache
def own_differences():
    return differences(program(KIND, "coarse", True), KIND, VARIED, 5e-6)


TOUCHED = sorted(GIVEN - {"never-touched", "drive-still", "at-the-tip"})


@pytest.mark.parametrize("name", TOUCHED)
def test_gradients_are_within_the_promise(name):
    at = lane(KIND, name)
    slopes, true = rung(KIND, "coarse")[2][at], truth(KIND).slopes[at]
    assert np.all(np.isfinite(slopes))
    off = np.linalg.norm(slopes - true)
    assert off <= GRADIENT_PROMISE * np.linalg.norm(true)


# Where the steps change with the numbers the value jumps, of 1 g by 4e-4: differences over 5e-6 of
# the numbers seldom cross such a place. What Newton's method lets be is far less here than 5e-7.
@pytest.mark.parametrize("name", TOUCHED)
def test_gradients_are_those_of_the_values(name):
    at = lane(KIND, name)
    slopes, expected = rung(KIND, "coarse")[2][at], own_differences()[at, 0]
    assert abs(slopes.sum() - expected) <= 1e-4 * np.linalg.norm(slopes)


# --- Long horizons ------------------------------------------------------------------------------


def test_a_hundred_cycles():
    """The drive rests after its cycle, and the parcel rides on: 135 s more change nothing of the
    encounter. Steps are of other lengths only behind it."""
    @jax.jit
    def run(x):
        result = fj.simulate(scene(KIND, x, 136.0), fidelity=fj.Fidelity.coarse(), only=FIELDS)
        return result.status, [getattr(result, field) for field in FIELDS]

    status, values = run({k: float(v) for k, v in ORDINARY.items()})
    assert int(status) == fj.Status.SUCCESSFUL
    np.testing.assert_allclose(values, rung(KIND, "coarse")[1][lane(KIND, "ordinary")], rtol=1e-6)
