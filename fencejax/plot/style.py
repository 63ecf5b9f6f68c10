"""The common style of all figures.

matplotlib is imported at its first use, and its global state is not changed. Without given axes a
new figure is made, which is `axes.figure`.
"""

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

COLORS = (
    "#8a8a8a", "#0b5fa5", "#c8501e", "#2a8c4a", "#7a4aa0", "#a08a20", "#3aa0a0", "#c04080",
)  # fmt: skip
"""Colors of several lines, in order. The first one is for the reference of a comparison."""
GRAY, BLUE, RED, GREEN, PURPLE, OCHRE, TEAL, PINK = COLORS
LINES = COLORS[1:]
INK, NOTE, GRID, PALE = "black", "#555555", "#dddddd", "#ece8df"
"""Colors of outlines and axes, of notes on a drawing, of grids, and of surfaces such as the
belt."""
CAUTION = "#f7d488"
"""Color of warnings, between `BLUE` for right and `RED` for wrong."""
EMPTY, HATCH = "#f0f0f0", "#c8c8c8"
"""Colors of areas without a value, and of the hatching across them."""
MAP, SIGNED_MAP = "viridis", "RdBu_r"
"""matplotlib's color maps of a quantity, and of one that is above and below 0."""
WIDTH, HEIGHT = 6.3, 3.2


def figure(height: float = HEIGHT, width: float = WIDTH) -> "Figure":
    """A figure outside of pyplot, by default of page width; height and width in inches.

    >>> fj.plot.figure(width=4.0).get_size_inches()
    array([4. , 3.2])
    """
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def prepared(axes: "Axes | None", height: float = HEIGHT) -> "Axes":
    """The axes, or those of a new figure, with a light grid behind everything.

    >>> fj.plot.prepared(None).figure.get_size_inches()
    array([6.3, 3.2])
    """
    if axes is None:
        axes = figure(height).subplots()
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, color=GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    return axes


def panel(axes: "Axes", x_label: str, y_label: str, title: str = "") -> "Axes":
    """The axes prepared as one of several in a figure: small labels, and a title at the left.

    >>> axes = fj.plot.panel(fj.plot.figure().subplots(), "time [ms]", "force [N]", "before")
    """
    prepared(axes)
    axes.tick_params(labelsize="small")
    axes.set_xlabel(x_label, fontsize="small")
    axes.set_ylabel(y_label, fontsize="small")
    axes.set_title(title, loc="left", fontsize="small", fontweight="bold")
    return axes


def hatched(axes: "Axes") -> None:
    """Hatch the background of the axes."""
    axes.set_facecolor(EMPTY)
    axes.patch.set_hatch("////")
    axes.patch.set_edgecolor(HATCH)


def hatched_patch(label: str) -> "Patch":
    """The entry of a legend for hatched areas."""
    from matplotlib.patches import Patch

    return Patch(facecolor=EMPTY, edgecolor=HATCH, hatch="////", label=label)


def legend(axes: "Axes") -> None:
    """A legend above the axes, where it covers nothing; none without labelled lines.

    >>> axes = fj.plot.prepared(None)
    >>> lines = axes.plot([0, 1], [0, 1], label="force")
    >>> fj.plot.legend(axes)
    """
    count = len(axes.get_legend_handles_labels()[0])
    if count:
        columns = 2 if count == 4 else 3
        axes.legend(
            frameon=False,
            fontsize="small",
            ncols=columns,
            loc="lower left",
            bbox_to_anchor=(0, 1.0),
            columnspacing=1.2,
        )


def legend_above(axes: "Axes", columns: int) -> None:
    """A legend above all panels of a figure, for the lines in one of them.

    >>> upper, lower = fj.plot.figure().subplots(2)
    >>> lines = upper.plot([0, 1], [0, 1], label="before")
    >>> fj.plot.legend_above(upper, columns=1)
    """
    axes.figure.legend(
        *axes.get_legend_handles_labels(),
        loc="outside upper center",
        ncols=columns,
        frameon=False,
        fontsize="small",
    )


def check_labels(**labels: str) -> None:
    """Check that the texts of axes end with a unit.

    Raises `ValueError` where one has none.
    """
    for name, text in labels.items():
        if not re.search(r"\[[^\]]+\]\s*$", text):
            raise ValueError(
                f"Argument `{name}` must end with a unit in brackets, but is {text!r}. Write, for "
                'example, "peak force [N]", and [1] for a plain number.'
            )
