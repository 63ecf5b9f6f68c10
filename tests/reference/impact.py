"""The oblique impact of a parcel's corner on the swinging fence, in NumPy and SciPy.

All modes of the clamped finite-element link, the chord-angle geometry of the fence, a rigid
parcel in Cartesian coordinates and an adaptive implicit integrator. Equation numbers are those
of T. Piatkowski, J. Theor. Appl. Mech. 48(1), 87-109, 2010. SI units throughout.

State vector: modal displacements eta, modal velocities, x, y, phi, their rates, impulse of N.
Time zero is the first contact.
"""

from math import atan2, cos, exp, hypot, pi, sin, sqrt

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

from .impact_fence import (
    Fence as Fence,
    contact as contact,
    fence_load as fence_load,
    shape as shape,
    tip_clearance as tip_clearance,
    turned_arm as turned_arm,
)
from .impact_parts import (
    GRAVITY as GRAVITY,
    Contact as Contact,
    Impact as Impact,
    Solution as Solution,
    belt_friction as belt_friction,
    contact_force as contact_force,
    corner_moment as corner_moment,
    smoothed_friction as smoothed_friction,
)


def initial_state(impact):
    """State at the first contact: the fence has swung from rest, and the parcel rides with the
    belt, its corner on the fence at `distance` and its centre of gravity on the fence's normal
    there.
    """
    modal = swung(impact)
    return np.concatenate([modal, touching(impact, Fence(impact, 0.0, modal)), [0.0]])


def swung(impact):
    """Modal displacements and velocities at the first contact.

    The modes answer eta'' + c eta' + omega^2 eta = -p alpha'' from rest, in closed form
    (p = V^T M Phi, alpha'' = Re[A exp(i W t)]).
    """
    link = impact.link
    rate = 2 * pi / impact.cycle_time
    time = impact.touch_time
    amplitude = -link.participation * impact.top_angle / 2 * rate**2
    damping, frequency = link.damping.astype(complex), link.frequency
    fast = -0.5 * (damping + np.sqrt(damping**2 - 4 * frequency**2))
    slow = frequency**2 / fast
    response = amplitude / (frequency**2 - rate**2 + 1j * rate * damping)
    forced = np.exp(1j * rate * time)
    weight_slow = (fast - 1j * rate) / (fast - slow) * np.exp(slow * time)
    weight_fast = (1j * rate - slow) / (fast - slow) * np.exp(fast * time)
    # slow and fast are a conjugate pair or both real, so exp(-i W t) gives the conjugate answer
    # and the real part is the answer to cos(W t).
    eta = (response * (forced - weight_slow - weight_fast)).real
    eta_rate = (response * (1j * rate * forced - slow * weight_slow - fast * weight_fast)).real
    return np.concatenate([eta, eta_rate])


def touching(impact, fence):
    """x, y, phi of the parcel at the first contact, and their rates."""
    if impact.distance <= impact.l_s:
        slope = fence.angle
        point = (impact.distance * cos(slope), impact.distance * sin(slope))
    else:
        along = impact.distance - impact.l_s
        element = min(int(along / fence.element_length), impact.elements - 1)
        point, slope, _ = fence.point(element, along - element * fence.element_length)
    arm = hypot(*impact.arm)
    phi = atan2(-cos(slope), sin(slope)) - atan2(impact.arm[1], impact.arm[0])
    x, y = point[0] - arm * sin(slope), point[1] + arm * cos(slope)
    return np.array([x, y, phi, impact.belt_speed, 0.0, 0.0])


def on_parcel(impact, touch, parcel):
    """Force (x, y) and torque on the parcel: of the belt, and of the fence N n - mu N sgn(w) t."""
    force_x, force_y, torque = belt_friction(impact, parcel[3:])
    if touch.force > 0:
        drag = touch.force * touch.sliding
        drag *= smoothed_friction(impact.mu_fence, abs(touch.sliding), impact)
        cosine, sine = cos(touch.slope), sin(touch.slope)
        corner_x = -touch.force * sine - drag * cosine
        corner_y = touch.force * cosine - drag * sine
        arm_x, arm_y = turned_arm(impact, parcel[2])
        force_x, force_y = force_x + corner_x, force_y + corner_y
        torque += arm_x * corner_y - arm_y * corner_x
    return force_x, force_y, torque


def derivative(impact, time, state):
    """Time derivative of the state: the modal beam (2.1) and Newton-Euler for the parcel.

    eta'' = -c eta' - omega^2 eta - b N - p alpha''; at the corner N n - mu N sgn(w) t.
    """
    link = impact.link
    count = link.frequency.size
    fence = Fence(impact, time, state)
    parcel = state[2 * count : 2 * count + 6].tolist()
    touch = contact(impact, fence, parcel)
    rates = parcel[3:]
    force_x, force_y, torque = on_parcel(impact, touch, parcel)
    out = np.empty_like(state)
    eta, eta_rate = state[:count], state[count : 2 * count]
    out[:count] = eta_rate
    out[count : 2 * count] = (
        -link.damping * eta_rate
        - link.frequency**2 * eta
        - touch.force * touch.fence_load
        - fence.acceleration * link.participation
    )
    out[2 * count : 2 * count + 3] = rates
    out[2 * count + 3 :] = (
        force_x / impact.mass,
        force_y / impact.mass,
        torque / impact.moment_of_inertia,
        touch.force,
    )
    return out


