"""The oblique impact of a parcel's corner on the swinging fence, in NumPy and SciPy.

All modes of the clamped finite-element link, the chord-angle geometry of the fence, a rigid
parcel in Cartesian coordinates and an adaptive implicit integrator. Equation numbers are those
of T. Piatkowski, J. Theor. Appl. Mech. 48(1), 87-109, 2010. SI units throughout.

State vector: modal displacements eta, modal velocities, x, y, phi, their rates, impulse of N.
Time zero is the first touch.
"""

from dataclasses import dataclass
from functools import cached_property
from math import asinh, atan2, cos, exp, hypot, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

from .beam import clamped_modes, hermite

GRAVITY = 9.81


@dataclass(frozen=True)
class Impact:
    """One oblique impact: fence, drive, parcel, contact, friction and numerical choices.

    l_s, l_p: rigid and flexible link [m]. width, thickness: z and h1 [m]. E [Pa]. rho [kg/m^3].
    zeta: damping ratio of mode 1 [-]. belt_speed: v [m/s]. top_speed: largest drive speed
    [rad/s]. cycle_time: t_c [s]. mass: m_p [kg]. stiffness: k_p [N/m^4]. damping: b_p
    [N s kg^-0.4 m^-3]. size: (A, B) [m]. center: (x_p, y_p), centre of gravity from the
    geometric centre [m]. mu_belt, mu_fence: (kinetic, static) friction coefficients [-].
    distance: arc coordinate R of the first touch [m]. drive_angle: drive angle then [rad].
    corner: 1 to 4. inertia: I_p about the centre of gravity [kg m^2], by default
    m_p (A^2 + B^2)/12. epsilon: smoothing speed of the friction [m/s]. stribeck: w_s, decay speed
    from static to kinetic [m/s]. elements: number of finite elements. horizon: time computed
    after the first touch [s]. modes: modes kept (default all 2 `elements`).
    load: how N is shared between the nodes beside U, "linear" (2.8) or "cubic" (work-consistent).
    geometry: "chord" (2.14)-(2.17), or "small", U = sigma t_alpha + w(sigma) n_alpha.
    """

    l_s: float = 0.45
    l_p: float = 0.75
    width: float = 0.132
    thickness: float = 0.045
    E: float = 3.0e9
    rho: float = 1130.0
    zeta: float = 0.05
    belt_speed: float = 2.0
    top_speed: float = 1.53
    cycle_time: float = 1.36
    mass: float = 15.0
    stiffness: float = 1.72e9
    damping: float = 3.3e5
    size: tuple = (0.4, 0.3)
    center: tuple = (0.0, 0.0)
    mu_belt: tuple = (0.65, 0.85)
    mu_fence: tuple = (0.35, 0.5)
    distance: float = 1.0
    drive_angle: float = 0.30
    corner: int = 1
    inertia: float | None = None
    epsilon: float = 1e-3
    stribeck: float = 5e-3
    elements: int = 20
    horizon: float = 0.2
    modes: int | None = None
    load: str = "linear"
    geometry: str = "chord"

    @cached_property
    def link(self):
        """Clamped-root modes of the flexible link."""
        return clamped_modes(
            self.l_s,
            self.l_p,
            self.width,
            self.thickness,
            self.E,
            self.rho,
            self.zeta,
            self.elements,
            self.modes,
        )

    @cached_property
    def moment_of_inertia(self):
        """I_p about the centre of gravity [kg m^2]."""
        if self.inertia is not None:
            return self.inertia
        return self.mass * (self.size[0] ** 2 + self.size[1] ** 2) / 12

    @cached_property
    def arm(self):
        """Corner seen from the centre of gravity in the parcel's frame [m]."""
        side_x = 1 if self.corner in (1, 4) else -1
        side_y = 1 if self.corner in (3, 4) else -1
        return (
            side_x * self.size[0] / 2 - self.center[0],
            side_y * self.size[1] / 2 - self.center[1],
        )

    @cached_property
    def mean_distance(self):
        """c: mean distance of the rectangle's points from the centre of gravity [m]."""
        half_x, half_y = self.size[0] / 2, self.size[1] / 2
        x_p, y_p = self.center
        total = sum(
            corner_moment(half_x + sx * x_p, half_y + sy * y_p) for sx in (-1, 1) for sy in (-1, 1)
        )
        return total / (self.size[0] * self.size[1])

    @cached_property
    def top_angle(self):
        """alpha_max = top_speed t_c/pi [rad]."""
        return self.top_speed * self.cycle_time / pi

    @cached_property
    def touch_time(self):
        """Time from the start of the swing to the first touch [s]."""
        return self.cycle_time / (2 * pi) * np.arccos(1 - 2 * self.drive_angle / self.top_angle)

    def drive(self, time):
        """Drive angle, speed and acceleration [rad, rad/s, rad/s^2] at `time` after touch [s].

        alpha = alpha_max (1 - cos(2 pi t/t_c))/2, t from the start of the swing.
        """
        rate = 2 * pi / self.cycle_time
        half = self.top_angle / 2
        phase = rate * (time + self.touch_time)
        cosine = cos(phase)
        return half * (1 - cosine), half * rate * sin(phase), half * rate**2 * cosine

    @property
    def approach_speed(self):
        """Normal approach speed of the undeformed fence, v sin(alpha) + R alpha' [m/s]."""
        angle, speed, _ = self.drive(0.0)
        return self.belt_speed * sin(angle) + self.distance * speed


