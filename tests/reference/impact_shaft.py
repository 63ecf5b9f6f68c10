"""The oblique impact on a fence with a flexible shaft, in NumPy and SciPy.

The hinge turns by theta against the motor, which follows the drive: with the modes of the clamped
fence, of unit modal mass,

    J theta'' + p.eta'' = T - N sigma - J alpha'',  eta'' + p theta'' = ... - b N - p alpha'',

T = -k psi - c psi' the shaft's moment, psi its twist, which is theta less what the clutch has
slipped: |T| is at most the clutch's. State: eta, eta', theta, theta', psi, parcel.
"""


import numpy as np
from scipy.integrate import solve_ivp

from .beam import matrices
from .impact import on_parcel, refined_maximum, touching
from .impact_fence import Fence, contact


class _Ahead:
    """The parameters of an impact with the hinge ahead of the motor."""

    def __init__(self, impact, twist, rate):
        self._impact, self._twist, self._rate = impact, twist, rate

    def __getattr__(self, name):
        return getattr(self._impact, name)

    def drive(self, time):
        angle, speed, acceleration = self._impact.drive(time)
        return angle + self._twist, speed + self._rate, acceleration


def inertia(impact):
    """Of the straight fence about its hinge [kg m^2]."""
    mass, _ = matrices(
        impact.l_p, impact.width, impact.thickness, impact.E, impact.rho, impact.elements
    )
    swing = np.ones(mass.shape[0])
    swing[::2] = impact.l_s + impact.l_p / impact.elements * np.arange(impact.elements + 1)
    rigid = impact.rho * impact.width * impact.thickness * impact.l_s**3 / 3
    return rigid + swing @ mass @ swing


def solve(impact, stiffness, damping, hub=0.0, limit=np.inf, rtol=1e-7, samples=281):
    """Peak force [N], peak moment [N m] of the shaft and largest |theta| [rad] of one impact, by
    k [N m/rad], c [N m s/rad], the hub's inertia [kg m^2] and the clutch's moment [N m]."""
    link = impact.link
    m = link.frequency.size
    whole = hub + inertia(impact)
    swing = link.participation
    free = whole - swing @ swing

    def shaft(theta_rate, psi):
        moment = -stiffness * psi - damping * theta_rate
        if abs(moment) <= limit:
            return moment, theta_rate
        moment = np.copysign(limit, moment)
        return moment, -(moment + stiffness * psi) / damping

    def hinged(time, eta, eta_rate, theta_rate, psi, force, load, place):
        moment, psi_rate = shaft(theta_rate, psi)
        swept = impact.drive(time)[2]
        bend = -link.damping * eta_rate - link.frequency**2 * eta - force * load - swept * swing
        turn = (moment - force * place - swept * whole - swing @ bend) / free
        return np.concatenate([eta_rate, bend - turn * swing, [theta_rate, turn, psi_rate]])

    none = np.zeros(m)

    def swinging(time, state):
        eta, eta_rate, (_, rate, psi) = state[:m], state[m : 2 * m], state[2 * m :]
        return hinged(time, eta, eta_rate, rate, psi, 0.0, none, 0.0)

    start = solve_ivp(
        swinging, (-impact.touch_time, 0.0), np.zeros(2 * m + 3), "LSODA", rtol=1e-9, atol=1e-13
    ).y[:, -1]

    def touch_at(time, state):
        fence = Fence(_Ahead(impact, *state[2 * m : 2 * m + 2]), time, state)
        return fence, contact(impact, fence, state[2 * m + 3 :].tolist())

    def derivative(time, state):
        fence, touch = touch_at(time, state)
        parcel = state[2 * m + 3 :].tolist()
        rates = parcel[3:]
        force_x, force_y, torque = on_parcel(impact, touch, parcel)
        moved = hinged(
            time, state[:m], state[m : 2 * m], *state[2 * m + 1 : 2 * m + 3], touch.force,
            touch.fence_load, touch.arc,
        )  # fmt: skip
        pushed = force_x / impact.mass, force_y / impact.mass, torque / impact.moment_of_inertia
        return np.concatenate([moved, rates, pushed])

    fence = Fence(_Ahead(impact, *start[2 * m : 2 * m + 2]), 0.0, start)
    begin = np.concatenate([start, touching(impact, fence)])
    found = solve_ivp(
        derivative, (0.0, impact.horizon), begin, "LSODA", rtol=rtol, atol=1e-3 * rtol,
        dense_output=True, max_step=1e-3,
    )  # fmt: skip
    time = np.linspace(0.0, impact.horizon, samples)

    def force_at(instant):
        return touch_at(instant, found.sol(instant))[1].force

    def moment_at(instant):
        return abs(shaft(*found.sol(instant)[2 * m + 1 : 2 * m + 3])[0])

    states = found.sol(time)
    peak = refined_maximum(force_at, time, [force_at(t) for t in time])[1]
    moment = refined_maximum(moment_at, time, [moment_at(t) for t in time])[1]
    return peak, moment, float(np.max(np.abs(states[2 * m])))
