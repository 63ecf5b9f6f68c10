"""SciPy's LSODA on the full oblique impact: the NumPy equations of `reference.impact`.

Belt and fence friction, sliding, the drive and the parcel's rotation, with as many of the link's
modes as asked for. Settings found by halving and doubling, for a peak within 1 %:

- `odeint`, as in `scipy_beam`: `solve_ivp` with its dense output takes half as long again, and
  Radau and BDF twice as long as that. The Jacobian is given.
- Two modes, friction smoothed over 0.02 m/s as `Fidelity.fast` does, rtol 1e-2. One mode and the
  small-deflection geometry halve the time, but reach 1 % only by errors that cancel.
- The modes are found once, outside the time measured.
"""

from dataclasses import replace

import numpy as np
from reference.impact import Fence, Impact, contact, derivative, initial_state, jacobian
from scipy.integrate import odeint

from . import race

SMOOTHED = Impact(load="cubic", horizon=0.13, epsilon=2e-2, stribeck=1e-1)
CHEAP = replace(SMOOTHED, modes=2)


def peak(impact, rtol=1e-2, samples=34):
    """Largest N [N] and its time after the first contact [s]."""
    time = np.linspace(0.0, impact.horizon, samples)
    states = odeint(
        lambda t, state: derivative(impact, t, state),
        initial_state(impact),
        time,
        Dfun=lambda t, state: jacobian(impact, t, state),
        tfirst=True,
        rtol=rtol,
        atol=1e-3 * rtol,
    )
    count = impact.link.frequency.size
    force = [
        contact(impact, Fence(impact, t, state), state[2 * count : 2 * count + 6]).force
        for t, state in zip(time, states, strict=True)
    ]
    return race.refined_peak(time, np.array(force))
