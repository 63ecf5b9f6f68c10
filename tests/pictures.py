"""The contents of a picture, read from its pixels, and when a job draws its pictures."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

# Pixels of a line one pixel wide across a tenth of a picture of page width, 630 pixels at 100 dpi.
LEAST = 60


def shows_data(path: Path) -> bool:
    """Whether anything colored is drawn: axes, ticks, texts and grids are black, grey and white,
    and data are not."""
    pixels = matplotlib.image.imread(path)[..., :3]
    return int(np.sum(np.ptp(pixels, axis=-1) > 0.2)) >= LEAST


@contextlib.contextmanager
def numbers_first(job) -> Iterator[None]:
    """Fail where the module of a job draws its pictures before its numbers are written: an error in
    a picture would lose them."""
    draw, drawn = job._draw, []

    def checked(config, *rest):
        assert (config.out / "result.json").exists(), "pictures are drawn before the numbers"
        drawn.append(config)
        draw(config, *rest)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(job, "_draw", checked)
        yield
    assert drawn