class Contact(NamedTuple):
    """Everything about the contact at one instant.

    force: N [N]. gap: penetration D [m]. gap_rate: D' [m/s]. sliding: w [m/s].
    arc: sigma [m], distance along the fence of the foot U. slope: q5 at U [rad].
    fence_load: modal load per unit N [kg^-1/2], shape (modes,). point: (x_U, y_U) [m].
    element: index of U's element, -1 on the rigid link. local: d, position in it [m].
    """

    force: float
    gap: float
    gap_rate: float
    sliding: float
    arc: float
    slope: float
    fence_load: np.ndarray
    point: tuple
    element: int
    local: float


class Solution(NamedTuple):
    """Histories on a uniform grid and refined scalars of one impact.

    time: after the first touch [s]. force: N [N]. gap: D [m], nan past the tip. tip: u of the
    tip relative to the rigid swing [m]. arc: sigma [m]. parcel: x, y [m], phi [rad] and their
    rates, shape (n, 6). belt: F1x, F1y [N], T [N m] on the parcel, shape (n, 3).
    peak_force [N] and peak_time [s] after touch. tip_deflection: largest |tip| [m].
    impulse: integral of N over the horizon [N s]. duration: from the first touch to the first
    return of N to zero [s], nan if that is beyond the horizon. off_tip: whether the corner ran
    past the tip while behind the fence's line; the histories end there.
    stiff_force: N_stiff at the undeformed approach speed v sin(alpha) + R alpha' [N].
    evaluations: calls of the right-hand side.
    """

    time: np.ndarray
    force: np.ndarray
    gap: np.ndarray
    tip: np.ndarray
    arc: np.ndarray
    parcel: np.ndarray
    belt: np.ndarray
    peak_force: float
    peak_time: float
    tip_deflection: float
    impulse: float
    duration: float
    off_tip: bool
    stiff_force: float
    evaluations: int


def corner_moment(a, b):
    """Integral of the distance from a corner over a rectangle a x b [m^3].

    a b sqrt(a^2 + b^2)/3 + (a^3 asinh(b/a) + b^3 asinh(a/b))/6, odd in a and in b, so that four
    signed rectangles also serve a centre of gravity outside the parcel.
    """
    if a == 0 or b == 0:
        return 0.0
    return a * b * hypot(a, b) / 3 + (a**3 * asinh(b / abs(a)) + b**3 * asinh(a / abs(b))) / 6


def contact_force(impact, gap, gap_rate):
    """N = max(0, b_p m_p^0.4 D' D^2 + k_p D^4) for D > 0, else 0 [N] (2.2)."""
    if gap <= 0:
        return 0.0
    viscous = impact.damping * impact.mass**0.4 * gap_rate * gap**2
    return max(0.0, viscous + impact.stiffness * gap**4)


def smoothed_friction(mu, speed, impact):
    """Smoothed mu(w) w/sqrt(w^2 + eps^2) over w [s/m]: friction per unit force and speed.

    mu(w) = mu_k + (mu_s - mu_k) exp(-(w/w_s)^2), mu = (mu_k, mu_s), speed = w >= 0 [m/s].
    """
    blend = mu[0] + (mu[1] - mu[0]) * exp(-((speed / impact.stribeck) ** 2))
    return blend / sqrt(speed**2 + impact.epsilon**2)


