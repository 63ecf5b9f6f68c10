"""CasADi with SUNDIALS' CVODES and its forward sensitivities, on the full finite-element system.

The state is (eta_1, eta_1', eta_2, ..., D, D'): with the penetration as a coordinate instead of
the parcel's place,

    D'' = -N / m - sum phi_i eta_i'',

N depends on two states only, so that the Jacobian is an arrow of O(n) entries instead of full rows
and columns. With CSparse this takes a third of the time of the system as it stands, with the
coordinate y and CasADi's own QR; that one is `plain`.

Settings found by halving and doubling:

- BDF with Newton's method and CSparse, and rtol = 1e4 atol.
- The peak is refined between samples, so few samples do: each ends a call of CVODES.
- The peak's gradient is that of N at a fixed time, the peak's: sensitivities run to that time
  only, by a second integrator over the scaled time t / t_peak; the state there is known from the
  first run's samples. Sensitivities on the whole grid take three times as long, and
  so do the variational equations as one system for CVODES.
"""

from typing import NamedTuple

import casadi
import numpy as np

from . import race


class Settings(NamedTuple):
    """rtol: tolerances of the run for the value, of the same run where the gradient is wanted, and
    of the sensitivities. samples: of the force."""

    value: float
    place: float
    sensitivity: float
    samples: int


SETTINGS = {
    (race.ENGINEERING.name, None): Settings(5e-5, 3e-5, 1e-3, 126),
    (race.ENGINEERING.name, 8): Settings(5e-5, 3e-5, 1e-3, 126),
    (race.TIGHT.name, None): Settings(3e-7, 1e-8, 1e-7, 251),
}


class _System(NamedTuple):
    integrator: casadi.Function
    start: np.ndarray
    force: casadi.Function
    slopes: casadi.Function


def _system(modes, rtol, times, plain, sensitivities=False):
    """The integrator over `times` / times[-1], with times[-1] as its last parameter."""
    count = modes.shape.size
    state, design = casadi.SX.sym("state", 2 * count + 2), casadi.SX.sym("design", 5)
    end = casadi.SX.sym("end")
    thickness, modulus, density, beta, length = casadi.vertsplit(design)
    rate = modulus * thickness**2 / (12 * density * length**4)
    square = rate * modes.eigenvalues
    load = modes.shape / casadi.sqrt(density * race.WIDTH * thickness * length)
    amplitude, speed = state[0 : 2 * count : 2], state[1 : 2 * count : 2]
    depth, closing = state[2 * count], state[2 * count + 1]
    if plain:  # the last two states are y and y'
        depth, closing = depth - casadi.dot(load, amplitude), closing - casadi.dot(load, speed)
    law = race.VISCOSITY * closing * depth**2 + race.STIFFNESS * depth**4
    force = casadi.if_else(depth > 0, casadi.fmax(0, law), 0)
    acceleration = load * force - beta * square * speed - square * amplitude
    beam = casadi.reshape(casadi.horzcat(speed, acceleration).T, 2 * count, 1)
    last = -force / race.MASS
    if not plain:
        last -= casadi.dot(load, acceleration)
    options = {"reltol": rtol, "abstol": 1e-4 * rtol, "max_num_steps": 1_000_000}
    options["linear_solver"] = "qr" if plain else "csparse"
    if sensitivities:
        options["fsens_err_con"] = True
    integrator = casadi.integrator(
        "integrator",
        "cvodes",
        {
            "x": state,
            "p": casadi.vertcat(design, end),
            "ode": end * casadi.vertcat(beam, state[2 * count + 1], last),
        },
        0.0,
        list(np.asarray(times) / times[-1]),
        options,
    )
    start = np.zeros(2 * count + 2)
    start[-1] = race.SPEED
    slopes = [casadi.jacobian(law, state), casadi.jacobian(law, design)]
    return _System(
        integrator,
        start,
        casadi.Function("force", [state, design], [force]).map(len(times)),
        casadi.Function("slopes", [state, design], slopes),
    )


def make(accuracy, modes=None, plain=False):
    """CasADi at `accuracy`; `modes` kept of the 40, all by default; `plain`: coordinate y."""
    settings = SETTINGS[accuracy.name, modes]
    kept = race.unit_modes(modes)
    time = np.linspace(0.0, race.DURATION, settings.samples)
    whole = _system(kept, settings.value, time[1:], plain)
    closer = _system(kept, settings.place, time[1:], plain)
    part = _system(kept, settings.sensitivity, np.array([1.0]), plain, sensitivities=True)
    forward = part.integrator.forward(5)
    unknown = np.zeros((whole.start.size, 1))

    def contact(system, parameters):
        """The states at the samples, and the peak of N with its time."""
        states = system.integrator(x0=system.start, p=np.append(parameters, race.DURATION))["xf"]
        force = np.append(0.0, np.array(system.force(states, parameters)))
        return states, race.refined_peak(time, force)

    def value(parameters):
        return contact(whole, parameters)[1]

    def value_and_gradient(parameters):
        states, (peak, at) = contact(closer, parameters)
        first, weights = race.interpolation(time[1:], at)
        there = np.array(states[:, first : first + 9]) @ weights
        seeds = np.vstack([np.diag(parameters), np.zeros((1, 5))])
        moved = forward(
            x0=part.start, p=np.append(parameters, at), out_xf=unknown, fwd_p=seeds
        )["fwd_xf"]
        by_state, by_design = part.slopes(there, parameters)
        gradient = np.array(by_state @ moved) / parameters + np.array(by_design)
        return peak, gradient.ravel()

    kind = "full" if modes is None else f"{modes} modes"
    if plain:
        kind += ", plain"
    version = casadi.CasadiMeta.version()
    return race.Peer(f"CasADi + CVODES, {kind}", version, value, value_and_gradient)
