"""The contents of a picture, read from its pixels."""

from pathlib import Path

import matplotlib.image
import numpy as np

# Pixels of a line one pixel wide across a tenth of a picture of page width, 630 pixels at 100 dpi.
LEAST = 60


def shows_data(path: Path) -> bool:
    """Whether anything colored is drawn: axes, ticks, texts and grids are black, grey and white,
    and data are not."""
    pixels = matplotlib.image.imread(path)[..., :3]
    return int(np.sum(np.ptp(pixels, axis=-1) > 0.2)) >= LEAST