def belt_friction(impact, rates):
    """Belt friction on the parcel, (F_x, F_y, T) [N, N, N m] (2.19), (2.20).

    F = F_max u/sqrt(V^2 + eps^2), T = -F_max c^2 phi'/sqrt(V^2 + eps^2), u = (v, 0) - (x', y'),
    V^2 = |u|^2 + c^2 phi'^2, F_max = mu(V) m_p g. rates: x', y' [m/s], phi' [rad/s].
    """
    slip_x, slip_y, spin = impact.belt_speed - rates[0], -rates[1], rates[2]
    c = impact.mean_distance
    speed = sqrt(slip_x**2 + slip_y**2 + (c * spin) ** 2)
    gain = impact.mass * GRAVITY * smoothed_friction(impact.mu_belt, speed, impact)
    return gain * slip_x, gain * slip_y, -gain * c**2 * spin


class Fence:
    """Position and velocity of the fence at one instant, from its modes.

    q3, q5: node displacement [m] and slope [rad] (2.1), and rates; node_x, node_y: nodes [m].
    """

    def __init__(self, impact, time, state):
        self.impact = impact
        link = impact.link
        count = link.frequency.size
        self.angle, self.speed, self.acceleration = impact.drive(time)
        eta = state[: 2 * count].reshape(2, count).T
        size = impact.l_p / impact.elements
        self.element_length = size
        reach = impact.l_s + size * np.arange(impact.elements + 1)
        self.bend, self.bend_rate = (link.displacement @ eta).T
        slope, slope_rate = (link.slope @ eta).T
        self.q5 = slope + self.angle
        self.q5_rate = slope_rate + self.speed
        self.q3 = self.bend + reach * self.angle
        self.q3_rate = self.bend_rate + reach * self.speed
        if impact.geometry == "chord":
            chord = np.diff(self.q3) / size
            chord_rate = np.diff(self.q3_rate) / size
            self.chord_cos, self.chord_sin = np.cos(chord), np.sin(chord)
            self.node_x = self._along(impact.l_s * cos(self.angle), size * self.chord_cos)
            self.node_y = self._along(impact.l_s * sin(self.angle), size * self.chord_sin)
            self.turning = size * chord_rate
        else:
            tangent = cos(self.angle), sin(self.angle)
            self.node_x = reach * tangent[0] - self.bend * tangent[1]
            self.node_y = reach * tangent[1] + self.bend * tangent[0]

    @staticmethod
    def _along(start, steps):
        path = np.empty(steps.size + 1)
        path[0] = start
        np.cumsum(steps, out=path[1:])
        path[1:] += start
        return path

    def cubic(self, displacement, slope, element):
        """Coefficients a0..a3 of the element's cubic in d (2.17)."""
        size = self.element_length
        first, last = displacement[element], displacement[element + 1]
        first_slope, last_slope = slope[element], slope[element + 1]
        rise = (last - first) / size
        return (
            float(first),
            float(first_slope),
            float((3 * rise - 2 * first_slope - last_slope) / size),
            float((first_slope + last_slope - 2 * rise) / size**2),
        )

    def locate(self, corner):
        """Foot U of the perpendicular from `corner` [m]: (element, d), see `Contact`.

        (C - U) . t = 0 with t = (cos q5, sin q5). Element -1 is the rigid link, d then counts
        from the hinge; element `elements` means past the tip.
        """
        ahead = (corner[0] - self.node_x) * np.cos(self.q5)
        ahead += (corner[1] - self.node_y) * np.sin(self.q5)
        element = int(np.count_nonzero(ahead > 0)) - 1
        if element < 0:
            return -1, self.impact.l_s + float(ahead[0])
        if element == self.impact.elements:
            return element, 0.0
        low, high = 0.0, self.element_length
        start = float(ahead[element])
        local = high * start / (start - float(ahead[element + 1]))
        for _ in range(30):
            (x, y), slope, rates = self.point(element, local)
            tangent = cos(slope), sin(slope)
            gap_x, gap_y = corner[0] - x, corner[1] - y
            residual = gap_x * tangent[0] + gap_y * tangent[1]
            along = rates[0] * tangent[0] + rates[1] * tangent[1]
            derivative = rates[2] * (gap_y * tangent[0] - gap_x * tangent[1]) - along
            low, high = (local, high) if residual > 0 else (low, local)
            step = -residual / derivative
            local += step
            if not low <= local <= high:
                local = 0.5 * (low + high)
            elif abs(step) < 1e-14:
                break
        return element, local

    def point(self, element, local):
        """U at d in an element: ((x, y) [m], q5 [rad], (dx/dd, dy/dd [-], dq5/dd [rad/m]))."""
        if self.impact.geometry == "chord":
            a0, a1, a2, a3 = self.cubic(self.q3, self.q5, element)
            slope = a1 + local * (2 * a2 + 3 * a3 * local)
            chord = a1 + local * (a2 + a3 * local)  # (q3(d) - q3(i))/d, (2.16)
            turn = local * (a2 + 2 * a3 * local)  # d times its derivative
            cosine, sine = cos(chord), sin(chord)
            position = (
                float(self.node_x[element]) + local * cosine,
                float(self.node_y[element]) + local * sine,
            )
            rates = (cosine - sine * turn, sine + cosine * turn, 2 * a2 + 6 * a3 * local)
            return position, slope, rates
        a0, a1, a2, a3 = self.cubic(self.bend, self.q5 - self.angle, element)
        slope = a1 + local * (2 * a2 + 3 * a3 * local)
        bend = a0 + local * (a1 + local * (a2 + local * a3))
        arc = self.impact.l_s + element * self.element_length + local
        cosine, sine = cos(self.angle), sin(self.angle)
        position = (arc * cosine - bend * sine, arc * sine + bend * cosine)
        rates = (cosine - sine * slope, sine + cosine * slope, 2 * a2 + 6 * a3 * local)
        return position, self.angle + slope, rates

    def velocity(self, element, local):
        """Velocity of the material point at d in an element [m/s], (2.14) at constant sigma."""
        if self.impact.geometry == "chord":
            _, a1, a2, a3 = self.cubic(self.q3, self.q5, element)
            _, r1, r2, r3 = self.cubic(self.q3_rate, self.q5_rate, element)
            chord = a1 + local * (a2 + a3 * local)
            turning = local * (r1 + local * (r2 + r3 * local))
            swing = self.impact.l_s * self.speed
            below = slice(element)
            velocity_x = -swing * sin(self.angle) - turning * sin(chord)
            velocity_y = swing * cos(self.angle) + turning * cos(chord)
            velocity_x -= float(self.chord_sin[below] @ self.turning[below])
            velocity_y += float(self.chord_cos[below] @ self.turning[below])
            return velocity_x, velocity_y
        b0, b1, b2, b3 = self.cubic(self.bend, self.q5 - self.angle, element)
        r0, r1, r2, r3 = self.cubic(self.bend_rate, self.q5_rate - self.speed, element)
        bend = b0 + local * (b1 + local * (b2 + local * b3))
        bend_rate = r0 + local * (r1 + local * (r2 + local * r3))
        arc = self.impact.l_s + element * self.element_length + local
        across = arc * self.speed + bend_rate
        back = -bend * self.speed
        cosine, sine = cos(self.angle), sin(self.angle)
        return back * cosine - across * sine, back * sine + across * cosine


