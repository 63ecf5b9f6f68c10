"""The outline of a fence for cutting it: lines and arcs, in NumPy. Nothing is drawn here."""

from typing import NamedTuple

import numpy as np

from ..parts import AbstractTaper, Fence, RestShape

TOLERANCE = 1e-5
"""Largest distance [m] of an arc from the profile that it approximates: 0.01 mm, finer than the
tolerance of milled plates."""
# A narrower interval of the square root of the distance to the tip is a step of the profile.
_NARROWEST = 1e-9
_ARCS = 4
_PER_ARC = 16
_NO_LINK = 1e-8
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


class FenceOutline(NamedTuple):
    """A closed outline, seen from above: x along the fence from the hinge, y = 0 on the face that
    meets the parcels, y = -h behind it.

    **Fields:**

    - `x`, `y` [m]: the vertices, (n,), counterclockwise; the first is on the face, at the hinge.
    - `bulge` [1]: of the side from a vertex to the next, tan(theta / 4) of the arc's angle theta,
      as in a DXF polyline; 0: a line; above 0: bulging outwards.
    - `joint` [m]: x where the rigid link ends.

    >>> outline = fj.plot.fence_outline(fj.Fence())
    >>> len(outline.x), outline.joint
    (19, 0.45)
    """

    x: np.ndarray
    y: np.ndarray
    bulge: np.ndarray
    joint: float

    @property
    def area(self) -> float:
        """The enclosed area [m^2]: times width and density the mass of the fence."""
        x, y = np.append(self.x, self.x[0]), np.append(self.y, self.y[0])
        polygon = 0.5 * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])
        chord = np.hypot(np.diff(x), np.diff(y))
        angle = 4 * np.arctan(self.bulge)
        return float(polygon + np.sum(_segment(angle) * chord**2))

    def points(self, per_arc: int = 8) -> tuple[np.ndarray, np.ndarray]:
        """(x, y) [m] of a closed line along it, with `per_arc` pieces an arc."""
        x, y = [], []
        for k, bulge in enumerate(self.bulge):
            start = np.array([self.x[k], self.y[k]])
            end = np.array([self.x[(k + 1) % self.x.size], self.y[(k + 1) % self.x.size]])
            along, out = end - start, np.array([end[1] - start[1], start[0] - end[0]])
            angle = 4 * np.arctan(bulge)
            turn = np.linspace(-0.5, 0.5, per_arc + 1)[:-1] * angle
            if abs(angle) < 1e-9:
                shares, rise = np.zeros(1), np.zeros(1)
            else:
                shares = 0.5 + 0.5 * np.sin(turn) / np.sin(angle / 2)
                rise = 0.5 * (np.cos(turn) - np.cos(angle / 2)) / np.sin(angle / 2)
            x.append(start[0] + shares * along[0] + rise * out[0])
            y.append(start[1] + shares * along[1] + rise * out[1])
        x, y = np.concatenate(x), np.concatenate(y)
        return np.append(x, x[0]), np.append(y, y[0])


def fence_outline(fence: Fence) -> FenceOutline:
    """The outline of a fence: the rigid link as thick as the flexible one's root, then
    h(x) = h_1 g(x / l_p).

    The profile is approximated by arcs within `TOLERANCE`. Their ends lie on the profile, and each
    encloses with its chord the same area as the profile does, so that the outline's area is the
    integral of the thickness. A step of the profile is a line across. A fence curved at rest has
    short lines within the same tolerance; its thickness is normal to the face, so that its area
    differs from the straight one's by the share of half the thickness over the curve's radius.

    >>> outline = fj.plot.fence_outline(fj.Fence(taper=fj.Uniform()))
    >>> float(outline.y.min())
    -0.045
    """
    rigid, flexible = float(fence.rigid_length), float(fence.flexible_length)
    thick = float(fence.thickness)
    # An optimiser may leave a tiny rigid link at its bound of 0.
    rigid = rigid if rigid > _NO_LINK * flexible else 0.0
    ends = np.linspace(1.0, 0.0, _ARCS + 1)
    roots, bulges = [], []
    # From the root on; intervals without a fitting arc are halved.
    open_ones = list(zip(ends[:-1], ends[1:], strict=True))[::-1]
    while open_ones:
        first, last = open_ones.pop()
        found = _arc(fence.taper, first, last, flexible, thick)
        if found is None:
            middle = 0.5 * (first + last)
            open_ones += [(middle, last), (first, middle)]
        else:
            roots.append(first)
            bulges.append(found)
    roots = np.array([*roots, 0.0])
    x, y = _profile(fence.taper, roots, flexible, thick)
    x, y, bulge = rigid + x, -y, np.array([*bulges, 0.0])
    # The thickness of the rigid link is h_1, independent of the profile's first value.
    behind = [(0, 0), (0, -thick), (rigid, -thick)] if rigid > 0 else [(0, 0)]
    x = np.concatenate([[place for place, _ in behind], x, x[-1:]])
    y = np.concatenate([[place for _, place in behind], y, [0]])
    bulge = np.concatenate([np.zeros(len(behind)), bulge, [0]])
    kept = ~_needless(x, y, bulge)
    straight = FenceOutline(x[kept], y[kept], bulge[kept], rigid)
    if fence.rest_shape is None:
        return straight
    return _curved(straight, fence.rest_shape, flexible)


