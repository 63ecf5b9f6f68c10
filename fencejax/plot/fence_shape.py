"""The geometry of a scene at given times: lines of fence and parcel, forces as vectors, in NumPy.
Nothing is drawn here."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np

from ..fidelity import Fidelity
from ..model import FlexibleLink, hermite, hermite_slope
from ..parts import SIDES, Fence, turned
from ..results import Result, Sample
from ..scenes import Scene
from .time_series import single_history

FORCES = (
    "fence", "fence_friction", "border", "border_friction", "surfaces", "surfaces_friction", "belt",
)  # fmt: skip
"""Forces on the parcel that can be shown: normal force and friction of fence, border and other
surfaces, and the belt's."""


class Vectors(NamedTuple):
    """Forces of one kind over F frames, at k points each: the points (`x`, `y`) [m] and the
    components (`force_x`, `force_y`) [N], in fixed axes; each of shape (F, k)."""

    x: np.ndarray
    y: np.ndarray
    force_x: np.ndarray
    force_y: np.ndarray


class Outline(NamedTuple):
    """A scene at F times [s].

    - `fence`: (x, y) of the fence's line, from the hinge over the joint to the tip, and `back`,
      those of the face behind it; (F, 2, p) [m]. `None` without a fence.
    - `parcel`: (x, y) of corners 1 2 3 4 1, (F, 2, 5) [m]; `center`: of C_s, (F, 2) [m].
    - `forces`: on the parcel, by the names of `FORCES`; only those that the scene has.
    - `fence_force`: normal force of the fence, all corners together, (F,) [N].
    """

    time: np.ndarray
    fence: np.ndarray | None
    back: np.ndarray | None
    parcel: np.ndarray
    center: np.ndarray
    forces: dict[str, Vectors]
    fence_force: np.ndarray


def outline(
    scene: Scene, result: Result, times: Any, *, fidelity: Fidelity | None = None
) -> Outline:
    """Fence, parcel and forces at `times` [s], by linear interpolation between the samples.

    The fence's line is bent by its modes and, as in the simulation, by the static deflection of the
    truncated modes under the contact: w(x) = sum phi_i eta_i - sum_j r_j G(x, sigma_j), about its
    curve at rest. Its length is constant: every element is a chord whose ends have the distance w
    from the rigid link's line.

    **Arguments:**

    - `times` [s]: one or several, within the history.
    - `fidelity`: the one that the result was computed with; by default one with the history's
      number of modes, on 20 elements.

    Raises `TypeError` where the scene is one of the normal direction alone, `ValueError` where
    the result has no history or that of a batch, where a time lies outside of it, and where the
    fidelity's modes are not the history's.

    >>> scene = fj.scenes.oblique_impact()
    >>> outline = fj.plot.outline(scene, fj.simulate(scene), times=[0.0, 0.05])
    >>> outline.parcel.shape
    (2, 2, 5)
    """
    if not isinstance(scene, Scene):
        raise TypeError(
            "Argument `scene` must be seen from above, but is a "
            f"{type(scene).__name__}, of the normal direction alone."
        )
    history = single_history(result)
    history = _interpolated(history, np.atleast_1d(np.asarray(times, dtype=float)))
    body = history.body
    parcel, arms = _parcel(scene, body)
    center = np.stack([body.x, body.y], 1)
    fence = back = None
    forces: dict[str, Vectors] = {}
    if scene.fence is not None:
        assert history.drive is not None
        bent = _Bent(scene.fence, history, fidelity)
        turn = np.asarray(history.drive.angle)
        if history.twist is not None:
            turn = turn + np.asarray(history.twist)
        fence, back = bent.lines(turn)
        if history.directions:
            forces |= _contacts("fence", history.fence, *_near_tip(scene, history, arms))
        elif history.fence:
            slopes = [bent.slope(np.asarray(c.place)) for c in history.fence]
            turned = turn[:, None] + np.stack(slopes, 1)
            points, normals = _at(arms, scene.fence_corners), (-np.sin(turned), np.cos(turned))
            forces |= _contacts("fence", history.fence, points, normals)
    if history.border:
        points = _at(arms, scene.border_corners)
        upright = np.zeros_like(points[0]), np.ones_like(points[1])
        forces |= _contacts("border", history.border, points, upright)
    if history.surfaces:
        forces |= _of_surfaces(scene, history, _at(arms, scene.surface_corners))
    if history.belt is not None:
        parts = (body.x, body.y, history.belt.x, history.belt.y)
        forces["belt"] = Vectors(*(np.asarray(part)[:, None] for part in parts))
    total = np.asarray(history.fence_force)
    return Outline(np.asarray(history.time), fence, back, parcel, center, forces, total)


