"""The amplitude of the tip from the fence's remaining energy, in closed form."""

import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.design import ring_amplitude


def test_on_a_torque_drive_the_fence_swings_on_its_spring():
    # A fence that is stiff beside the drive's spring: E = k phi^2 / 2, a = R phi.
    fence, stiffness, energy = fj.Fence(thickness=0.09), 2.0, jnp.asarray(0.01)
    drive = fj.TorqueDrive([0.0], stiffness=stiffness)
    reach = float(fence.reach)
    # A force at the tip that balances k phi bends the tip by this share of R phi.
    bent = stiffness * 0.75**3 / (1.5 * 3e9 * 0.132 * 0.09**3 / 12) / reach**2
    assert bent < 1e-3
    found = float(ring_amplitude(energy, fence, drive))
    assert found == pytest.approx(reach * np.sqrt(2 * 0.01 / stiffness), rel=2 * bent)
    # Any other drive moves the fence as it is: nothing swings but the fence.
    bare = float(ring_amplitude(energy, fence))
    assert float(ring_amplitude(energy, fence, fj.HarmonicDrive())) == bare
