"""The drawing sheet of a fence: views to scale with dimensions, the profile, a title block."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..parts import Fence
from . import style
from .fence_outline import fence_outline

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# A4 landscape with the frame of ISO 5457, and the scales of ISO 5455.
SHEET = (297.0, 210.0)
_LEFT, _RIGHT, _BOTTOM, _TOP = 20.0, 287.0, 10.0, 200.0
_SCALES = (1, 2, 5, 10, 20, 50, 100, 200)
_HINGE = 34.0
_LONGEST, _HIGHEST, _PROFILE = 240.0, 60.0, 20.0
_BLOCK = 38.0
_SMALL, _PLAIN, _LARGE = 6.2, 7.0, 10.0
_THIN, _THICK = 0.5, 1.2
_STATIONS = 9


def fence_drawing(
    fence: Fence,
    *,
    title: str = "Fence",
    material: str = "",
    notes: Sequence[str] = (),
    axes: "Axes | None" = None,
) -> "Axes":
    """A fence as a drawing sheet, A4 landscape.

    Two views to scale, of the face with the width and from above with the thickness h(x); below
    them the profile of the flexible link, its thickness enlarged, with numbers at equidistant
    stations; and a title block with material and mass. The sheet is to scale when saved at its own
    size (`axes.figure` is 297 mm by 210 mm).

    **Arguments:**

    - `title`: of the title block.
    - `material`: its name, printed with modulus and density.
    - `notes`: lines beside the title block.
    - `axes`: where to draw, in millimetres of the sheet; by default a figure of the sheet's size.

    >>> axes = fj.plot.fence_drawing(fj.Fence(), material="PA 6", notes=["deburr"])
    >>> axes.figure.savefig("fence.pdf")
    """
    if axes is None:
        figure = style.figure(SHEET[1] / 25.4, SHEET[0] / 25.4)
        figure.set_layout_engine("none")
        axes = figure.add_axes((0, 0, 1, 1))
    axes.set_xlim(0, SHEET[0])
    axes.set_ylim(0, SHEET[1])
    axes.set_aspect("equal")
    axes.axis("off")
    _Sheet(axes, fence).draw(title, material, notes)
    return axes


class _Sheet:
    """The views of one fence, in millimetres of the sheet."""

    def __init__(self, axes: "Axes", fence: Fence):
        straight = fence
        if fence.rest_shape is not None:
            straight = dataclasses.replace(fence, rest_shape=None)
        self.axes, self.fence, self.shape = axes, fence, fence_outline(straight)
        self.rigid, self.reach = 1e3 * self.shape.joint, 1e3 * float(fence.reach)
        self.width, self.thick = 1e3 * float(fence.width), 1e3 * float(fence.thickness)
        fits = (
            each for each in _SCALES
            if self.reach <= _LONGEST * each and self.width + self.thick <= _HIGHEST * each
        )  # fmt: skip
        self.scale = next(fits, int(np.ceil(self.reach / _LONGEST)))

    def draw(self, title: str, material: str, notes: Sequence[str]) -> None:
        self._line([_LEFT, _RIGHT, _RIGHT, _LEFT, _LEFT], [_BOTTOM, _BOTTOM, _TOP, _TOP, _BOTTOM])
        self._block(title, material, notes)
        below = self._face(_TOP - 4)
        below = self._from_above(below - 3)
        self._profile(below - 2)

    # ---- views

    def _face(self, top: float) -> float:
        """Draw the face, to scale; returns the height at which the next view can begin."""
        self._text(_LEFT + 3, top, f"face, 1:{self.scale}", va="top", weight="bold")
        height, long = self.width / self.scale, self.reach / self.scale
        high = top - 13
        low = high - height
        self._line([_HINGE, _HINGE, _HINGE + long, _HINGE + long, _HINGE],
                   [low, high, high, low, low], _THICK, fill=True)  # fmt: skip
        self._joint(low, high)
        self._line([_HINGE] * 2, [low - 3, high + 3], color=style.RED, dashes=(8, 2, 1.5, 2))
        for name, first, last in (
            ("rigid link", 0, self.rigid), ("flexible link", self.rigid, self.reach),
        ):  # fmt: skip
            if last - first > 25 * self.scale:
                middle = _HINGE + 0.5 * (first + last) / self.scale
                self._text(middle, 0.5 * (low + high), name, ha="center", va="center",
                           color=style.NOTE)  # fmt: skip
        self._text(_HINGE, low - 3.5, "axis of the hinge", va="top", size=5.2, color=style.RED)
        self._across("reach", 0, self.reach, high + 6, high)
        self._down("width", _HINGE + long, _HINGE + long + 6, low, high, self.width)
        return low - 5

    def _from_above(self, top: float) -> float:
        """Draw the view from above, to scale; returns as `_face`."""
        self._text(_LEFT + 3, top, f"from above, 1:{self.scale}", va="top", weight="bold")
        face = top - 13
        x, y = (1e3 * part / self.scale for part in self.shape.points())
        self._line(_HINGE + x, face + y, _THICK, fill=True)
        deep = self.thick / self.scale
        self._joint(face - deep, face)
        self._hinge(_HINGE, face)
        if self.rigid > 0:
            self._across("rigid_length", 0, self.rigid, face + 6, face)
        self._across("flexible_length", self.rigid, self.reach, face + 6, face)
        self._down("thickness", _HINGE, _HINGE - 6, face - deep, face, self.thick)
        tip = -1e3 * float(self.shape.y[self.shape.x == self.shape.x.max()].min())
        if tip > 0:
            end = _HINGE + self.reach / self.scale
            self._down("tip", end, end + 6, face - tip / self.scale, face, tip)
        if self.fence.edge_radius is not None:
            radius = _number(1e3 * float(self.fence.edge_radius), 2)
            end = _HINGE + self.reach / self.scale
            self._text(end + 1, face + 2, f"edge R{radius}", "edge", va="bottom")
        return face - deep - 8

    def _profile(self, top: float) -> None:
        """The flexible link's thickness, enlarged across, with numbers at stations."""
        enlarged = _PROFILE / (self.thick / self.scale)
        self._text(
            _LEFT + 3, top, "profile of the flexible link: thickness h [mm] at x [mm] from the "
            f"hinge (drawn {enlarged:.3g} times as thick as to scale)", va="top", weight="bold",
        )  # fmt: skip
        base = top - 11
        x, y = (1e3 * part / self.scale for part in self.shape.points())
        self._line(_HINGE + x, base + enlarged * y, _THICK, fill=True)
        shares = np.linspace(0, 1, _STATIONS)
        ratio = np.asarray(self.fence.taper(shares, 1 - shares)) + np.zeros(_STATIONS)
        flexible = self.reach - self.rigid
        for k, (share, part) in enumerate(zip(shares, ratio, strict=True)):
            at, deep = self.rigid + share * flexible, self.thick * float(part)
            place = _HINGE + at / self.scale
            end = base - enlarged * deep / self.scale
            self._line([place] * 2, [base + 1.5, end], 0.6 * _THIN)
            self._text(place, base + 2, _number(deep, 2), f"h[{k}]", ha="center", va="bottom")
            self._text(place, base - _PROFILE - 1.5, _number(at), f"x[{k}]", ha="center", va="top")
        if self.fence.rest_shape is not None:
            self._curve(base - _PROFILE - 6, shares)
        self._text(_HINGE - 8, base + 2, "h", ha="right", va="bottom", style="italic")
        self._text(_HINGE - 8, base - _PROFILE - 1.5, "x", ha="right", va="top", style="italic")

    def _curve(self, low: float, shares: np.ndarray) -> None:
        """Write the face's deviation from the straight line at rest, below the profile's
        stations."""
        assert self.fence.rest_shape is not None
        flexible = self.reach - self.rigid
        line = self.fence.rest_shape.at(shares, flexible / 1e3)
        for k, (share, rise) in enumerate(zip(shares, np.asarray(line.deflection), strict=True)):
            place = _HINGE + (self.rigid + share * flexible) / self.scale
            text = _number(1e3 * float(rise), 2)
            self._text(place, low, text, f"w[{k}]", ha="center", va="top")
        self._text(_HINGE - 8, low, "$w_0$", ha="right", va="top", style="italic")
        self._text(
            _HINGE, low - 4, "drawn straight; $w_0$ [mm]: how far the face of the curved link is "
            "ahead of the rigid link's line", va="top", size=5.2,
        )  # fmt: skip

    def _joint(self, low: float, high: float) -> None:
        if self.rigid > 0:
            place = _HINGE + self.rigid / self.scale
            self._line([place] * 2, [low, high], _THIN, dashes=(4, 1.5))

    def _hinge(self, x: float, y: float) -> None:
        """Draw the hinge, seen along its axis."""
        for dx, dy in ((3, 0), (0, 3)):
            self._line([x - dx, x + dx], [y - dy, y + dy], color=style.RED, dashes=(6, 1, 1, 1))
        self.axes.plot([x], [y], "o", color=style.RED, markersize=2.2, zorder=5)

    # ---- the title block

    def _block(self, title: str, material: str, notes: Sequence[str]) -> None:
        fence, top, left = self.fence, _BOTTOM + _BLOCK, _RIGHT - 170
        solid = fence.material
        section = float(fence.width) * float(solid.density)
        rigid = section * float(fence.thickness) * self.shape.joint
        whole = section * self.shape.area
        rows: list[Mapping[str, str]] = [
            {"title": title, "format": "A4", "scale": f"1:{self.scale}", "unit": "mm"},
            {"material": material or "not named",
             "E": f"{float(solid.youngs_modulus) / 1e9:.4g} GPa",
             "density": f"{float(solid.density):.5g} kg/m³"},
            {"mass": f"{whole:.4g} kg", "of it, rigid link": f"{rigid:.4g} kg",
             "flexible link": f"{whole - rigid:.4g} kg", "sheet": "1 / 1"},
        ]  # fmt: skip
        shares = [(0.55, 0.13, 0.16, 0.16), (0.55, 0.2, 0.25), (0.31, 0.24, 0.24, 0.21)]
        height = _BLOCK / len(rows)
        self._line([_LEFT, _RIGHT], [top, top])
        self._line([left, left], [_BOTTOM, top])
        for index, (row, parts) in enumerate(zip(rows, shares, strict=True)):
            high, place = top - index * height, left
            self._line([left, _RIGHT], [high, high])
            for (head, value), share in zip(row.items(), parts, strict=True):
                self._text(place + 1.5, high - 1.5, head, va="top", size=5.2, color=style.NOTE)
                first = head == "title"
                self._text(
                    place + 1.5, high - 10, _short(value, share, first), head, va="baseline",
                    size=_LARGE if first else _PLAIN, weight="bold" if first else "normal",
                )  # fmt: skip
                place += share * (_RIGHT - left)
                if place < _RIGHT - 1:
                    self._line([place] * 2, [high - height, high])
        for index, note in enumerate(notes[:7]):
            self._text(_LEFT + 3, top - 3 - 5 * index, note, va="top", size=_SMALL)

    # ---- strokes

    def _line(
        self, x, y, width: float = _THIN, *, fill=False, color=style.INK, dashes=None
    ) -> None:
        if fill:
            self.axes.fill(x, y, facecolor=style.PALE, linewidth=0)
        (line,) = self.axes.plot(x, y, color=color, linewidth=width, solid_joinstyle="miter")
        if dashes is not None:
            line.set_dashes(dashes)

    def _text(self, x, y, text, name=None, *, size=_SMALL, **settings) -> None:
        self.axes.text(x, y, text, fontsize=size, gid=name, **settings)

    def _arrow(self, start, end) -> None:
        self.axes.annotate(
            "", end, start, arrowprops=dict(arrowstyle="-|>", color=style.INK, linewidth=_THIN,
            mutation_scale=5, shrinkA=0, shrinkB=0),
        )  # fmt: skip

    def _across(self, name: str, first: float, last: float, height: float, edge: float) -> None:
        """A length along the fence [mm of the fence], written above its line."""
        ends = [_HINGE + part / self.scale for part in (first, last)]
        for end in ends:
            self._line([end] * 2, [edge + 0.8, height + 1.2], 0.6 * _THIN)
        middle, room = 0.5 * sum(ends), ends[1] - ends[0]
        text = _number(last - first)
        if room < 12:
            # Arrows from outside, the number beside them.
            self._arrow((ends[0] - 6, height), (ends[0], height))
            self._arrow((ends[1] + 6, height), (ends[1], height))
            self._text(ends[0] - 6.5, height, text, name, ha="right", va="center", size=_PLAIN)
            return
        self._arrow((middle, height), (ends[0], height))
        self._arrow((middle, height), (ends[1], height))
        self._text(middle, height + 0.6, text, name, ha="center", va="bottom", size=_PLAIN)

    def _down(self, name: str, edge: float, at: float, low: float, high: float, value: float):
        """A length across the fence, written beside its line."""
        side = 1 if at > edge else -1
        for end in (low, high):
            self._line([edge + side * 0.8, at + side * 1.2], [end, end], 0.6 * _THIN)
        text, middle = _number(value, 1 if name == "width" else 2), 0.5 * (low + high)
        if high - low < 8:
            self._arrow((at, high + 4), (at, high))
            self._arrow((at, low - 4), (at, low))
            # Beside the arrow that the lengths along the fence leave free.
            end, place = (high + 4.5, "bottom") if side > 0 else (low - 4.5, "top")
            self._text(at, end, text, name, ha="center", va=place, size=_PLAIN)
            return
        self._arrow((at, middle), (at, low))
        self._arrow((at, middle), (at, high))
        self._text(
            at - 1, middle, text, name, ha="right", va="center", rotation=90, size=_PLAIN
        )


def _number(value: float, digits: int = 1) -> str:
    """Millimetres without trailing zeros."""
    text = f"{value:.{digits}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def _short(text: str, share: float, large: bool) -> str:
    """The text, cut to the room in a field of the title block."""
    most = int(share * (72 if large else 110))
    return text if len(text) <= most else text[: most - 1] + "…"
