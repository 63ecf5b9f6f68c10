"""Corners that stick while the normal force grows, and the growth of errors by blows."""

import pytest
from robustness.found_sorts import FOUND
from robustness.searched_scenes import KINDS

import fencejax as fj


def peak(name, fidelity):
    found = FOUND[name]
    scene = KINDS[found["kind"]].scene(found["numbers"])
    result = fj.simulate(scene, fidelity=fidelity, only="peak_force")
    return fj.Status(int(result.status)), float(result.peak_force) / found["peak_force"] - 1


def test_a_corner_does_not_stick_longer_under_a_growing_force():
    """A light parcel's corner sticks at the tip of a thin fence, breaks away and is struck: 2.8 %
    off as long as the friction at a step's end kept it sticking, and no status said so at any
    tolerance."""
    status, off = peak("a corner is held at the tip", fj.Fidelity.standard())
    assert status == fj.Status.SUCCESSFUL
    assert abs(off) < 0.02


@pytest.mark.parametrize("halvings", [3, 4])
def test_a_corner_lets_go_when_its_surface_gives_no_more(halvings):
    """A light parcel's corner sticks while its force grows to the peak, at which it breaks away.
    With the friction by the end's normal force that was late by half a step: 3.0 and 1.2 % off at
    steps of 0.13 and 0.06 ms, whatever the tolerance."""
    status, off = peak("a corner is held and let go", fj.Fidelity.coarse(halvings=halvings))
    assert status == fj.Status.SUCCESSFUL
    assert abs(off) < 0.01


def asks_for_a_finer_tolerance(name, fidelity):
    """With `fidelity` the force is off by more than is promised, and the status says so; with the
    next rung of `standard` it is not."""
    status, off = peak(name, fidelity)
    assert status == fj.Status.STEP_TOO_COARSE
    assert abs(off) > 0.025
    status, off = peak(name, fj.Fidelity.standard().ladder()[1])
    assert status == fj.Status.SUCCESSFUL
    assert abs(off) < 0.025


def test_two_blows_ask_for_a_finer_tolerance():
    """Two blows make 3.9 % of what a tolerance of 5e-4 leaves; a fifth of it keeps to 2.5 %."""
    asks_for_a_finer_tolerance("two blows", fj.Fidelity.standard())


def test_a_later_blow_that_may_be_higher_asks_for_a_finer_tolerance():
    """The peak before any blow is accurate, but the blow after it is higher by 4.5 %, which a
    tolerance of 2e-3 does not resolve."""
    asks_for_a_finer_tolerance("a later blow", fj.Fidelity.fast(step_tolerance=2e-3))
