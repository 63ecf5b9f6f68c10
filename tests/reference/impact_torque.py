"""The oblique impact on a fence that a torque drives, in NumPy and SciPy.

The hinge's angle phi is a state: with the modes of the clamped fence, of unit modal mass,

    (J_d + J) phi'' + p.eta'' = T(t) - c phi' - k phi - N sigma,  eta'' + p phi'' = ... - b N.

State: eta, eta', phi, phi', parcel. It starts at rest when the torque does; the parcel is put on
the fence when a rigid fence would be at the drive angle.
"""

import numpy as np
from scipy.integrate import solve_ivp

from .impact import on_parcel, refined_maximum, touching
from .impact_fence import Fence, contact
from .impact_shaft import inertia as fence_inertia


class _Turned:
    """The parameters of an impact with the fence at an angle and a speed of its own."""

    def __init__(self, impact, angle, speed):
        self._impact, self._motion = impact, (angle, speed, 0.0)

    def __getattr__(self, name):
        return getattr(self._impact, name)

    def drive(self, time):
        return self._motion


def touch_time(impact, torque, whole, damping, stiffness):
    """When a rigid fence is at the drive angle [s]."""

    def rate(time, state):
        push = torque(time) - damping * state[1] - stiffness * state[0]
        return [state[1], push / whole]

    def reached(time, state):
        return state[0] - impact.drive_angle

    reached.terminal, reached.direction = True, 1
    found = solve_ivp(
        rate, (0.0, 10.0), [0.0, 0.0], "DOP853", rtol=1e-11, atol=1e-13, events=reached
    )
    return float(found.t_events[0][0])


def solve(impact, torque, inertia, damping, stiffness, rtol=1e-7, samples=281):
    """Peak force [N] of one impact and the work of the torque from the first contact on [J], by the
    law T(t) [N m], J_d [kg m^2], c [N m s/rad] and k [N m/rad]."""
    link = impact.link
    m = link.frequency.size
    whole, swing = inertia + fence_inertia(impact), link.participation
    begins = touch_time(impact, torque, whole, damping, stiffness)

    def hinged(time, state, force, load, place):
        eta, eta_rate, (angle, speed) = state[:m], state[m : 2 * m], state[2 * m : 2 * m + 2]
        bend = -link.damping * eta_rate - link.frequency**2 * eta - force * load
        push = torque(time) - damping * speed - stiffness * angle - force * place
        turn = (push - swing @ bend) / (whole - swing @ swing)
        return np.concatenate([eta_rate, bend - turn * swing, [speed, turn]])

    none = np.zeros(m)
    start = solve_ivp(
        lambda time, state: hinged(time, state, 0.0, none, 0.0), (0.0, begins),
        np.zeros(2 * m + 2), "LSODA", rtol=1e-9, atol=1e-13, max_step=0.02,
    ).y[:, -1]  # fmt: skip

    def touch_at(state):
        fence = Fence(_Turned(impact, *state[2 * m : 2 * m + 2]), 0.0, state)
        return contact(impact, fence, state[2 * m + 2 : 2 * m + 8].tolist())

    def derivative(time, state):
        touch, parcel = touch_at(state), state[2 * m + 2 : 2 * m + 8].tolist()
        force_x, force_y, moment = on_parcel(impact, touch, parcel)
        moved = hinged(begins + time, state, touch.force, touch.fence_load, touch.arc)
        pushed = force_x / impact.mass, force_y / impact.mass, moment / impact.moment_of_inertia
        work = torque(begins + time) * state[2 * m + 1]
        return np.concatenate([moved, parcel[3:], pushed, [work]])

    fence = Fence(_Turned(impact, *start[2 * m :]), 0.0, start)
    begin = np.concatenate([start, touching(impact, fence), [0.0]])
    found = solve_ivp(
        derivative, (0.0, impact.horizon), begin, "LSODA", rtol=rtol, atol=1e-3 * rtol,
        dense_output=True, max_step=1e-3,
    )  # fmt: skip
    time = np.linspace(0.0, impact.horizon, samples)

    def force_at(instant):
        return touch_at(found.sol(instant)).force

    peak = refined_maximum(force_at, time, [force_at(t) for t in time])[1]
    return peak, float(found.y[-1, -1])