def turned_arm(impact, phi):
    """Corner seen from the centre of gravity, in the fixed frame [m]."""
    arm_x, arm_y = impact.arm
    return arm_x * cos(phi) - arm_y * sin(phi), arm_x * sin(phi) + arm_y * cos(phi)


def contact(impact, fence, parcel):
    """The contact between the corner and the fence, a `Contact`.

    D = -(C - U) . n (2.13), D' = -(v_C - v_U) . n (2.18), w = (v_C - v_U) . t. No force past
    the tip or behind the hinge. parcel: x, y, phi and their rates.
    """
    x, y, phi, x_rate, y_rate, phi_rate = parcel
    arm_x, arm_y = turned_arm(impact, phi)
    corner = (x + arm_x, y + arm_y)
    corner_rate = (x_rate - arm_y * phi_rate, y_rate + arm_x * phi_rate)
    element, local = fence.locate(corner)
    link = impact.link
    unloaded = np.zeros(link.frequency.size)
    if element == impact.elements or (element < 0 and local < 0):
        arc = impact.l_s + impact.l_p if element > 0 else 0.0
        nan = float("nan")
        return Contact(0.0, nan, nan, nan, arc, nan, unloaded, (nan, nan), element, local)
    if element < 0:
        slope, arc = fence.angle, local
        point = (local * cos(slope), local * sin(slope))
        point_rate = (-fence.speed * point[1], fence.speed * point[0])
        load = unloaded
    else:
        point, slope, _ = fence.point(element, local)
        point_rate = fence.velocity(element, local)
        arc = impact.l_s + element * fence.element_length + local
        load = fence_load(impact, element, local)
    cosine, sine = cos(slope), sin(slope)
    away_x, away_y = corner[0] - point[0], corner[1] - point[1]
    relative_x, relative_y = corner_rate[0] - point_rate[0], corner_rate[1] - point_rate[1]
    gap = away_x * sine - away_y * cosine
    gap_rate = relative_x * sine - relative_y * cosine
    sliding = relative_x * cosine + relative_y * sine
    force = contact_force(impact, gap, gap_rate)
    return Contact(force, gap, gap_rate, sliding, arc, slope, load, point, element, local)


