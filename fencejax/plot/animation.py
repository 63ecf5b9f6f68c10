"""Animation of a scene: fence, parcel and forces, with the force over time below."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .. import _check
from ..fidelity import Fidelity
from ..results import Result
from ..scenes import Scene
from . import scene_drawing as picture, style
from .fence_shape import Outline, outline
from .time_series import force as draw_force, single_history
from .whole_file import whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MARGIN = 0.06


class Film:
    """An animation of a scene; made by `animate`.

    **Fields:**

    - `times`: of the frames [s].
    - `frames_per_second`: of the playback.
    - `axes`: the picture's; `axes.figure` has one frame at a time.

    A notebook shows it with buttons to play and to step.

    >>> scene = fj.scenes.oblique_impact()
    >>> film = fj.plot.animate(scene, fj.simulate(scene), frames=3)
    >>> film.times
    array([0.   , 0.125, 0.25 ])
    """

    def __init__(
        self,
        scene: Scene,
        result: Result,
        shape: Outline,
        arrows: picture.Arrows,
        frames_per_second: int,
        signal: bool,
    ):
        self.times, self.frames_per_second = shape.time, frames_per_second
        self._shape, self._arrows = shape, arrows
        figure = style.figure(5.0 if signal else 3.7)
        self._cursor = None
        if signal:
            self.axes, below = figure.subplots(2, 1, height_ratios=(3, 1))
            draw_force(result, axes=below)
            span = 1e3 * self.times[[0, -1]]
            below.set_xlim(*(span if span[1] > span[0] else span + (-1, 1)))
            (self._cursor,) = below.plot([], [], "o", color=style.RED, markersize=5)
        else:
            self.axes = figure.subplots()
        self._draw_first(scene)

    def _draw_first(self, scene: Scene) -> None:
        shape, axes = self._shape, self.axes
        picture.draw_ground(scene, axes)
        (self._body,) = axes.fill(*shape.parcel[0], facecolor=picture.PARCEL, alpha=0.2, zorder=2)
        (self._walls,) = axes.plot(
            *shape.parcel[0], color=picture.PARCEL, linewidth=1.4, zorder=3
        )
        (self._path,) = axes.plot(
            [], [], color=picture.PARCEL, linewidth=0.8, linestyle="--", zorder=2
        )
        self._band = self._line = None
        if shape.fence is not None:
            (self._band,) = axes.fill(
                *picture.band(shape, 0), facecolor=picture.FENCE, alpha=0.3, zorder=3
            )
            (self._line,) = axes.plot(
                *shape.fence[0], color=picture.FENCE, linewidth=1.8, zorder=4
            )
        self._joint = picture.draw_joint(scene, shape, 0, axes)
        self._quivers = picture.draw_arrows(shape, 0, self._arrows, axes)
        picture.explain_arrows(self._quivers, self._arrows, axes)
        span = self.times[-1] - self.times[0]
        slower = len(self.times) / self.frames_per_second / span if span > 0 else 1.0
        self._speed = "" if abs(slower - 1) < 0.05 else f",  shown {slower:.2g} times slower"
        if slower < 0.95:
            self._speed = f",  shown {1 / slower:.2g} times faster"
        self._title = axes.set_title("", loc="left", fontsize="small")
        self._fix_limits()
        self.show(0)

    def _fix_limits(self) -> None:
        """Set limits of the axes that contain every frame."""
        parts = [self._shape.parcel]
        if self._shape.fence is not None and self._shape.back is not None:
            parts += [self._shape.fence, self._shape.back]
        x = np.concatenate([part[:, 0].ravel() for part in parts])
        y = np.concatenate([part[:, 1].ravel() for part in parts])
        self.axes.set_xlim(min(x.min(), 0.0) - _MARGIN, max(x.max(), 0.0) + _MARGIN)
        self.axes.set_ylim(min(y.min(), 0.0) - _MARGIN, y.max() + _MARGIN)

    def show(self, frame: int) -> "Axes":
        """Draw one frame, 0 ... F - 1, on the axes.

        Raises `ValueError` where there is no such frame.
        """
        if not 0 <= frame < len(self.times):
            raise ValueError(
                f"Argument `frame` must be from 0 to {len(self.times) - 1} [1], but is {frame}."
            )
        shape = self._shape
        self._body.set_xy(shape.parcel[frame].T)
        self._walls.set_data(*shape.parcel[frame])
        self._path.set_data(*shape.center[: frame + 1].T)
        if self._band is not None and self._line is not None and shape.fence is not None:
            self._band.set_xy(picture.band(shape, frame).T)
            self._line.set_data(*shape.fence[frame])
            if self._joint is not None:
                self._joint.set_data(*shape.fence[frame][:, 1:2])
        for name, quiver in self._quivers.items():
            x, y, force_x, force_y = (part[frame] for part in shape.forces[name])
            quiver.set_offsets(np.stack([x, y], 1))
            quiver.set_UVC(self._arrows.scale * force_x, self._arrows.scale * force_y)
        now = 1e3 * self.times[frame]
        if self._cursor is not None:
            self._cursor.set_data([now], [shape.fence_force[frame]])
        self._title.set_text(f"{now:.1f} ms{self._speed}")
        return self.axes

    def _write(self, writer, path: Path, dpi: float) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        figure = self.axes.get_figure(root=True)
        assert figure is not None
        FigureCanvasAgg(figure).draw()
        # The layout is computed once, as it takes longer than drawing a frame.
        figure.set_layout_engine("none")
        with writer.saving(figure, str(path), dpi):
            for frame in range(len(self.times)):
                self.show(frame)
                writer.grab_frame()

    def save(self, path: str | Path, *, dpi: float = 80) -> Path:
        """Write a GIF that repeats, or a page (HTML) with buttons to play and to step.

        Raises `ValueError` where the name ends with neither .gif nor .html.
        """
        from matplotlib.animation import PillowWriter

        path = Path(path)
        _check.number("dpi", dpi, above=0)
        if path.suffix == ".gif":
            with whole(path) as part:
                self._write(PillowWriter(fps=self.frames_per_second), part, dpi)
        elif path.suffix == ".html":
            text = self.html(dpi=dpi)
            with whole(path) as part:
                part.write_text(text, encoding="utf-8")
        else:
            raise ValueError(
                f"Argument `path` must end with .gif or .html, but is {str(path)!r}."
            )
        return path

    def html(self, *, dpi: float = 80) -> str:
        """The page that `save` writes, with all frames in it: matplotlib's JavaScript player."""
        from matplotlib.animation import HTMLWriter

        _check.number("dpi", dpi, above=0)
        writer = HTMLWriter(
            fps=self.frames_per_second, embed_frames=True, default_mode="loop"
        )
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "film.html"
            self._write(writer, path, dpi)
            return path.read_text(encoding="utf-8")

    def _repr_html_(self) -> str:
        return self.html()


