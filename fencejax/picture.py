"""Pictures of a scene: the fence bent, the parcel, the belt and the border, seen from above."""

from typing import TYPE_CHECKING

import jax.numpy as jnp
import numpy as np

from .fidelity import Fidelity
from .link import FlexibleLink
from .result import Result
from .scenes import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FENCE, _PARCEL, _BELT = "#c8501e", "#0b5fa5", "#ece8df"


def fence_line(scene: Scene, result: Result, index: int, fidelity: Fidelity | None = None):
    """Points (x, y) [m] of the fence at sample `index`: the hinge and the nodes of the link.

    `fidelity` is the one that the result was computed with, by default `Fidelity.standard()`.
    """
    if scene.fence is None or result.history is None or result.history.vibration is None:
        raise ValueError(
            "Arguments `scene` and `result` must hold a fence and a history, but do not. Write "
            "simulate(scene, history=True) for a scene with a fence."
        )
    assert result.history.drive is not None
    link = FlexibleLink(scene.fence, Fidelity.standard() if fidelity is None else fidelity)
    amplitude = [np.asarray(block)[index] for block in result.history.vibration.amplitude]
    deflection = np.zeros(link.elements + 1)
    for table, value in zip(link.deflection, amplitude, strict=True):
        deflection = deflection + np.asarray(jnp.dot(table, value))
    size = float(link.length) / link.elements
    angles = np.arcsin(np.clip(np.diff(deflection) / size, -1, 1))
    along = float(link.rigid_length) + size * np.concatenate([[0.0], np.cumsum(np.cos(angles))])
    along, across = np.concatenate([[0.0], along]), np.concatenate([[0.0], deflection])
    turn = float(np.asarray(result.history.drive.angle)[index])
    cosine, sine = np.cos(turn), np.sin(turn)
    return cosine * along - sine * across, sine * along + cosine * across


def parcel_outline(scene: Scene, result: Result, index: int):
    """Corners (x, y) [m] of the parcel at sample `index`, closed."""
    assert result.history is not None
    body = [float(np.asarray(q)[index]) for q in result.history.body[:3]]
    corners = np.array([[float(v) for v in scene.parcel.corner(k)] for k in (1, 2, 3, 4, 1)])
    cosine, sine = np.cos(body[2]), np.sin(body[2])
    return (
        body[0] + cosine * corners[:, 0] - sine * corners[:, 1],
        body[1] + sine * corners[:, 0] + cosine * corners[:, 1],
    )


def draw_scene(
    scene: Scene,
    result: Result,
    times=(0.0,),
    *,
    axes: "Axes | None" = None,
    fidelity: Fidelity | None = None,
) -> "Axes":
    """Draw fence and parcel at `times` [s], later ones darker, with the normal force as an arrow.

    Returns the axes, in metres, seen from above with the belt running to the right.
    """
    if axes is None:
        from matplotlib.figure import Figure

        axes = Figure(figsize=(6.3, 3.6), layout="constrained").subplots()
    if result.history is None:
        raise ValueError("Argument `result` must hold a history. Write history=True.")
    clock = np.asarray(result.history.time)
    width = 0.7 if scene.belt is None else float(scene.belt.width)
    axes.axhspan(0.0, width, color=_BELT, zorder=0)
    axes.axhline(0.0, color="black", linewidth=1.5)
    axes.axhline(width, color="black", linewidth=0.8, linestyle=":")
    shades = np.linspace(0.25, 1.0, len(times)) if len(times) > 1 else [1.0]
    strongest = float(np.max(np.asarray(result.history.fence_force))) or 1.0
    for time, shade in zip(times, shades, strict=True):
        index = int(np.argmin(np.abs(clock - time)))
        x, y = parcel_outline(scene, result, index)
        axes.fill(x, y, facecolor=_PARCEL, alpha=0.15 * shade, zorder=1)
        axes.plot(x, y, color=_PARCEL, alpha=shade, linewidth=1.2)
        center = [float(np.asarray(q)[index]) for q in result.history.body[:2]]
        axes.plot(*center, "+", color=_PARCEL, alpha=shade, markersize=5)
        if scene.fence is None:
            continue
        line_x, line_y = fence_line(scene, result, index, fidelity)
        axes.plot(line_x, line_y, color=_FENCE, alpha=shade, linewidth=2.0)
        for corner, contact in zip(scene.fence_corners, result.history.fence, strict=True):
            force = float(np.asarray(contact.normal)[index])
            if force > 0.02 * strongest:
                foot = x[corner - 1], y[corner - 1]
                length = 0.25 * force / strongest
                angle = _normal_angle(line_x, line_y, float(np.asarray(contact.place)[index]))
                head = foot[0] + length * np.cos(angle), foot[1] + length * np.sin(angle)
                axes.annotate(
                    "",
                    head,
                    foot,
                    arrowprops={"arrowstyle": "-|>", "color": "black", "alpha": shade},
                )
    axes.plot(0.0, 0.0, "o", color=_FENCE, markersize=5)
    axes.set_aspect("equal")
    axes.set_xlabel("x along the belt [m]")
    axes.set_ylabel("y across the belt [m]")
    return axes


def _normal_angle(x, y, place):
    """Direction [rad] of the normal of the drawn line at the arc coordinate `place` [m]."""
    reached = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    piece = int(np.clip(np.searchsorted(reached, place) - 1, 0, len(x) - 2))
    return np.arctan2(y[piece + 1] - y[piece], x[piece + 1] - x[piece]) + np.pi / 2
