"""A small sweep that serves many tests, and what two tables have in common."""

import dataclasses

import numpy as np

from optimize.sweep.configuration import SweepConfig

# 60 impacts in chunks of 16 lanes, two groups each. The fence's reach of 1 m is less than the
# farthest place of touch.
SMALL = SweepConfig(
    vary=("mass=1:20:5", "reach=1:1.3:3:linear", "distance=0.6:1.2:4"),
    duration=0.05,
    fidelity="fast",
    chunk=16,
    group=8,
    tolerated=0.3,
    plots=False,
)
CHUNKS = 4


def small(out, **changes):
    return dataclasses.replace(SMALL, out=out, **changes)


def assert_same(one, other):
    """Tables equal bit by bit."""
    for column in ("variables", "outputs", "gradient"):
        a, b = getattr(one, column), getattr(other, column)
        assert list(a) == list(b)
        for name in a:
            np.testing.assert_array_equal(a[name], b[name], err_msg=name)
    np.testing.assert_array_equal(one.status, other.status)
    assert one.units == other.units
    assert one.shape == other.shape