def _interpolated(history: Sample, times: np.ndarray) -> Sample:
    """The history at other times."""
    clock = np.asarray(history.time, dtype=float)
    good = np.flatnonzero(np.isfinite(clock))
    # Of several samples at the same time the last one counts.
    good = good[np.append(np.diff(clock[good]) > 0, True)]
    clock = clock[good]
    outside = ~((times >= clock[0] - 1e-9) & (times <= clock[-1] + 1e-9))
    if np.any(outside):
        raise ValueError(
            f"Argument `times` must be within the history, {clock[0]:g} ... {clock[-1]:g} [s], but "
            f"holds {times[outside][0]:g}."
        )
    index = np.clip(np.searchsorted(clock, times, side="right") - 1, 0, len(clock) - 2)
    share = (times - clock[index]) / (clock[index + 1] - clock[index])
    first, second = good[index], good[index + 1]

    def between(leaf):
        leaf = np.asarray(leaf)
        part = share.reshape(share.shape + (1,) * (leaf.ndim - 1))
        return (1 - part) * leaf[first] + part * leaf[second]

    return jax.tree.map(between, history)


def _parcel(scene: Scene, body):
    """Corners 1 2 3 4 1 and the four corners' positions."""
    corners = np.array([[float(v) for v in scene.parcel.corner(k)] for k in (1, 2, 3, 4)])
    turn = np.cos(body.angle)[:, None], np.sin(body.angle)[:, None]
    x, y = turned(turn, corners[:, 0], corners[:, 1])
    x, y = body.x[:, None] + x, body.y[:, None] + y
    around = [0, 1, 2, 3, 0]
    return np.stack([x[:, around], y[:, around]], 1), (x, y)


def _at(arms, corners):
    """(x, y) of some corners, (F, k) each."""
    picks = [corner - 1 for corner in corners]
    return tuple(part[:, picks] for part in arms)


def _near_tip(scene: Scene, history: Sample, arms):
    """(x, y) of the points on the parcel's sides at which the fence presses, and the directions of
    its forces (x, y).

    The line of a force of direction n and moment m about C_s meets the side from a corner r along
    the unit vector d at r + a d, with a = (m - r x n) / (d x n).
    """
    x, y, moment = (np.stack(part, 1) for part in zip(*history.directions, strict=True))
    here = _at(arms, scene.fence_corners)
    there = _at(arms, [SIDES[corner] for corner in scene.fence_corners])
    length = np.hypot(there[0] - here[0], there[1] - here[1])
    side_x, side_y = (there[0] - here[0]) / length, (there[1] - here[1]) / length
    arm_x, arm_y = here[0] - history.body.x[:, None], here[1] - history.body.y[:, None]
    slope = side_x * y - side_y * x
    away = (moment - (arm_x * y - arm_y * x)) / np.where(slope == 0, 1.0, slope)
    along = np.where(slope == 0, 0.0, np.clip(away, 0.0, length))
    return (here[0] + along * side_x, here[1] + along * side_y), (x, y)


def _contacts(name, contacts, points, normals) -> dict[str, Vectors]:
    """Normal force and friction at points of the parcel; the tangent is to the right of the
    normal."""
    normal, friction = (
        np.stack([np.asarray(getattr(c, part)) for c in contacts], 1)
        for part in ("normal", "friction")
    )
    (at_x, at_y), (x, y) = points, normals
    return {
        name: Vectors(at_x, at_y, normal * x, normal * y),
        f"{name}_friction": Vectors(at_x, at_y, friction * y, -friction * x),
    }


def _of_surfaces(scene: Scene, history: Sample, points) -> dict[str, Vectors]:
    """The forces of all surfaces but the border, side by side."""
    found = []
    for surface, contacts in zip(scene.surfaces, history.surfaces, strict=True):
        normals = tuple(np.asarray(part) for part in surface.at(*points).normal)
        normals = tuple(np.broadcast_to(part, points[0].shape) for part in normals)
        found.append(_contacts("surfaces", contacts, points, normals))
    return {
        name: Vectors(*(np.concatenate(p, 1) for p in zip(*(f[name] for f in found), strict=True)))
        for name in found[0]
    }


def _columns(blocks, frames: int) -> np.ndarray:
    """Blocks of modes, over frames or nodes, as one table (frames, modes)."""
    parts = [np.asarray(block).reshape(frames, -1) for block in blocks]
    return np.concatenate([np.zeros((frames, 0)), *parts], axis=1)


