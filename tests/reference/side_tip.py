"""The fence's tip against a flat side of the parcel, in NumPy and SciPy: a sort in which no corner
comes to the fence.

The tip is a point, and the parcel a polygon. The tip is clipped against the sides, one by one; the
side that it enters through counts, and its depth behind that side is the gap of the contact law.
The force acts along that side's inward normal at the tip, and friction where the tip's foot on the
side is. On the fence acts what of the force is across its tangent at the tip. State vector as in
`impact`, whose time begins with the swing here (`drive_angle=0`).
"""

from math import cos, sin
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from .impact import (
    Fence,
    belt_friction,
    contact_force,
    refined_maximum,
    smoothed_friction,
)


class Poke(NamedTuple):
    """The tip in the parcel: depth behind a side [m], its rate [m/s] and the force N [N]; the
    side's inward normal, the tip and its foot on the side, (x, y) [m]; the sliding speed of the
    parcel's side along itself, counterclockwise [m/s], and the slope of the fence there [rad]."""

    depth: float
    rate: float
    force: float
    inward: np.ndarray
    tip: np.ndarray
    foot: np.ndarray
    sliding: float
    slope: float


class Struck(NamedTuple):
    """What the tip does to the parcel: times [s] from the start of the swing, the parcel there
    (n, 6), the force N [N] and its peak, the time of the first contact and the side that was
    entered, 0 ... 3 from the lower one counterclockwise."""

    time: np.ndarray
    parcel: np.ndarray
    force: np.ndarray
    peak: float
    touch: float
    side: int


def polygon(impact, parcel):
    """Corners of the parcel in fixed axes, counterclockwise from its lower left, (4, 2) [m]."""
    x, y, phi = parcel[:3]
    a, b = impact.size
    corners = np.array([(-a, -b), (a, -b), (a, b), (-a, b)]) / 2 - impact.center
    turn = np.array([[cos(phi), -sin(phi)], [sin(phi), cos(phi)]])
    return np.array([x, y]) + corners @ turn.T


def clipped(corners, point):
    """Depth of a point behind each side of a counterclockwise polygon [m], positive inside, and the
    sides' inward normals; the sides in the order of their first corners."""
    edges = np.roll(corners, -1, axis=0) - corners
    inward = np.stack([-edges[:, 1], edges[:, 0]], axis=1)
    inward = inward / np.linalg.norm(inward, axis=1, keepdims=True)
    return np.sum((point - corners) * inward, axis=1), inward


def poked(impact, fence, parcel, side):
    """`Poke` of the tip and a side of the parcel."""
    tip = np.array([fence.node_x[-1], fence.node_y[-1]])
    tip_rate = np.array(fence.velocity(impact.elements - 1, fence.element_length))
    depths, normals = clipped(polygon(impact, parcel), tip)
    inward, depth = normals[side], float(depths[side])
    along = np.array([inward[1], -inward[0]])

    def moves(point):
        arm = point - parcel[:2]
        return parcel[3:5] + parcel[5] * np.array([-arm[1], arm[0]])

    foot = tip - depth * inward
    rate = float((tip_rate - moves(tip)) @ inward)
    sliding = float((moves(foot) - tip_rate) @ along)
    force = contact_force(impact, depth, rate)
    return Poke(depth, rate, force, inward, tip, foot, sliding, float(fence.q5[-1]))


def derivative(impact, time, state, side):
    """Time derivative of the state, the tip behind a `side`; `None`: outside the parcel."""
    link = impact.link
    count = link.frequency.size
    fence = Fence(impact, time, state)
    parcel = state[2 * count : 2 * count + 6]
    force_x, force_y, torque = belt_friction(impact, parcel[3:].tolist())
    load = normal = 0.0
    if side is not None:
        poke = poked(impact, fence, parcel, side)
        normal = poke.force
        load = normal * (poke.inward @ np.array([-sin(poke.slope), cos(poke.slope)]))
        drag = normal * poke.sliding * smoothed_friction(impact.mu_fence, abs(poke.sliding), impact)
        along = np.array([poke.inward[1], -poke.inward[0]])
        for push, point in ((normal * poke.inward, poke.tip), (-drag * along, poke.foot)):
            arm = point - parcel[:2]
            force_x, force_y = force_x + push[0], force_y + push[1]
            torque += arm[0] * push[1] - arm[1] * push[0]
    eta, eta_rate = state[:count], state[count : 2 * count]
    bent = (
        -link.damping * eta_rate - link.frequency**2 * eta - load * link.displacement[-1]
        - fence.acceleration * link.participation
    )  # fmt: skip
    moved = force_x / impact.mass, force_y / impact.mass, torque / impact.moment_of_inertia
    return np.concatenate([eta_rate, bent, parcel[3:], moved, [normal]])


def strike(impact, front, offset, times, rtol=1e-8):
    """The parcel rides in as a whole sort begins, at phi = 0, and the tip strikes it: `Struck` at
    the `times` [s].

    Raises `RuntimeError` where a corner comes to the fence, or the tip from one side to another.
    """
    count = impact.link.frequency.size
    begin = np.zeros(2 * count + 7)
    begin[2 * count : 2 * count + 4] = (
        front - impact.size[0] / 2 + impact.center[0], offset + impact.size[1] / 2
        + impact.center[1], 0.0, impact.belt_speed,
    )  # fmt: skip

    def depths(time, state):
        fence = Fence(impact, time, state)
        tip = np.array([fence.node_x[-1], fence.node_y[-1]])
        return clipped(polygon(impact, state[2 * count :]), tip)[0]

    def enters(time, state):
        return float(np.min(depths(time, state)))

    enters.terminal, enters.direction = True, 1
    settings = dict(method="LSODA", rtol=rtol, atol=rtol * 1e-3, dense_output=True)
    free = solve_ivp(
        lambda t, y: derivative(impact, t, y, None), (0.0, times[-1]), begin, events=enters,
        max_step=5e-3, **settings,
    )  # fmt: skip
    if free.status != 1:
        raise RuntimeError("the tip does not come into the parcel")
    touch = float(free.t[-1])
    side = int(np.argmin(depths(touch, free.y[:, -1])))
    met = solve_ivp(
        lambda t, y: derivative(impact, t, y, side), (touch, times[-1]), free.y[:, -1],
        max_step=1e-3, **settings,
    )  # fmt: skip
    assert met.success
    states = np.stack([(free if t < touch else met).sol(t) for t in times])

    def force_at(time):
        state = met.sol(time)
        fence = Fence(impact, time, state)
        return poked(impact, fence, state[2 * count : 2 * count + 6], side).force

    force = np.array([0.0 if t < touch else force_at(t) for t in times])
    for time, state in zip(times, states, strict=True):
        behind = depths(time, state)
        if behind[side] > 0 and np.argmin(behind) != side:
            raise RuntimeError("the tip is nearer to another side than to the one it entered")
        fence = Fence(impact, time, state)
        for x, y in polygon(impact, state[2 * count :]):
            if x < fence.node_x[-1] and y < np.interp(x, fence.node_x, fence.node_y):
                raise RuntimeError("a corner comes to the fence")
    after = times[times > touch]
    peak = refined_maximum(force_at, after, force[times > touch])[1]
    return Struck(times, states[:, 2 * count : 2 * count + 6], force, peak, touch, side)