def tip_clearance(impact, fence, place):
    """How far the corner is ahead of the tip along t, and behind it along n [m, m]."""
    arm_x, arm_y = turned_arm(impact, place[2])
    ahead_x = place[0] + arm_x - fence.node_x[-1]
    ahead_y = place[1] + arm_y - fence.node_y[-1]
    cosine, sine = cos(fence.q5[-1]), sin(fence.q5[-1])
    return ahead_x * cosine + ahead_y * sine, ahead_x * sine - ahead_y * cosine


def fence_load(impact, element, local):
    """Modal load per unit transverse force at d: (1 - d/l, d/l) on the two nodes (2.8)."""
    link = impact.link
    size = impact.l_p / impact.elements
    if impact.load == "linear":
        share = local / size
        return (1 - share) * link.displacement[element] + share * link.displacement[element + 1]
    return shape(impact, element, local)


def shape(impact, element, local):
    """Modal displacement at d in an element, by its cubic [kg^-1/2], shape (modes,)."""
    link = impact.link
    values, _ = hermite(local, impact.l_p / impact.elements)
    return (
        values[0] * link.displacement[element]
        + values[1] * link.slope[element]
        + values[2] * link.displacement[element + 1]
        + values[3] * link.slope[element + 1]
    )


def initial_state(impact):
    """State at the first touch.

    The modes answer eta'' + c eta' + omega^2 eta = -p alpha'' from rest, in closed form
    (p = V^T M Phi, alpha'' = Re[A exp(i W t)]); the parcel rides with the belt, its corner on
    the fence at `distance` and its centre of gravity on the fence's normal there.
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
    modal = np.concatenate([eta, eta_rate])
    fence = Fence(impact, 0.0, modal)
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
    return np.concatenate([modal, [x, y, phi, impact.belt_speed, 0.0, 0.0, 0.0]])


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
    belt_x, belt_y, belt_torque = belt_friction(impact, rates)
    force_x, force_y, torque = belt_x, belt_y, belt_torque
    if touch.force > 0:
        drag = touch.force * touch.sliding
        drag *= smoothed_friction(impact.mu_fence, abs(touch.sliding), impact)
        cosine, sine = cos(touch.slope), sin(touch.slope)
        corner_x = -touch.force * sine - drag * cosine
        corner_y = touch.force * cosine - drag * sine
        arm_x, arm_y = turned_arm(impact, parcel[2])
        force_x += corner_x
        force_y += corner_y
        torque += arm_x * corner_y - arm_y * corner_x
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


def solve(impact, rtol=1e-8, atol=None, method="LSODA", samples=401):
    """Integrate one impact over its horizon: a `Solution`.

    rtol: relative tolerance. atol: absolute tolerance on every state, default rtol/1000.
    method: a stiff method of scipy.integrate.solve_ivp. samples: points of the uniform grid of
    histories; peaks are refined on the integrator's dense output between them.
    """
    count = impact.link.frequency.size

    def past_tip(time, state):
        ahead, gap = tip_clearance(impact, Fence(impact, time, state), state[2 * count :])
        return ahead if gap > 0 else -1.0

    past_tip.terminal = True
    result = solve_ivp(
        lambda time, state: derivative(impact, time, state),
        (0.0, impact.horizon),
        initial_state(impact),
        method=method,
        rtol=rtol,
        atol=rtol * 1e-3 if atol is None else atol,
        jac=lambda time, state: jacobian(impact, time, state),
        events=past_tip,
        dense_output=True,
    )
    if not result.success:
        raise RuntimeError(result.message)
    off_tip = result.status == 1

    def contact_at(time):
        state = result.sol(time)
        return contact(impact, Fence(impact, time, state), state[2 * count : 2 * count + 6])

    def tip_at(time):
        return float(impact.link.displacement[-1] @ result.sol(time)[:count])

    time = np.linspace(0.0, result.t[-1], samples)
    states = result.sol(time)
    touches = [contact_at(instant) for instant in time]
    force = np.array([touch.force for touch in touches])
    tip = impact.link.displacement[-1] @ states[:count]
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
        duration=float("nan") if off_tip else release(contact_at, impact, time, force),
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