class _Bent:
    """The bent fence over frames: deflections at the nodes and slopes."""

    def __init__(self, fence: Fence, history: Sample, fidelity: Fidelity | None):
        assert history.vibration is not None
        # The history's modes are those of the bending alone.
        fence = eqx.tree_at(lambda f: f.shaft, fence, None, is_leaf=lambda x: x is None)
        frames = len(history.time)
        amplitude = _columns(history.vibration.amplitude, frames)
        modes = amplitude.shape[1]
        if fidelity is None:
            fidelity = Fidelity(modes=modes)
        if fidelity.mode_count != modes:
            raise ValueError(
                f"Argument `fidelity` must be the one that the result was computed with, but has "
                f"{fidelity.mode_count} modes and the history {modes}."
            )
        link = FlexibleLink(fence, fidelity)
        self._elements = link.elements
        self._rigid_length, self._length = float(link.rigid_length), float(link.length)
        nodes = self._elements + 1
        self.deflection = amplitude @ _columns(link.deflection, nodes).T
        self._slope = amplitude @ _columns(link.slope, nodes).T
        if history.carried:
            deflection, slope = self._left_out(fence, fidelity, history)
            self.deflection, self._slope = self.deflection - deflection, self._slope - slope
        if link.rest_table is not None:
            self.deflection = self.deflection + np.asarray(link.rest_table.deflection)
            self._slope = self._slope + np.asarray(link.rest_table.slope)
        # Thickness at the hinge, the joint and the nodes, the tip included.
        stations = np.arange(nodes) / self._elements
        profile = np.asarray(fence.taper(stations, 1 - stations))
        self._thickness = float(fence.thickness) * np.concatenate([[1.0], profile])

    def _left_out(self, fence: Fence, fidelity: Fidelity, history: Sample):
        """The static deflection at the nodes by the modes that the history lacks:
        sum_j r_j sum_i phi_i(x) phi_i(sigma_j) / (m_0 w_i^2), and its slope in x / l_p."""
        whole = FlexibleLink(fence, fidelity.replace(modes=None))
        nodes = self._elements + 1
        tables = (_columns(part, nodes)[:, fidelity.mode_count :] for part in
                  (whole.deflection, whole.slope))  # fmt: skip
        deflection, slope = tables
        square = np.concatenate([np.ravel(part) for part in whole.frequency_squared])
        compliance = 1 / (float(whole.mass_scale) * square[fidelity.mode_count :])
        amplitude = np.zeros((len(history.time), len(compliance)))
        for contact, (_, load) in zip(history.fence, history.carried, strict=True):
            element, s = self._element(np.asarray(contact.place))
            a, b, c, d = (h[:, None] for h in hermite(s))
            first, second = deflection[element], deflection[element + 1]
            turn, turn_second = (slope[element + k] / self._elements for k in (0, 1))
            share = a * first + b * turn + c * second + d * turn_second
            amplitude = amplitude + load[:, None] * share * compliance
        return amplitude @ deflection.T, amplitude @ slope.T

    def _element(self, place: np.ndarray):
        """Element and local coordinate in [0, 1] of arc coordinates [m]."""
        at = np.clip((place - self._rigid_length) / self._length, 0.0, 1.0) * self._elements
        element = np.minimum(at.astype(int), self._elements - 1)
        return element, at - element

    def slope(self, place: np.ndarray) -> np.ndarray:
        """Slope [rad] at one arc coordinate [m] a frame, as in the contact."""
        element, s = self._element(place)
        frames = np.arange(len(place))
        ends = (self.deflection, self._slope / self._elements)
        a, c = (ends[0][frames, element + k] for k in (0, 1))
        b, d = (ends[1][frames, element + k] for k in (0, 1))
        rise = hermite_slope(s)
        rise = rise[0] * a + rise[1] * b + rise[2] * c + rise[3] * d
        return rise * self._elements / self._length

    def lines(self, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(x, y) of the fence's line and of its back, (F, 2, n + 2) each."""
        size = self._length / self._elements
        angles = np.arcsin(np.clip(np.diff(self.deflection, axis=1) / size, -1, 1))
        zero = np.zeros((len(turn), 1))
        steps = np.concatenate([zero, np.cumsum(size * np.cos(angles), axis=1)], axis=1)
        along = np.concatenate([zero, self._rigid_length + steps], axis=1)
        across = np.concatenate([zero, self.deflection], axis=1)
        # At every point the mean direction of the chords beside it.
        chords = np.concatenate([zero, angles, angles[:, -1:]], axis=1)
        middle = 0.5 * (chords[:, :-1] + chords[:, 1:])
        bend = np.concatenate([zero, middle], axis=1)
        behind = along + self._thickness * np.sin(bend)
        below = across - self._thickness * np.cos(bend)
        axes = np.cos(turn)[:, None], np.sin(turn)[:, None]
        return np.stack(turned(axes, along, across), 1), np.stack(turned(axes, behind, below), 1)
