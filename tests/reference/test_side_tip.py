"""The tip meets the flat side first: against an independent version, and its effect."""

import jax
import numpy as np
import pytest
from reference.impact import Impact
from reference.side_tip import strike

import fencejax as fj

FRONT, OFFSET, SPEED, MASS = 0.7, 0.4, 1.5, 15.0
# The same two modes, chords and smoothing of friction in both versions.
FIDELITY = fj.Fidelity(
    modes=2, static_correction=False, geometry="chord", step=2.5e-4, step_tolerance=None
)
WIDTH = 0.7


def sort(mass=MASS, offset=OFFSET, angle=0.0, **changes):
    return fj.scenes.whole_sort(
        front=FRONT, offset=offset, angle=angle, parcel=fj.Parcel(mass=mass),
        belt=fj.Belt(speed=SPEED), border=None, duration=0.8, **changes,
    )  # fmt: skip


@jax.jit
def met(mass, offset, angle):
    """What comes of a sort in which corner 1 and the side behind it can be met, and how its peak
    force goes with mass and offset."""

    def outcome(mass, offset):
        result = fj.simulate(
            sort(mass, offset, angle, fence_corners=(1,)), fidelity=FIDELITY,
            only=("peak_force", "final", "energy"),
        )  # fmt: skip
        return result.peak_force, (result.peak_force, result.final.y, result.energy, result.status)

    return jax.jacfwd(outcome, (0, 1), has_aux=True)(mass, offset)


def independent(mass=MASS, offset=OFFSET):
    slip, static = FIDELITY.smoothing
    impact = Impact(
        drive_angle=0.0, belt_speed=SPEED, mass=mass, epsilon=slip, stribeck=static, modes=2,
        load="cubic",
    )  # fmt: skip
    return strike(impact, FRONT, offset, np.arange(0.34, 0.441, 0.005), rtol=1e-7)


def test_a_sort_that_the_tip_decides():
    """The parcel is 0.4 m from the border and ahead: when the fence comes, corner 1 is 0.2 m beyond
    the tip and corner 2 behind the line of the fence, so that the tip strikes the flat side between
    them. Its force on the side ahead of C_s turns the parcel and throws it off the belt. A fence
    whose tip met no side would let it sink in until corner 2 is there, hit it there less hard, and
    leave C_s on the belt."""
    slope, (peak, y, energy, status) = met(MASS, OFFSET, 0.0)
    assert int(status) == fj.Status.SUCCESSFUL
    theirs = independent()
    # From the lower side, 0 of the polygon's, at the first contact.
    assert theirs.side == 0
    assert theirs.force.max() > 0
    assert float(peak) == pytest.approx(theirs.peak, rel=1e-3)
    # Of the second order in the step, 2e-7 at 0.1 ms; the longest stride here is eight steps of
    # 0.25 ms.
    turned = sum(abs(float(term)) for term in jax.tree.leaves(energy))
    assert abs(float(energy.residual)) < 5e-4 * turned
    # The differences' error is of the second order in their steps: some 1e-4.
    by_mass = (independent(mass=15.1).peak - independent(mass=14.9).peak) / 0.2
    by_offset = (independent(offset=0.402).peak - independent(offset=0.398).peak) / 0.004
    np.testing.assert_allclose(slope, (by_mass, by_offset), rtol=1e-2)
    without = fj.simulate(
        sort(tip_contact=False), fidelity=FIDELITY.replace(geometry="arc"),
        only=("peak_force", "final"),
    )  # fmt: skip
    assert float(y) > WIDTH + 0.5
    assert float(without.final.y) < WIDTH
    assert float(without.peak_force) < 0.7 * float(peak)


def test_a_corner_that_may_not_touch_is_reported():
    """Turned by -0.9 rad the parcel comes down on corner 4, which the scene leaves out."""
    _, (*_, status) = met(MASS, 0.1, -0.9)
    assert int(status) in (fj.Status.LEFT_OVER_TIP, fj.Status.PEAK_AT_TIP)
