"""The golden numbers that are cheap to compute; all of them by `python tests/reference/golden.py`.

Processors and compiler settings order sums and contract products differently. A step of a few
hundred operations then differs by some units of round-off, 2.2e-16 relative to the forces at play;
contacts carry it on over some 500 steps, and Newton's method stops at an unbalanced force that is
itself of the size of round-off once it has converged (its steps are quadratic). That bounds the
relative difference by about 500 x 100 x 2.2e-16 = 1e-11 for values; tangents grow no faster, but
gradients are sums of terms up to 100 times as large as they are: 1e-9. Measured between programs
unoptimised, fully optimised and without vector instructions: 4e-12 and 2e-11.

What depends on the modes differs by more from one processor to another, whose LAPACK orders sums in
its own way: a beam's eigenvalues are right to round-off beside the largest one, which is 4.6e7
times the first, so 1e-8 of that, half as much its frequency. Its phase after 20 rad is off by 1e-7
at worst, and as much the energies that go to and fro with it. Measured: 5e-9.
"""

import numpy as np
import pytest

from . import golden

CHEAP = [
    "power taper, small deflection",
    "border and fence",
    "uniform fence, S-curve, corner 2",
    "free motion beside a fence",
    "normal impact",
    "rigid wall",
]
RELATIVE = 1e-9
# Of what goes with the phase of the modes.
RELATIVE_OF_MODES = 1e-7
# Numbers that are zero but for round-off: metres, joules and the like; slopes, per pascal too.
ABSOLUTE, ABSOLUTE_SLOPE = 1e-12, 1e-17
# The defect is the energy that the steps lose: a small difference of energies of some joules,
# relative to them.
ABSOLUTE_DEFECT = 1e-8


def bounds(key):
    """Relative and absolute tolerance of a number."""
    if key == "defect":
        return 0.0, ABSOLUTE_DEFECT
    of_modes = key.startswith(("energy.", "gradient "))
    relative = RELATIVE_OF_MODES if of_modes else RELATIVE
    return relative, ABSOLUTE_SLOPE if key.startswith("gradient ") else ABSOLUTE


@pytest.mark.parametrize("name", CHEAP)
def test_golden_numbers(name):
    known, found = golden.recorded()[name], golden.compute(name)
    # A new measure or part adds numbers and moves none.
    assert found.keys() >= known.keys()
    for key, values in known.items():
        relative, absolute = bounds(key)
        np.testing.assert_allclose(found[key], values, relative, absolute, err_msg=key)


def test_golden_cases_are_all_recorded():
    assert golden.recorded().keys() == golden.CASES.keys()
    assert set(CHEAP) < golden.CASES.keys()


@pytest.mark.parametrize("name", golden.CASES)
def test_golden_numbers_say_something(name):
    # A case whose measure or gradient is zero would not notice a change.
    known = golden.recorded()[name]
    measure = golden.CASES[name][2]
    assert any(known["peak_force"]) or measure not in (None, "peak_force")
    if measure is not None:
        assert known[measure] != [0.0]
        slopes = [key for key in known if key.startswith("gradient ") and any(known[key])]
        assert len(slopes) >= 4
