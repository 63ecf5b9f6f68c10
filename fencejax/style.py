"""The look that all figures share.

matplotlib is imported where it is first used, and its global state is left alone: a figure is made
where no axes are given, and belongs to them (`axes.figure`).
"""

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS = ("#8a8a8a", "#0b5fa5", "#c8501e", "#2a8c4a", "#7a4aa0", "#a08a20")
WIDTH, HEIGHT = 6.3, 3.2


def figure(height: float = HEIGHT) -> "Figure":
    """A figure of page width, `height` inches high, that pyplot does not know of."""
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH, height), layout="constrained")


def prepared(axes: "Axes | None", height: float = HEIGHT) -> "Axes":
    """The axes, or those of a new figure, with a light grid behind everything."""
    if axes is None:
        axes = figure(height).subplots()
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    return axes


def legend(axes: "Axes") -> None:
    """A legend above the axes, where it hides nothing; none where nothing is named."""
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