def _curved(straight: FenceOutline, shape: RestShape, length: float) -> FenceOutline:
    """A straight fence's outline on the face's line of its rest shape."""
    tip, middle = float(shape.tip), float(shape.middle)
    # A piece of the length p is p^2 |w_0''| / 8 from its chord, and w_0'' is linear.
    bend = 6 * max(abs(middle), abs(tip - 2 * middle)) / length**2
    pieces = 1 + int(np.sqrt(bend * length**2 / (8 * TOLERANCE)))
    around_x, around_y = straight.points(_PER_ARC)
    x, y = [], []
    for first in range(around_x.size - 1):
        ends = around_x[first : first + 2], around_y[first : first + 2]
        count = 1 + int(pieces * abs(ends[0][1] - ends[0][0]) / length)
        share = np.arange(count) / count
        x.append(ends[0][0] + share * (ends[0][1] - ends[0][0]))
        y.append(ends[1][0] + share * (ends[1][1] - ends[1][0]))
    x, y = np.concatenate(x), np.concatenate(y)
    line = shape.at(np.maximum(x - straight.joint, 0.0) / length, length)
    rise, angle, short, lower = (np.asarray(part, dtype=float) for part in line)
    x, y = x - short - y * np.sin(angle), rise - lower + y * np.cos(angle)
    bulge = np.zeros(x.size)
    kept = ~_needless(x, y, bulge)
    return FenceOutline(x[kept], y[kept], bulge[kept], straight.joint)


def _needless(x: np.ndarray, y: np.ndarray, bulge: np.ndarray) -> np.ndarray:
    """Which vertices equal the next one, or lie within a straight line."""
    found = np.zeros(x.size, dtype=bool)
    for k in range(x.size):
        before = next((i for i in range(k - 1, -1, -1) if not found[i]), x.size - 1)
        after = (k + 1) % x.size
        ahead = np.array([x[after] - x[k], y[after] - y[k]])
        behind = np.array([x[k] - x[before], y[k] - y[before]])
        cross = abs(ahead[0] * behind[1] - ahead[1] * behind[0])
        straight = bulge[k] == 0 and bulge[before] == 0
        same = np.all(ahead == 0) and bulge[k] == 0
        flat = cross <= 1e-12 * np.hypot(*ahead) * np.hypot(*behind) and ahead @ behind > 0
        found[k] = same or (straight and flat)
    return found


def _profile(taper: AbstractTaper, root: np.ndarray, length: float, thick: float):
    """x from the root and thickness [m] where the square root of 1 - x / l_p is `root`: in it the
    profiles of constant strength and others with a blunt tip are smooth."""
    tip_distance = root**2
    return length * (1 - tip_distance), thick * _relative(taper, 1 - tip_distance, tip_distance)


def _relative(taper: AbstractTaper, position, tip_distance) -> np.ndarray:
    return np.asarray(taper(position, tip_distance), dtype=float) + np.zeros_like(position)


def _arc(
    taper: AbstractTaper, first: float, last: float, length: float, thick: float
) -> float | None:
    """The bulge of the arc over a part of the profile; `None` where no arc is near enough."""
    half = 0.5 * (first - last)
    if 2 * half < _NARROWEST:
        return 0.0
    root = last + half * (1 + _NODES)
    x, y = _profile(taper, root, length, thick)
    (x0, x1), (y0, y1) = _profile(taper, np.array([first, last]), length, thick)
    area = float(np.sum(half * _WEIGHTS * y * 2 * root) * length - 0.5 * (y0 + y1) * (x1 - x0))
    chord = float(np.hypot(x1 - x0, y1 - y0))
    if abs(area) >= chord**2 * _segment(0.9 * np.pi):
        return None
    # Coordinates of the profile normal to the chord and along it.
    along = ((x1 - x0) * (x - x0) + (y1 - y0) * (y - y0)) / chord
    out = ((x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)) / chord
    angle = 0.0
    if abs(area) > 1e-12 * chord:
        from scipy.optimize import brentq

        angle = float(brentq(lambda a: _segment(a) - area / chord**2, -3.0, 3.0, xtol=1e-15))  # pyright: ignore
    if angle == 0.0:
        return 0.0 if np.max(np.abs(out)) <= TOLERANCE else None
    radius = 0.5 * chord / np.sin(0.5 * angle)
    depth = out + radius * np.cos(0.5 * angle)
    away = np.hypot(along - 0.5 * chord, depth) - abs(radius)
    return float(np.tan(0.25 * angle)) if np.max(np.abs(away)) <= TOLERANCE else None


def _segment(angle):
    """The area between an arc and its chord over the chord's square, (a - sin a) / (8 sin^2 a/2);
    near 0, where that cancels, a / 12 (1 + a^2 / 30)."""
    small = np.abs(angle) < 1e-3
    safe = np.where(small, 1.0, angle)
    closed = (safe - np.sin(safe)) / (8 * np.sin(0.5 * safe) ** 2)
    return np.where(small, angle / 12 * (1 + angle**2 / 30), closed)
