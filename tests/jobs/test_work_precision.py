"""The measurement of speed against accuracy in its quick version, and the rungs' promises."""

import json

import numpy as np
import pytest
import report_pages
from pictures import shows_data

import fencejax as fj
from optimize.work_precision import cases, front, ladder, main, orders
from optimize.work_precision.configuration import WorkPrecisionConfig, configure
from optimize.work_precision.errors import Outcome, compare, spread
from optimize.work_precision.measure import Times


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    out = tmp_path_factory.mktemp("work_precision")
    return main(WorkPrecisionConfig(out=out).quick(), quiet=True), out


def errors_of(report, knob, label):
    (found,) = [errors for point, errors in report.knobs[knob] if point.label == label]
    return found


@pytest.mark.bench
def test_rungs_keep_their_promised_errors(quick):
    report, _ = quick
    assert report.succeeded
    promised = {"fast": (1e-2, 5e-2), "standard": (3e-3, 2e-2)}
    for rung in report.rungs:
        value, gradient = promised[rung.name]
        assert spread(rung.errors.value[:, 0])["worst"] < value
        assert spread(rung.errors.gradient[:, 0])["worst"] < gradient
    # A designer needs 1 % on the value and 5 % on the gradient.
    fast, standard = report.rungs
    assert np.all(standard.errors.value[:, 1:] < 1e-2)
    assert np.median(standard.errors.value[:, 0]) < np.median(fast.errors.value[:, 0])


@pytest.mark.bench
def test_one_mode_is_refused_by_its_gradient_though_its_value_is_right(quick):
    report, _ = quick
    one = errors_of(report, "modes", "1")
    assert spread(one.value[:, 0])["worst"] < 1e-2
    assert spread(one.gradient[:, 0])["worst"] > 5e-2
    # The density acts through the modes' masses: its part is the first to go wrong.
    density = cases.VARIABLES.index("density")
    assert spread(one.own[:, 0, density])["worst"] > 0.15


@pytest.mark.bench
def test_errors_fall_with_step_and_smoothing(quick):
    report, _ = quick
    standard = report.rungs[1].errors
    # Four times the step against all that the standard rung leaves.
    coarse = errors_of(report, "step", "1 ms")
    assert np.median(coarse.gradient[:, 2]) > np.median(standard.gradient[:, 2])
    assert np.max(coarse.value[:, 2]) > np.max(standard.value[:, 2])
    # Four times the smoothing of friction, a bias of the first order in slip_speed.
    fast = report.rungs[0].errors
    assert np.median(standard.value[:, 0]) < np.median(fast.value[:, 0]) < 1e-2


@pytest.mark.bench
def test_files(quick):
    report, out = quick
    content = json.loads((out / "work_precision.json").read_text())
    assert [rung["name"] for rung in content["rungs"]] == ["fast", "standard"]
    assert np.shape(content["rungs"][0]["lanes"]["elasticities"]) == (8, 3, 8)
    for name in cases.VARIABLES:
        found = content["rungs"][0]["errors"]["peak_force"]["components"][name]
        assert 0 <= found["of the norm"]["median"] <= found["of the norm"]["worst"]
    assert set(content["front"]["value"]) <= {"fast", "standard"}
    text = (out / "work_precision.md").read_text()
    assert "| peak force |" in text
    assert "FAILED" not in text
    for name in ("front", "knobs", "components", "random_impacts", "costs"):
        assert shows_data(out / f"{name}.png")
    page = report_pages.read(out / "report.html")
    assert page.pictures == 5
    assert "Rungs" in page.headings
    # The paper's impact is the first lane.
    assert report.truth.values[0, 0] == pytest.approx(1115.6, rel=1e-3)


def test_front_of_points():
    cost, error = [3.0, 1.0, 2.0, 2.0, 4.0, 5.0], [0.1, 0.9, 0.5, 0.4, 0.2, np.nan]
    assert front.pareto(cost, error) == [1, 3, 0]
    # Of equals the first, and nothing of nothing.
    assert front.pareto([1.0, 1.0], [0.5, 0.5]) == [0]
    assert front.pareto([], []) == []
    with pytest.raises(ValueError, match="of one length"):
        front.pareto([1.0], [])


def outcome(values, slopes, status=0):
    values, slopes = np.asarray(values, float), np.asarray(slopes, float)
    return Outcome(values, slopes, np.full(len(values), status))


