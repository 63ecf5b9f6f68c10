"""A parcel against a fence whose root is at rest, along its normal, in NumPy and SciPy: the modes
of the clamped finite-element link, the paper's contact law, and an elastic cover in series with it.

State: modal displacements and velocities, advance of the parcel and its rate, strain of the cover.
SI units throughout.
"""

from math import atan, cos, log, pi

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

from .impact_fence import shape
from .impact_parts import contact_force


def force_and_rate(impact, cover, depth, depth_rate, strain):
    """N [N] and the cover's strain rate [1/s], where the corner and the cover share the gap `depth`
    [m]: N = law(D - H e, D' - H e') = F(e + tau e').

    cover: thickness H [m], modulus E [Pa], contact length a [m], retardation time tau [s].
    """
    thickness, modulus, length, lag = cover
    scale = modulus * length * impact.width
    gap = depth - thickness * strain
    if gap <= 0:
        return 0.0, -strain / lag

    def missing(force):
        settled = 2 / pi * atan(pi * force / (2 * scale))
        rate = (settled - strain) / lag
        return contact_force(impact, gap, depth_rate - thickness * rate) - force

    high = contact_force(impact, gap, depth_rate + thickness * strain / lag) + 1.0
    force = brentq(missing, 0.0, high, xtol=1e-11, rtol=1e-14) if missing(0.0) > 0 else 0.0
    return force, (2 / pi * atan(pi * force / (2 * scale)) - strain) / lag


def solve(impact, speed, place, cover, horizon):
    """Peak force [N], energy [J] stored at the end in the cover, and that dissipated in cover and
    corner, of a blow at `speed` [m/s] at the arc coordinate `place` [m]."""
    link = impact.link
    size = impact.l_p / impact.elements
    element = int((place - impact.l_s) / size)
    phi = shape(impact, element, place - impact.l_s - element * size)
    m = link.frequency.size

    def at(state):
        eta, rate = state[:m], state[m : 2 * m]
        depth, depth_rate = state[2 * m] + phi @ eta, state[2 * m + 1] + phi @ rate
        return *force_and_rate(impact, cover, depth, depth_rate, state[-2]), depth_rate

    def derivative(_, state):
        force, strain_rate, depth_rate = at(state)
        eta, rate = state[:m], state[m : 2 * m]
        bend = -link.damping * rate - link.frequency**2 * eta - phi * force
        motion = state[2 * m + 1], -force / impact.mass
        return np.concatenate([rate, bend, motion, [strain_rate, force * depth_rate]])

    begin = np.zeros(2 * m + 4)
    begin[2 * m + 1] = speed
    found = solve_ivp(
        derivative, (0.0, horizon), begin, "Radau", rtol=1e-7, atol=1e-10, dense_output=True
    )
    times = np.linspace(0.0, horizon, 400)
    forces = [at(found.sol(t))[0] for t in times]
    top = int(np.argmax(forces))
    peak = -minimize_scalar(
        lambda t: -at(found.sol(t))[0], bounds=(times[top - 1], times[top + 1]), method="bounded",
        options={"xatol": 1e-9},
    ).fun  # fmt: skip
    thickness, modulus, length, _ = cover
    end = found.y[:, -1]
    stored = -4 / pi**2 * modulus * length * impact.width * thickness * log(cos(pi / 2 * end[-2]))
    return peak, stored, end[-1]