def jacobian(impact, time, state):
    """Jacobian of `derivative` for the integrator's Newton iterations.

    It leaves out what is small and not stiff: the turning of t and n, the travel of U along the
    fence, and the change of the parcel's arm. That changes the convergence of the iterations
    and not what they converge to.
    """
    link = impact.link
    count = link.frequency.size
    place = 2 * count
    out = np.zeros((state.size, state.size))
    modes = np.arange(count)
    out[modes, count + modes] = 1.0
    out[count + modes, modes] = -(link.frequency**2)
    out[count + modes, count + modes] = -link.damping
    out[place : place + 3, place + 3 : place + 6] = np.eye(3)

    parcel = state[place : place + 6].tolist()
    c = impact.mean_distance
    scale = np.array([1.0, 1.0, c])
    slip = np.array([impact.belt_speed - parcel[3], -parcel[4], -c * parcel[5]])
    gain, gain_slope = friction_gain(impact.mu_belt, float(np.sqrt(slip @ slip)), impact)
    tangent = gain * np.eye(3) + gain_slope * np.outer(slip, slip)
    inertia = np.array([impact.mass, impact.mass, impact.moment_of_inertia])
    belt = -impact.mass * GRAVITY * scale[:, None] * tangent * scale / inertia[:, None]
    out[place + 3 : place + 6, place + 3 : place + 6] = belt

    fence = Fence(impact, time, state)
    touch = contact(impact, fence, parcel)
    if not touch.force > 0:
        return out
    arm_x, arm_y = turned_arm(impact, parcel[2])
    cosine, sine = cos(touch.slope), sin(touch.slope)
    normal_row = -np.array([-sine, cosine, arm_x * cosine + arm_y * sine])
    tangent_row = np.array([cosine, sine, arm_x * sine - arm_y * cosine])
    gap_of_modes, slide_of_modes = np.zeros((2, count))
    if touch.element >= 0:
        gap_of_modes = shape(impact, touch.element, touch.local)
        if impact.geometry == "chord":
            below = slice(touch.element)
            turn_cos = sine * fence.chord_cos[below] - cosine * fence.chord_sin[below]
            steps = np.diff(link.displacement[: touch.element + 1], axis=0)
            slide_of_modes = -turn_cos @ steps
    power = impact.damping * impact.mass**0.4
    force_of_rate = power * touch.gap**2
    force_of_gap = 2 * power * touch.gap_rate * touch.gap + 4 * impact.stiffness * touch.gap**3
    by_gap, by_rate, by_slide = np.zeros((3, state.size))
    by_gap[:count] = gap_of_modes
    by_gap[place : place + 3] = normal_row
    by_rate[count:place] = gap_of_modes
    by_rate[place + 3 : place + 6] = normal_row
    by_slide[count:place] = slide_of_modes
    by_slide[place + 3 : place + 6] = tangent_row
    force_row = force_of_gap * by_gap + force_of_rate * by_rate
    gain, gain_slope = friction_gain(impact.mu_fence, abs(touch.sliding), impact)
    drag_row = gain * touch.sliding * force_row
    drag_row += touch.force * (gain + gain_slope * touch.sliding**2) * by_slide
    out[count:place] -= np.outer(touch.fence_load, force_row)
    out[place + 3 : place + 6] -= np.outer(normal_row / inertia, force_row)
    out[place + 3 : place + 6] -= np.outer(tangent_row / inertia, drag_row)
    out[-1] = force_row
    return out


def friction_gain(mu, speed, impact):
    """`smoothed_friction` and its derivative in w divided by w [s/m, s^3/m^3]."""
    smooth = speed**2 + impact.epsilon**2
    extra = (mu[1] - mu[0]) * exp(-((speed / impact.stribeck) ** 2))
    gain = (mu[0] + extra) / sqrt(smooth)
    return gain, -gain / smooth - 2 * extra / (impact.stribeck**2 * sqrt(smooth))