def test_effects_that_add_up_are_superposed():
    ones = np.ones((2, 3, 8))
    base = outcome(100 * np.ones((2, 3)), ones)
    whole = front.superposed(
        base, [outcome(110 * np.ones((2, 3)), 2 * ones), outcome(90 * np.ones((2, 3)), ones)]
    )
    np.testing.assert_allclose(whole.values, 99.0)
    np.testing.assert_allclose(whole.slopes, 2.0)


def test_likely_points_are_the_cheapest_that_are_exact():
    fidelities = [fj.Fidelity(modes=n, step=h) for n in (1, 2, 4) for h in (1e-3, 2.5e-4)]
    predicted = {f: (f.step, f.step / f.modes) for f in fidelities}
    chosen = front.likely(predicted, 2)
    assert len(chosen) == 2
    assert fj.Fidelity(modes=1, step=1e-3) in chosen
    assert [front.work(f) for f in chosen] == sorted(front.work(f) for f in chosen)
    assert front.likely(predicted, 99) == sorted(fidelities, key=front.work)


def test_errors_are_relative_and_of_sound_scenes_alone():
    exact = np.zeros((2, 3, 8))
    exact[..., 0], exact[..., 1] = 3.0, 4.0
    truth = outcome([[100, 1, 1], [100, 1, 1]], exact)
    truth.status[1] = fj.Status.LARGE_DEFLECTION
    off = exact.copy()
    off[..., 1] += 0.5
    errors = compare(outcome([[101, 1, 1], [200, 1, 1]], off), truth)
    assert errors.value.shape == (1, 3)
    assert errors.value[0, 0] == pytest.approx(0.01)
    assert errors.gradient[0, 0] == pytest.approx(0.1)
    assert errors.component[0, 0, 1] == pytest.approx(0.1)
    assert errors.own[0, 0, 1] == pytest.approx(0.125)
    truth.status[0] = fj.Status.NON_FINITE
    with pytest.raises(ValueError, match="must hold a sound scene"):
        compare(truth, truth)


def test_observed_order():
    steps = np.array([4e-3, 2e-3, 1e-3])
    np.testing.assert_allclose(orders.observed(steps, 7 * steps**2), [2.0, 2.0])
    assert np.isnan(orders.observed(steps, [1.0, 0.0, 1.0])).all()


def test_times_are_a_median_with_its_spread():
    times = Times.of(lambda: np.zeros(3), 5).per(2)
    assert 0 < times.low <= times.median <= times.high


def test_random_impacts_are_the_same_again_and_within_their_ranges():
    family, again = (cases.impacts(100, 1, 0.13) for _ in range(2))
    np.testing.assert_array_equal(family.numbers, again.numbers)
    assert family.numbers.shape == (101, len(cases.NUMBERS))
    for name, (low, high, _) in cases.RANGES.items():
        column = family.numbers[1:, cases.NUMBERS.index(name)]
        assert low <= column.min() < column.max() <= high
    assert family.repeated(250).numbers.shape[0] == 250


def test_full_ladder_moves_one_knob_at_a_time():
    whole = ladder.dense()
    for name, points in whole.knobs.items():
        for point in points:
            changed = [
                key for key, value in vars(point.fidelity).items()
                if value != getattr(whole.base, key)
            ]  # fmt: skip
            allowed = {
                "slip_speed": {"slip_speed", "static_speed"},
                "modes, no static correction": {"modes", "static_correction"},
                "precision": {"precision", "step"},
                "step_tolerance": {"step_tolerance", "step", "longest_stride"},
            }.get(name, {name})
            assert set(changed) <= allowed
    # Single precision refuses the others' step: both of this knob have a longer one.
    assert len({point.fidelity.step for point in whole.knobs["precision"]}) == 1
    # Every effect that the product grid adds up is among the points that are run.
    run = {point.fidelity for points in whole.knobs.values() for point in points} | {whole.base}
    assert all(part in run for parts in whole.grid.values() for part in parts)


def test_flags():
    assert configure([]) == WorkPrecisionConfig()
    config = configure(["--scene", "slide", "sort", "--random", "9", "--no-plots"])
    assert config.scene == ("slide", "sort")
    assert config.random == 9
    assert not config.plots
    assert configure(["--quick"]).ladder == "quick"
    with pytest.raises(ValueError, match="`repeats` must be at least 3"):
        configure(["--repeats", "1"])
    with pytest.raises(ValueError, match="`scene` must be one of"):
        WorkPrecisionConfig(scene=("wall",))


def test_help_names_every_default(capsys):
    with pytest.raises(SystemExit) as leaving:
        configure(["--help"])
    assert leaving.value.code == 0
    # One more for --quick.
    assert capsys.readouterr().out.count("(default:") == 1 + len(vars(WorkPrecisionConfig()))
