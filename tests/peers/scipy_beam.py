"""SciPy's LSODA (`scipy.integrate.odeint`) on the full finite-element system, in NumPy.

The state is (eta, eta', y, y'): rest of the equations as in `race`. Settings found by halving and
doubling, value first:

- `odeint` rather than `solve_ivp(method="LSODA")`: the same integrator, but its loop over steps is
  compiled. BDF and Radau of `solve_ivp` take three and five times as long at the same accuracy.
- The Jacobian is given: without it every update costs 2 n + 2 more right-hand sides.
- Gradient by forward differences of the whole run in the logarithm of each parameter, at a
  tolerance tight enough that its noise over the step stays below the accuracy asked for; the
  steps are long where the elasticity is small (beta) and short where it is a difference of large
  ones (rho). Central differences with one Richardson extrapolation where 5e-7 is asked for.
"""

from typing import NamedTuple

import numpy as np
import scipy
from scipy.integrate import odeint

from . import race


class Settings(NamedTuple):
    """value, gradient: rtol of the runs; atol is 1e-4 of it. steps: of the differences in the
    logarithm of each parameter. extrapolate: central differences, extrapolated. samples: of the
    force."""

    value: float
    gradient: float
    steps: tuple
    extrapolate: bool = False
    samples: int = 251


SETTINGS = {
    (race.ENGINEERING.name, None): Settings(1e-3, 1e-6, (5e-3, 5e-3, 1e-3, 2e-2, 5e-3)),
    (race.ENGINEERING.name, 8): Settings(1e-5, 1e-6, (5e-3, 5e-3, 1e-3, 2e-2, 5e-3)),
    (race.TIGHT.name, None): Settings(1e-6, 1e-9, (8e-3, 8e-3, 8e-3, 8e-3, 8e-3), True),
}


def equations(parameters, modes):
    """Right-hand side, Jacobian and force for `odeint`, from the modes of `race.unit_modes`."""
    rate, size = race.scales(parameters)
    square = rate * modes.eigenvalues
    load = size * modes.shape
    damping = parameters[3] * square
    count = load.size
    place, speed = slice(0, count), slice(count, 2 * count)
    constant = np.zeros((2 * count + 2, 2 * count + 2))
    index = np.arange(count)
    constant[index, count + index] = 1.0
    constant[count + index, index] = -square
    constant[count + index, count + index] = -damping
    constant[2 * count, 2 * count + 1] = 1.0

    def gap(state):
        return (
            state[..., 2 * count] - state[..., place] @ load,
            state[..., 2 * count + 1] - state[..., speed] @ load,
        )

    def contact(state):
        depth, closing = gap(state)
        law = race.VISCOSITY * closing * depth**2 + race.STIFFNESS * depth**4
        return np.where(depth > 0, np.maximum(law, 0.0), 0.0)

    def derivative(time, state):
        del time
        depth = state[2 * count] - load @ state[place]
        force = 0.0
        if depth > 0:
            closing = state[2 * count + 1] - load @ state[speed]
            force = max(0.0, depth**2 * (race.VISCOSITY * closing + race.STIFFNESS * depth**2))
        change = np.empty_like(state)
        change[place] = state[speed]
        change[speed] = load * force - damping * state[speed] - square * state[place]
        change[2 * count] = state[2 * count + 1]
        change[2 * count + 1] = -force / race.MASS
        return change

    def jacobian(time, state):
        del time
        depth, closing = gap(state)
        matrix = constant.copy()
        if depth > 0 and race.VISCOSITY * closing + race.STIFFNESS * depth**2 > 0:
            by_depth = 2 * race.VISCOSITY * closing * depth + 4 * race.STIFFNESS * depth**3
            by_closing = race.VISCOSITY * depth**2
            row = np.concatenate([-by_depth * load, -by_closing * load, [by_depth, by_closing]])
            matrix[speed] += load[:, None] * row
            matrix[2 * count + 1] = -row / race.MASS
        return matrix

    return derivative, jacobian, contact


def run(parameters, modes, rtol, samples):
    """Largest N [N] and its time [s]."""
    derivative, jacobian, contact = equations(parameters, modes)
    start = np.zeros(2 * modes.shape.size + 2)
    start[-1] = race.SPEED
    time = np.linspace(0.0, race.DURATION, samples)
    states = odeint(
        derivative,
        start,
        time,
        Dfun=jacobian,
        tfirst=True,
        rtol=rtol,
        atol=1e-4 * rtol,
        mxstep=100_000,
    )
    return race.refined_peak(time, contact(states))


def make(accuracy, modes=None):
    """SciPy at `accuracy`; `modes` kept of the 40, all by default."""
    kept = race.unit_modes(modes)
    settings = SETTINGS[accuracy.name, modes]

    def value(parameters):
        return run(parameters, kept, settings.value, settings.samples)

    def logarithm(parameters):
        return np.log(run(parameters, kept, settings.gradient, settings.samples)[0])

    def value_and_gradient(parameters):
        parameters = np.asarray(parameters, float)
        middle = logarithm(parameters)
        slopes = np.empty(parameters.size)
        for index in range(parameters.size):

            def along(step, index=index):
                moved = parameters.copy()
                moved[index] *= np.exp(step)
                return logarithm(moved)

            h = settings.steps[index]
            if settings.extrapolate:
                wide = (along(h) - along(-h)) / (2 * h)
                narrow = (along(h / 2) - along(-h / 2)) / h
                slopes[index] = (4 * narrow - wide) / 3
            else:
                slopes[index] = (along(h) - middle) / h
        peak = float(np.exp(middle))
        return peak, slopes * peak / parameters

    kind = "full" if modes is None else f"{modes} modes"
    return race.Peer(f"SciPy LSODA, {kind}", scipy.__version__, value, value_and_gradient)
