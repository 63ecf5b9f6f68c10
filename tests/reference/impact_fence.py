"""The fence of the independent oblique impact, and where the parcel touches it."""

from math import comb, cos, sin

import numpy as np

from .beam import hermite
from .impact_parts import (
    Contact,
    contact_force,
)


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
        if any(impact.rest):
            share = np.linspace(0.0, 1.0, impact.elements + 1)
            ordinates = np.array([0.0, 0.0, *impact.rest])
            self.bend = self.bend + _bernstein(3, share) @ ordinates
            slope = slope + _bernstein(2, share) @ np.diff(ordinates) * 3 / impact.l_p
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


def _bernstein(degree, share):
    """Bernstein polynomials at `share`, (len(share), degree + 1)."""
    k = np.arange(degree + 1)
    choose = np.array([comb(degree, i) for i in k])
    return choose * share[:, None] ** k * (1 - share[:, None]) ** (degree - k)


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
