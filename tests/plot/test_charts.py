"""Histories and charts: the numbers that were given, axes with units, refusals."""

import re
import subprocess
import sys
import types
from pathlib import Path

import jax
import numpy as np
import pytest
import runs
from pictures import shows_data

import fencejax as fj
from fencejax.plot import non_dominated

LABELS = dict(x_label="place R [m]", y_label="mass [kg]", label="peak force [N]")


def test_importing_leaves_matplotlib_alone():
    code = "import fencejax, sys; assert 'matplotlib' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def test_colors_have_one_home():
    """Everything is drawn in the colors and with the color maps of `fencejax.plot.style`."""
    named = r"(?:color|colors|fc|ec|cmap)\W{1,3}[\"'](?:C\d|tab:\w+|0?\.\d+|viridis|RdBu\w*)[\"']"
    drawing = re.compile(rf"{named}|[\"']#[0-9a-fA-F]{{3,8}}[\"']")
    assert drawing.search('axes.plot(x, y, color="C0")')
    assert drawing.search('RED = "#c8501e"')
    root, found = Path(__file__).parents[2], []
    for folder in ("fencejax", "optimize", "tests", "notebooks"):
        for file in sorted((root / folder).rglob("*.py")):
            if file not in (root / "fencejax/plot/style.py", Path(__file__)):
                found += [f"{file}: {one[0]}" for one in drawing.finditer(file.read_text())]
    assert found == []


def test_a_force_is_shown_until_it_ends():
    time = np.linspace(0.0, 1.0, 101)
    trace = fj.plot.Trace(time, np.where(time < 0.2, 5.0, 0.0), 0 * time)
    ahead = fj.plot.force(trace).get_xlim()[1]
    assert 190 < ahead < 300
    # Beside other signals the time is theirs.
    own = fj.plot.tip_deflection(trace)
    assert fj.plot.force(trace, axes=own).get_xlim()[1] >= 1000


def test_every_signal_is_drawn_as_it_is():
    result = runs.fixed("whole_sort")
    panels = fj.plot.histories(result, fj.plot.SIGNALS)
    assert len(panels) == len(fj.plot.SIGNALS)
    drawn = {}
    for name, panel in zip(fj.plot.SIGNALS, panels, strict=True):
        assert panel.get_ylabel().endswith("]")
        (line,) = panel.lines
        np.testing.assert_allclose(line.get_xdata(), 1e3 * result.history.time)
        drawn[name] = line.get_ydata()
    assert panels[-1].get_xlabel() == "time since the start [ms]"
    assert np.max(drawn["fence_force"]) == pytest.approx(float(result.peak_force), rel=1e-3)
    top = np.max(np.abs(drawn["tip_deflection"]))
    assert top == pytest.approx(1e3 * float(result.tip_deflection), rel=1e-3)
    assert np.max(drawn["stress"]) == pytest.approx(1e-6 * float(result.peak_stress), rel=1e-3)
    # The default drive: 0.6623 rad at most, at 1.53 rad/s at most; the belt's 2 m/s. A sample is
    # within 2 ms of the top: (2 pi / 1.36 s x 2 ms)^2 / 2 = 4e-5.
    assert np.max(drawn["drive_angle"]) == pytest.approx(1.53 * 1.36 / np.pi, rel=1e-4)
    assert np.max(drawn["drive_speed"]) == pytest.approx(1.53, rel=1e-4)
    assert drawn["parcel_speed"][0] == pytest.approx(2.0)
    # The belt never holds by more than its static friction, 0.85 m g.
    assert np.max(drawn["belt_force"]) <= 0.85 * 15 * 9.81 * (1 + 1e-9)
    assert np.max(drawn["border_force"]) == pytest.approx(
        float(result.peak_border_force), rel=1e-3
    )


def test_several_results_by_name():
    result = runs.fixed("oblique_impact")
    (top, bottom) = fj.plot.histories({"one": result, "two": result})
    assert [text.get_text() for text in top.get_legend().get_texts()] == ["one", "two"]
    assert bottom.get_legend() is None
    assert len(bottom.lines) == 2


def test_energies():
    result = runs.fixed("oblique_impact")
    axes = fj.plot.energies(result)
    assert axes.get_ylabel() == "energy held [J]"
    at_start = [line.get_ydata()[0] for line in axes.lines]
    # The parcel rides with the belt, 15 kg at 2 m/s; nothing is pressed in yet.
    assert at_start[0] == pytest.approx(30.0)
    assert at_start[3] == pytest.approx(0.0, abs=1e-9)


def test_refusals_of_histories():
    result = runs.fixed("oblique_impact")
    with pytest.raises(ValueError, match="`names` must be one of"):
        fj.plot.histories(result, ("loudness",))
    with pytest.raises(ValueError, match="it has no 'border_force'"):
        fj.plot.histories(result, "border_force")
    with pytest.raises(ValueError, match="`axes` must be one for each of the names"):
        fj.plot.histories(result, (), axes=())
    with pytest.raises(ValueError, match="holds none"):
        fj.plot.histories(types.SimpleNamespace(history=None))
    batch = jax.tree.map(lambda leaf: np.asarray(leaf)[None], result.history)
    with pytest.raises(ValueError, match="holds a batch"):
        fj.plot.energies(types.SimpleNamespace(history=batch))