def solve(impact, rtol=1e-8, atol=None, method="LSODA", samples=401, more=None):
    """Integrate one impact over its horizon: a `Solution`.

    rtol: relative tolerance. atol: absolute tolerance on every state, default rtol/1000.
    method: a stiff method of scipy.integrate.solve_ivp. samples: points of the uniform grid of
    histories; peaks are refined on the integrator's dense output between them. more: loads that the
    model leaves out, with a `derivative` and a `contact` of their own (see `second_order`).
    """
    count = impact.link.frequency.size
    rates, touch_of, slopes = derivative, contact, jacobian
    if more is not None:
        rates, touch_of, slopes = more.derivative, more.contact, None

    def past_tip(time, state):
        ahead, gap = tip_clearance(impact, Fence(impact, time, state), state[2 * count :])
        return ahead if gap > 0 else -1.0

    past_tip.terminal = True
    result = solve_ivp(
        lambda time, state: rates(impact, time, state),
        (0.0, impact.horizon),
        initial_state(impact) if more is None else more.begin(impact),
        method=method,
        rtol=rtol,
        atol=rtol * 1e-3 if atol is None else atol,
        jac=None if slopes is None else lambda time, state: slopes(impact, time, state),
        events=past_tip,
        dense_output=True,
    )
    if not result.success:
        raise RuntimeError(result.message)
    off_tip = result.status == 1

    def contact_at(time):
        state = result.sol(time)
        if more is not None:
            return touch_of(impact, time, state)
        return contact(impact, Fence(impact, time, state), state[2 * count : 2 * count + 6])

    def tip_of(state):
        # The link beyond the corner goes along with its shear there.
        tip = impact.link.displacement[-1] @ state[:count]
        return tip if more is None else tip - state[-2]

    def tip_at(time):
        return float(tip_of(result.sol(time)))

    time = np.linspace(0.0, result.t[-1], samples)
    states = result.sol(time)
    touches = [contact_at(instant) for instant in time]
    force = np.array([touch.force for touch in touches])
    tip = tip_of(states)
    parcel = states[2 * count : 2 * count + 6].T
    peak_time, peak_force = refined_maximum(lambda t: contact_at(t).force, time, force)
    _, tip_deflection = refined_maximum(lambda t: abs(tip_at(t)), time, np.abs(tip))
    return Solution(
        time=time,
        force=force,
        gap=np.array([touch.gap for touch in touches]),
        tip=tip,
        arc=np.array([touch.arc for touch in touches]),
        parcel=parcel,
        belt=np.array([belt_friction(impact, rates) for rates in parcel[:, 3:].tolist()]),
        peak_force=peak_force,
        peak_time=peak_time,
        tip_deflection=tip_deflection,
        impulse=float(states[-1, -1]),
        duration=float("nan") if off_tip or more else release(contact_at, impact, time, force),
        off_tip=off_tip,
        stiff_force=rigid_wall(
            impact.approach_speed, impact.mass, impact.stiffness, impact.damping
        )[0],
        evaluations=result.nfev,
    )


def refined_maximum(function, time, values):
    """Maximum of a smooth function near the largest of its samples: (time, value)."""
    top = int(np.argmax(values))
    low, high = time[max(top - 1, 0)], time[min(top + 1, time.size - 1)]
    found = minimize_scalar(
        lambda t: -function(t), bounds=(low, high), method="bounded", options={"xatol": 1e-10}
    )
    return float(found.x), float(-found.fun)


def release(contact_at, impact, time, force):
    """Time at which N first returns to zero [s], from b_p m_p^0.4 D' + k_p D^2 = 0."""
    idle = np.flatnonzero((force[1:] == 0) & (force[:-1] > 0))
    if idle.size == 0:
        return float("nan")

    def signed(instant):
        touch = contact_at(instant)
        viscous = impact.damping * impact.mass**0.4 * touch.gap_rate
        return viscous + impact.stiffness * touch.gap * abs(touch.gap)

    return float(brentq(signed, time[idle[0]], time[idle[0] + 1], xtol=1e-12))


def rigid_wall(speed, mass=15.0, stiffness=1.72e9, damping=3.3e5, rtol=1e-12):
    """Impact on an undeformable wall of infinite mass, m D'' = -N(D, D').

    speed: normal approach speed [m/s]. mass [kg], stiffness and damping as in `Impact`.
    Returns (peak force [N], restitution [-], time of peak [s]).
    """
    wall = Impact(mass=mass, stiffness=stiffness, damping=damping)
    viscous = damping * mass**0.4

    def rate(_, state):
        return [state[1], -contact_force(wall, *state) / mass]

    def leaving(_, state):
        return viscous * state[1] + stiffness * state[0] * abs(state[0])

    leaving.terminal, leaving.direction = True, -1
    depth = (2.5 * mass * speed**2 / stiffness) ** 0.2  # of the undamped wall
    found = solve_ivp(
        rate,
        (0.0, 20 * depth / speed),
        [0.0, speed],
        "DOP853",
        rtol=rtol,
        atol=1e-14,
        events=leaving,
        dense_output=True,
    )
    time = np.linspace(0.0, found.t[-1], 400)
    force = np.array([contact_force(wall, *found.sol(instant)) for instant in time])
    peak_time, peak = refined_maximum(
        lambda t: contact_force(wall, *found.sol(t)), time, force
    )
    return peak, float(-found.y[1, -1] / speed), peak_time