def animate(
    scene: Scene,
    result: Result,
    *,
    start: float | None = None,
    stop: float | None = None,
    frames: int = 60,
    frames_per_second: int = 20,
    forces: Sequence[str] = ("fence", "border", "surfaces"),
    force_scale: float | None = None,
    signal: bool = True,
    fidelity: Fidelity | None = None,
) -> Film:
    """Animate a scene: fence, parcel and the forces on it.

    The frames are equally spaced in time, whatever the spacing of the samples.

    **Arguments:**

    - `scene`, `result`: the simulated scene, and its result with the history.
    - `start`, `stop` [s]: by default those of the history.
    - `frames`, `frames_per_second` [1/s]: at least 1; together they determine the slow motion.
    - `forces`, `force_scale` [m/N]: as in `fencejax.plot.draw_scene`.
    - `signal`: draw the fence's force over time below, with a moving mark.
    - `fidelity`: the one that the result was computed with, if its elements are not 20.

    Write it with `film.save("sort.gif")` or `film.save("sort.html")`, or see one frame with
    `film.show(0)`.

    Raises `TypeError` and `ValueError` as `fencejax.plot.draw_scene` does, and `ValueError` where
    `stop` is before `start` or a number is out of range.

    >>> scene = fj.scenes.oblique_impact()
    >>> film = fj.plot.animate(scene, fj.simulate(scene), frames=2)
    >>> str(film.save("impact.gif"))
    'impact.gif'
    """
    _check.count("frames", frames, least=1)
    _check.count("frames_per_second", frames_per_second, least=1)
    clock = np.asarray(single_history(result).time, dtype=float)
    clock = clock[np.isfinite(clock)]
    start = float(clock[0]) if start is None else _check.number("start", start, unit="s")
    stop = float(clock[-1]) if stop is None else _check.number("stop", stop, unit="s")
    if stop < start:
        raise ValueError(
            f"Argument `stop` must be at least `start` = {start:g} [s], but is {stop:g}."
        )
    arrows = picture.chosen_arrows(result, forces, force_scale)
    shape = outline(scene, result, np.linspace(start, stop, frames), fidelity=fidelity)
    return Film(scene, result, shape, arrows, frames_per_second, signal)