def test_heat_map():
    x, y = np.array([0.5, 0.7, 1.1]), np.array([1.0, 10.0])
    values = np.array([[1.0, 2.0, 3.0], [4.0, np.nan, 6.0]])
    good = np.array([[True, True, False], [True, True, True]])
    axes = fj.plot.heat_map(x, y, values, good=good, **LABELS)
    (mesh,) = [part for part in axes.collections if hasattr(part, "get_coordinates")]
    shown = mesh.get_array()
    np.testing.assert_array_equal(
        np.ma.getmaskarray(shown), [[False, False, True], [False, True, False]]
    )
    np.testing.assert_array_equal(shown.compressed(), [1.0, 2.0, 4.0, 6.0])
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("place R [m]", "mass [kg]")
    assert axes.figure.axes[1].get_ylabel() == "peak force [N]"
    axes.figure.canvas.draw()
    # Nothing good at all, and nothing but one value: still a picture.
    fj.plot.heat_map(x, y, values, good=~np.isfinite(values), **LABELS).figure.canvas.draw()
    fj.plot.heat_map(x, y, np.ones((2, 3)), **LABELS).figure.canvas.draw()


def test_refusals_of_heat_map():
    x, y = np.arange(3.0), np.arange(2.0)
    with pytest.raises(ValueError, match=r"have \(3,\), \(2,\) and \(3, 2\)"):
        fj.plot.heat_map(x, y, np.ones((3, 2)), **LABELS)
    with pytest.raises(ValueError, match="`x` must rise"):
        fj.plot.heat_map(x[::-1], y, np.ones((2, 3)), **LABELS)
    with pytest.raises(ValueError, match="`y_label` must end with a unit in brackets"):
        fj.plot.heat_map(x, y, np.ones((2, 3)), **{**LABELS, "y_label": "mass"})


def test_non_dominated_points():
    points = np.random.default_rng(0).uniform(size=(60, 2))
    points[7] = points[np.argmin(points[:, 0])]
    points[9] = np.nan
    expected = [
        np.all(np.isfinite(p))
        and not any(np.all(q <= p) and np.any(q < p) for q in points)
        for p in points
    ]
    np.testing.assert_array_equal(non_dominated(points), expected)
    assert 1 < np.sum(expected) < 60
    assert expected[7]
    assert not expected[9]


def test_front():
    points = np.array([[1.0, 3.0], [2.0, 2.0], [2.5, 2.5], [3.0, 1.0], [4.0, 1.5]])
    bound = np.array([[0.5, 2.0], [3.0, 0.5]])
    axes = fj.plot.front(
        points, x_label="force [N]", y_label="tip [mm]", names=list("abcde"), bound=bound,
        logarithmic=True,
    )  # fmt: skip
    pale, line, below = axes.lines
    np.testing.assert_array_equal(np.stack(pale.get_data(), 1), points[[2, 4]])
    np.testing.assert_array_equal(np.stack(line.get_data(), 1), points[[0, 1, 3]])
    np.testing.assert_array_equal(np.stack(below.get_data(), 1), bound)
    assert [text.get_text() for text in axes.texts] == list("abcde")
    assert axes.get_xscale() == axes.get_yscale() == "log"
    both = {"before": points, "after": points - 0.5}
    axes = fj.plot.front(both, x_label="x [1]", y_label="y [1]")
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert texts == ["before", "after"]
    for changes, message in (
        (dict(points=np.ones(3)), r"`points` must have the shape \(n, 2\), but has \(3,\)"),
        (dict(points=points, names=["a"]), "`names` must hold one name for each"),
        (dict(points=points, bound=np.ones(2)), "`bound` must have the shape"),
        (dict(points=points, x_label="force"), "`x_label` must end with a unit"),
    ):
        with pytest.raises(ValueError, match=message):
            fj.plot.front(**{**dict(x_label="x [1]", y_label="y [1]"), **changes})


def test_gradient_bars_are_as_long_as_the_elasticities():
    found = {"peak_force": {"thickness": 1.4, "density": -0.1}, "tip": {"thickness": -1.9}}
    axes = fj.plot.gradient_bars(found)
    lengths = [bar.get_width() for bar in axes.patches]
    np.testing.assert_allclose(lengths, [1.4, -0.1, -1.9, 0.0])
    assert [text.get_text() for text in axes.get_yticklabels()] == ["thickness", "density"]
    assert axes.get_xlabel() == "elasticity d ln Q / d ln p [1]"


def test_convergence_leaves_failed_evaluations_out():
    def record(number, objective, failed=False):
        return types.SimpleNamespace(
            evaluation=number, objective=objective, violation=0.0 if number > 2 else 0.1,
            kkt=1.0 / number, failed=failed,
        )  # fmt: skip

    history = [record(1, 9.0), record(2, 99.0, failed=True), record(3, 7.0), record(4, 6.5)]
    upper, lower = fj.plot.convergence(history, unit="N", scale=2.0, tolerance=1e-3)
    np.testing.assert_array_equal(upper.lines[0].get_data(), [[1, 3, 4], [18.0, 14.0, 13.0]])
    assert upper.get_ylabel() == "worst case [N]"
    upper, _ = fj.plot.convergence(history, unit="J", label="mean work")
    assert upper.get_ylabel() == "mean work [J]"
    assert lower.get_ylabel() == "violation, residual [1]"
    texts = [text.get_text() for text in lower.get_legend().get_texts()]
    assert texts == ["largest violation", "KKT residual", "tolerance", "failed"]
    np.testing.assert_array_equal(lower.lines[-1].get_xdata(), [2])


def test_shows_data_tells_a_curve_from_empty_axes(tmp_path):
    axes = fj.plot.style.panel(fj.plot.style.figure().subplots(), "time [s]", "force [N]", "force")
    axes.figure.savefig(tmp_path / "empty.png")
    axes.plot([0, 1], [0, 1], color=fj.plot.COLORS[1], linewidth=1)
    axes.figure.savefig(tmp_path / "curve.png")
    assert not shows_data(tmp_path / "empty.png")
    assert shows_data(tmp_path / "curve.png")
