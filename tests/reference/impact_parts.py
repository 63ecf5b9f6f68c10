"""Parameters of the independent oblique impact, its laws of contact and friction, its results."""

from dataclasses import dataclass
from functools import cached_property
from math import asinh, cos, exp, hypot, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from .beam import clamped_modes

GRAVITY = 9.81


@dataclass(frozen=True)
class Impact:
    """One oblique impact: fence, drive, parcel, contact, friction and numerical choices.

    l_s, l_p: rigid and flexible link [m]. width, thickness: z and h1 [m]. E [Pa]. rho [kg/m^3].
    zeta: damping ratio of mode 1 [-]. belt_speed: v [m/s]. top_speed: largest drive speed
    [rad/s]. cycle_time: t_c [s]. mass: m_p [kg]. stiffness: k_p [N/m^4]. damping: b_p
    [N s kg^-0.4 m^-3]. size: (A, B) [m]. center: (x_p, y_p), centre of gravity from the
    geometric centre [m]. mu_belt, mu_fence: (kinetic, static) friction coefficients [-].
    distance: arc coordinate R of the first contact [m]. drive_angle: drive angle then [rad].
    corner: 1 to 4. inertia: I_p about the centre of gravity [kg m^2], by default
    m_p (A^2 + B^2)/12. epsilon: smoothing speed of the friction [m/s]. stribeck: w_s, decay speed
    from static to kinetic [m/s]. elements: number of finite elements. horizon: time computed
    after the first contact [s]. modes: modes kept (default all 2 `elements`).
    load: how N is shared between the nodes beside U, "linear" (2.8) or "cubic" (work-consistent).
    geometry: "chord" (2.14)-(2.17), or "small", U = sigma t_alpha + w(sigma) n_alpha.
    rest: ordinates (d_2, d_3) [m] of the Bézier line of the flexible link at rest, control points
    (0, 0), (l_p/3, 0), (2 l_p/3, d_2), (l_p, d_3).
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
    rest: tuple = (0.0, 0.0)

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
        """Time from the start of the swing to the first contact [s]."""
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

    time: after the first contact [s]. force: N [N]. gap: D [m], nan past the tip. tip: u of the
    tip relative to the rigid swing [m]. arc: sigma [m]. parcel: x, y [m], phi [rad] and their
    rates, shape (n, 6). belt: F1x, F1y [N], T [N m] on the parcel, shape (n, 3).
    peak_force [N] and peak_time [s] after touch. tip_deflection: largest |tip| [m].
    impulse: integral of N over the horizon [N s]. duration: from the first contact to the first
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
