"""Pictures of a scene from above: the bent fence, the parcel, belt and border, and forces."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .. import _check
from ..fidelity import Fidelity
from ..results import Result
from ..scenes import Scene
from . import style
from .fence_shape import FORCES, Outline, outline
from .time_series import single_history

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.quiver import Quiver

FENCE, PARCEL = style.RED, style.BLUE
_FORCES = {
    # name: color, title
    "fence": ("black", "fence, normal"),
    "fence_friction": (style.PURPLE, "fence, friction"),
    "border": ("black", "border, normal"),
    "border_friction": (style.PURPLE, "border, friction"),
    "surfaces": ("black", "surface, normal"),
    "surfaces_friction": (style.PURPLE, "surface, friction"),
    "belt": (style.GREEN, "belt"),
}
_LONGEST = 0.3


class Arrows(NamedTuple):
    """The forces to draw: their names, and the arrows' scale [m/N]."""

    names: tuple[str, ...]
    scale: float


def chosen_arrows(
    result: Result, forces: Sequence[str], force_scale: float | None
) -> Arrows:
    """Check the names; without a scale the largest force of the result becomes 0.3 m long.

    Raises `ValueError` for an unknown name or a scale that is not above 0.
    """
    names = (forces,) if isinstance(forces, str) else tuple(forces)
    for name in names:
        _check.choice("forces", name, FORCES)
    if force_scale is not None:
        return Arrows(names, _check.number("force_scale", force_scale, above=0, unit="m/N"))
    history = single_history(result)
    surfaces = [contact for group in history.surfaces for contact in group]
    touching = (*history.fence, *history.border, *surfaces)
    found = [np.asarray(c.normal) for c in touching]
    if history.belt is not None and "belt" in names:
        found.append(np.hypot(np.asarray(history.belt.x), np.asarray(history.belt.y)))
    largest = max((float(np.nanmax(part)) for part in found), default=0.0)
    return Arrows(names, _LONGEST / largest if largest > 0 else 1.0)


def draw_ground(scene: Scene, axes: "Axes") -> None:
    """Draw belt, border, other surfaces and hinge, in metres, and label the axes."""
    if scene.belt is not None:
        width = float(scene.belt.width)
        axes.axhspan(0.0, width, color=style.PALE, linewidth=0, zorder=0)
        axes.axhline(width, color=style.GRAY, linewidth=0.8, linestyle=":", zorder=0)
    axes.axhline(0.0, color="black", linewidth=0.8 if scene.border is None else 2.0, zorder=1)
    for surface in scene.surfaces:
        line = surface.line()
        if line is not None:
            axes.plot(*np.asarray(line, dtype=float), color="black", linewidth=2.0, zorder=1)
    if scene.fence is not None:
        axes.plot(0.0, 0.0, "o", color=FENCE, markersize=5, zorder=5)
    axes.set_aspect("equal")
    runs = "" if scene.belt is None else f", {float(scene.belt.speed):g} m/s $\\rightarrow$"
    axes.set_xlabel(f"x along the belt{runs} [m]")
    axes.set_ylabel("y across the belt [m]")


def draw_arrows(shape: Outline, index: int, arrows: Arrows, axes: "Axes", alpha: float = 1.0):
    """Draw the forces of one frame as arrows; returns a quiver for each name that the scene has."""
    made: dict[str, Quiver] = {}
    for name in arrows.names:
        if name not in shape.forces:
            continue
        x, y, force_x, force_y = (part[index] for part in shape.forces[name])
        made[name] = axes.quiver(
            x, y, arrows.scale * force_x, arrows.scale * force_y, color=_FORCES[name][0],
            angles="xy", scale_units="xy", scale=1.0, units="inches", width=0.022,
            headwidth=5.0, headlength=6.0, headaxislength=5.5, minlength=0.1, alpha=alpha,
            zorder=6,
        )  # fmt: skip
    return made


def reference_force(scale: float) -> float:
    """A round force [N] whose arrow is between 0.08 m and 0.2 m long.

    >>> fj.plot.reference_force(1e-4)
    2000
    """
    most = 0.2 / scale
    power = 10 ** math.floor(math.log10(most))
    return max(step * power for step in (1, 2, 5) if step * power <= most * (1 + 1e-9))


def explain_arrows(made: "dict[str, Quiver]", arrows: Arrows, axes: "Axes") -> None:
    """Draw a key above the axes: the arrows' scale, and the colors where there are several."""
    if not made:
        return
    newton = reference_force(arrows.scale)
    # An empty title reserves the space above.
    axes.set_title(axes.get_title(loc="left") or " ", loc="left", fontsize="small")
    axes.quiverkey(
        next(iter(made.values())), 0.8, 1.04, arrows.scale * newton, f"{newton:g} N",
        labelpos="E", coordinates="axes", fontproperties={"size": "small"}, color="black",
    )  # fmt: skip
    colors = {_FORCES[name][0] for name in made}
    for color in sorted(colors) if len(colors) > 1 else ():
        titles = [_FORCES[name][1] for name in made if _FORCES[name][0] == color]
        axes.plot([], [], color=color, linewidth=1.4, label="\n".join(titles))


