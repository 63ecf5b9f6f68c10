"""Animations: the right frames at the given times."""

import numpy as np
import pytest
import runs
from PIL import Image

import fencejax as fj
from fencejax.plot import outline

SCENE = runs.SCENES["oblique_impact"]()


@pytest.fixture(scope="module")
def result():
    return runs.fixed("oblique_impact")


def film_of(result, **changes):
    return fj.plot.animate(SCENE, result, **{**dict(frames=4, frames_per_second=10), **changes})


def test_frames_are_equally_spaced_in_time(result):
    film = film_of(result, start=0.02, stop=0.08, frames=7)
    np.testing.assert_allclose(film.times, np.linspace(0.02, 0.08, 7), rtol=1e-12)
    np.testing.assert_allclose(film_of(result).times, np.linspace(0, 0.12, 4), atol=1e-12)
    assert len(film_of(result, frames=1).times) == 1


def test_a_frame_shows_its_moment(result):
    film = film_of(result, frames=7)
    shape = outline(SCENE, result, film.times)
    axes = film.show(3)
    assert axes.get_title(loc="left").startswith("60.0 ms,  shown 5.8 times slower")
    lines = [np.stack(line.get_data()) for line in axes.lines]
    for expected in (shape.parcel[3], shape.fence[3], shape.center[:4].T):
        assert any(np.array_equal(line, expected) for line in lines)
    (quiver,) = [part for part in axes.collections if hasattr(part, "U")]
    largest = np.max(result.history.fence_force)
    np.testing.assert_allclose(
        np.hypot(quiver.U, quiver.V), 0.3 * shape.fence_force[3] / largest, rtol=1e-9
    )
    # The mark on the force's curve below.
    below = axes.figure.axes[1]
    np.testing.assert_allclose(below.lines[-1].get_data(), [[60.0], [shape.fence_force[3]]])
    assert below.get_xlabel() == "time since the start [ms]"
    assert below.get_ylabel() == "reaction force N [N]"
    # Back to another frame.
    assert film.show(0).get_title(loc="left").startswith("0.0 ms")
    assert any(np.array_equal(line.get_data(), shape.fence[0]) for line in axes.lines)


def test_everything_stays_in_the_picture(result):
    film = film_of(result, signal=False)
    assert len(film.axes.figure.axes) == 1
    shape = outline(SCENE, result, film.times)
    for part in (shape.parcel, shape.fence):
        for row, (low, high) in enumerate((film.axes.get_xlim(), film.axes.get_ylim())):
            assert low < part[:, row].min()
            assert part[:, row].max() < high


def test_gif_has_the_frames_asked_for(result, tmp_path):
    path = film_of(result, frames=5).save(tmp_path / "impact.gif", dpi=40)
    with Image.open(path) as image:
        assert image.n_frames == 5
        assert image.info["loop"] == 0
        assert image.info["duration"] == 100
        seen = []
        for frame in range(5):
            image.seek(frame)
            seen.append(np.asarray(image.convert("RGB")))
    assert all(np.any(a != b) for a, b in zip(seen, seen[1:], strict=False))


def test_page_holds_every_frame(result, tmp_path):
    film = film_of(result, frames=3)
    text = film.save(tmp_path / "impact.html", dpi=40).read_text()
    assert text.count("data:image/png;base64") == 3
    assert "<script" in film._repr_html_()


def test_refusals(result, tmp_path):
    film = film_of(result)
    with pytest.raises(ValueError, match="must end with .gif or .html"):
        film.save(tmp_path / "impact.mp4")
    with pytest.raises(ValueError, match=r"`frame` must be from 0 to 3 \[1\], but is 4"):
        film.show(4)
    with pytest.raises(ValueError, match="`stop` must be at least `start`"):
        film_of(result, start=0.1, stop=0.05)
    with pytest.raises(ValueError, match="`frames` must be at least 1"):
        film_of(result, frames=0)
    with pytest.raises(TypeError, match="`frames_per_second` must be a whole number"):
        film_of(result, frames_per_second=2.5)
    with pytest.raises(ValueError, match="`times` must be within the history"):
        film_of(result, stop=1.0)