def draw_scene(
    scene: Scene,
    result: Result,
    times: Any = 0.0,
    *,
    forces: Sequence[str] = ("fence", "border", "surfaces"),
    force_scale: float | None = None,
    path: bool = False,
    axes: "Axes | None" = None,
    fidelity: Fidelity | None = None,
) -> "Axes":
    """A scene from above at one time or several [s], later ones darker.

    The fence's line is its face, which the corners touch; its thickness is drawn behind it. The
    arrows are the forces on the parcel, to scale.

    **Arguments:**

    - `scene`, `result`: the simulated scene, and its result with the history.
    - `forces`: names of `fencejax.plot.FORCES`; those that the scene lacks are left out.
    - `force_scale` [m/N]: of the arrows; by default that of the largest force is 0.3 m long.
    - `path`: draw the path of C_s up to the last of the times.
    - `axes`: where to draw, in metres; by default a figure of page width.
    - `fidelity`: the one that the result was computed with, if its elements are not 20.

    Raises `TypeError` and `ValueError` as `fencejax.plot.outline` does, and `ValueError` for an
    unknown force.

    >>> scene = fj.scenes.oblique_impact()
    >>> axes = fj.plot.draw_scene(scene, fj.simulate(scene), times=0.05, path=True)
    """
    arrows = chosen_arrows(result, forces, force_scale)
    shape = outline(scene, result, times, fidelity=fidelity)
    axes = style.figure(3.7).subplots() if axes is None else axes
    draw_ground(scene, axes)
    count = len(shape.time)
    order = np.argsort(np.argsort(shape.time, kind="stable"), kind="stable")
    shades = 0.3 + 0.7 * order / max(1, count - 1) if count > 1 else np.ones(1)
    made = {}
    for index, shade in enumerate(shades):
        shade = float(shade)
        name = f"{1e3 * shape.time[index]:.3g} ms" if 1 < count <= 8 else None
        axes.fill(*shape.parcel[index], facecolor=PARCEL, alpha=0.15 * shade, zorder=2)
        axes.plot(
            *shape.parcel[index], color=PARCEL, alpha=shade, linewidth=1.2, zorder=3, label=name
        )
        axes.plot(*shape.center[index], "+", color=PARCEL, alpha=shade, markersize=5, zorder=3)
        if shape.fence is not None and shape.back is not None:
            axes.fill(*band(shape, index), facecolor=FENCE, alpha=0.25 * shade, zorder=3)
            axes.plot(*shape.fence[index], color=FENCE, alpha=shade, linewidth=1.6, zorder=4)
            draw_joint(scene, shape, index, axes, shade)
        made = draw_arrows(shape, index, arrows, axes, shade) or made
    if path:
        clock = np.asarray(single_history(result).time, dtype=float)
        last = np.max(shape.time)
        body = single_history(result).body
        way = np.stack([np.asarray(body.x), np.asarray(body.y)])[:, clock < last]
        way = np.concatenate([way, shape.center[[int(np.argmax(shape.time))]].T], axis=1)
        axes.plot(
            *way, color=PARCEL, linewidth=0.8, linestyle="--", zorder=2, label="path of C$_s$"
        )
    explain_arrows(made, arrows, axes)
    if axes.get_legend_handles_labels()[0]:
        # Beside the picture, as it seldom fills the page.
        axes.legend(
            frameon=False, fontsize="small", loc="upper left", bbox_to_anchor=(1.01, 1.02),
            handlelength=1.2,
        )  # fmt: skip
    return axes


def draw_joint(scene: Scene, shape: Outline, index: int, axes: "Axes", alpha: float = 1.0):
    """Draw a mark at the joint of rigid and flexible link, unless that is at the hinge."""
    if scene.fence is None or shape.fence is None:
        return None
    if float(scene.fence.rigid_length) < 0.01 * float(scene.fence.reach):
        return None
    x, y = shape.fence[index][:, 1]
    (mark,) = axes.plot(
        [x], [y], "o", color=FENCE, markerfacecolor="white", markersize=4, alpha=alpha, zorder=5
    )
    return mark


def band(shape: Outline, index: int):
    """(x, y) of the fence's body at a frame: along its line and back behind it."""
    assert shape.fence is not None
    assert shape.back is not None
    return np.concatenate([shape.fence[index], shape.back[index][:, ::-1]], axis=1)
