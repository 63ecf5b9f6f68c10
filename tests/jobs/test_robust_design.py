"""Risk measures, a blow in the parcel's own terms, intervals, and the robust design's job."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import report_pages
from pictures import shows_data
from scipy.stats import binomtest
from scipy.stats.mstats import hdquantiles

import fencejax as fj
from fencejax.design import quantile, risk, shock
from optimize.robust_design import confidence, main
from optimize.robust_design.configuration import RobustConfig, configure
from optimize.robust_design.parcels import FRESH, draw

_SMALL = RobustConfig(
    scenes="impacts", severity="drop_height", variables=("thickness",), duration=0.10,
    crossing=-0.4, sample=32, batch=32, chunk=32, budget=6, steps=3, fresh=64, resamples=100,
    check_fidelity="fast", tip_limit=0.12,
)  # fmt: skip


def _with(**changes):
    return RobustConfig(**{**vars(_SMALL), **changes})


def test_cvar_of_known_samples():
    values = jnp.asarray(np.random.default_rng(0).permutation(100) + 1.0)
    # The mean of 96 ... 100; of 94.5 % the largest 5.5: 96 ... 100 and half of 95.
    assert float(risk.risk(values, "cvar", 0.95)) == pytest.approx(98.0, rel=1e-12)
    assert float(risk.risk(values, "cvar", 0.945)) == pytest.approx((490 + 47.5) / 5.5, rel=1e-12)
    assert float(risk.risk(values, "mean")) == pytest.approx(50.5, rel=1e-12)
    assert float(risk.risk(values, "worst")) == 100.0
    # A share smaller than one of the sample is its largest.
    assert float(risk.risk(values, "cvar", 0.999)) == 100.0


def test_cvar_is_rockafellar_and_uryasevs_minimum():
    values = np.random.default_rng(1).normal(size=173)
    # Piecewise linear in t with kinks at the values: the minimum is at one of them.
    excess = np.maximum(values[None] - values[:, None], 0).sum(1) / (0.1 * 173)
    least = np.min(values + excess)
    assert float(risk.risk(values, "cvar", 0.9)) == pytest.approx(least, rel=1e-12)


def test_derivative_of_cvar_is_the_weights():
    values = jnp.array([3.0, 9.0, 1.0, 7.0])
    slope = jax.grad(lambda v: risk.risk(v, "cvar", 0.625))(values)
    # k = 1.5: the largest counts 1 / 1.5, the next 0.5 / 1.5.
    np.testing.assert_allclose(slope, [0, 2 / 3, 0, 1 / 3], rtol=1e-12)


@pytest.mark.parametrize("measure", ["mean", "cvar", "worst"])
def test_bad_numbers_are_left_out(measure):
    values = jnp.array([3.0, np.nan, 1.0, np.inf, 7.0])
    valid = jnp.array([True, False, True, False, True])

    def left(v):
        return risk.risk(v, measure, 0.5, valid)

    kept = risk.risk(values[jnp.array([0, 2, 4])], measure, 0.5)
    assert float(left(values)) == pytest.approx(float(kept), rel=1e-12)
    slope = jax.jacfwd(left)(values)
    assert np.all(np.isfinite(slope))
    np.testing.assert_array_equal(slope[jnp.array([1, 3])], 0)
    assert np.isnan(float(risk.risk(values, measure, 0.5, jnp.zeros(5, dtype=bool))))


def test_quantile_is_harrell_and_davis():
    values = np.random.default_rng(2).normal(size=150)
    for level in (0.05, 0.5, 0.9):
        exact = float(hdquantiles(values, level)[0])
        assert float(quantile(values, level)) == pytest.approx(exact, rel=1e-9)
        every = jnp.ones(150, dtype=bool)
        assert float(quantile(values, level, every)) == pytest.approx(exact, rel=1e-9)


def test_wall_force_and_drop_height():
    # Without damping m v^2 / 2 = k_p D^5 / 5, N = k_p D^4; with it, as simulated (README).
    soft = fj.Parcel(damping=0.0, mass=3.0)
    exact = 1.72e9 * (2.5 * 3.0 * 1.4**2 / 1.72e9) ** 0.8
    assert float(shock.wall_force(1.4, soft)) == pytest.approx(exact, rel=1e-9)
    parcel = fj.Parcel()
    assert float(shock.wall_force(2.426, parcel)) == pytest.approx(3293.85, rel=1e-5)
    assert float(shock.wall_force(0.5, parcel)) == pytest.approx(283.93, rel=1e-4)
    for height in (1e-3, 0.05, 1.2):
        force = shock.wall_force(np.sqrt(2 * 9.81 * height), parcel)
        assert float(shock.drop_height(force, parcel)) == pytest.approx(height, rel=1e-9)
    assert float(shock.drop_height(0.0, parcel)) == 0.0
    slope = float(jax.grad(lambda f: shock.drop_height(f, parcel))(1000.0))
    ends = [float(shock.drop_height(1000.0 + d, parcel)) for d in (1.0, -1.0)]
    # Interpolation of f is linear: its slope is off by the spacing, 1 % of a bend of 0.1.
    assert slope == pytest.approx((ends[0] - ends[1]) / 2, rel=1e-3)
    assert float(shock.g_load(98.1, 2.0)) == pytest.approx(5.0)


def test_intervals():
    for good, count in ((0, 30), (17, 30), (30, 30)):
        holds = np.arange(count) < good
        exact = binomtest(good, count).proportion_ci(0.9, "exact")
        found = confidence.share(holds, 0.9)
        np.testing.assert_allclose(found, [good / count, exact.low, exact.high], atol=1e-12)
    values = np.random.default_rng(3).normal(10.0, 2.0, 400)
    found = confidence.bootstrap(values, "mean", 0.95, 4000, 0.95, 0)
    # 1.96 sigma / sqrt(n) = 0.196 either way; the sample's own sigma and 4000 draws: 10 %.
    assert found.value == pytest.approx(values.mean(), rel=1e-12)
    assert found.upper - found.lower == pytest.approx(2 * 0.196, rel=0.15)
    pair = np.column_stack([values, 0.5 * values])
    np.testing.assert_allclose(
        confidence.bootstrap(pair, "cvar", 0.9, 100, 0.95, 0), 0.5, rtol=1e-12
    )
    for measure in ("mean", "cvar", "worst"):
        own = float(confidence.measure_of(values, measure, 0.93))
        assert own == pytest.approx(float(risk.risk(values, measure, 0.93)), rel=1e-12)


def test_parcels_lie_in_their_spans():
    config = RobustConfig(mass=(0.2, 30.0), angle=(-0.1, 0.2))
    for stream in (0, FRESH, 5):
        parcels = draw(config, 300, stream)
        assert parcels.lanes == 300
        assert np.all((parcels.mass >= 0.2) & (parcels.mass <= 30.0))
        # Even in the logarithm: half of them lie below the geometric mean.
        assert np.mean(parcels.mass < np.sqrt(0.2 * 30)) == pytest.approx(0.5, abs=0.12)
        assert np.all((parcels.angle >= -0.1) & (parcels.angle <= 0.2))
    np.testing.assert_array_equal(draw(config, 50, 7).mass, draw(config, 50, 7).mass)
    assert not np.array_equal(draw(config, 50, 7).mass, draw(config, 50, 8).mass)


def _sorted(folder, parcels, *given):
    """The job for a sorter file with these parcels."""
    path = folder / "sorter.toml"
    path.write_text(f"[parcels]\n{parcels}\n")
    return RobustConfig(sorter=str(path), set=given)


def test_measured_parcels_come_as_often_as_their_weights_say(tmp_path):
    titles, rows = "mass [g],length [mm],breadth [mm],weight", ["500,300,200,10", "2500,400,300,5"]
    text = "\n".join([titles, *rows, "12000,500,350,2", "20000,600,400,0"])
    (tmp_path / "measured.csv").write_text(text)
    config = _sorted(tmp_path, 'file = "measured.csv"\noffset = "50 mm"')
    listed = {(0.5, 0.3, 0.2): 10 / 17, (2.5, 0.4, 0.3): 5 / 17, (12.0, 0.5, 0.35): 2 / 17}
    # 4 is the number of rows.
    for count, stream in ((340, 0), (340, 7), (4, 0), (3400, FRESH)):
        parcels = draw(config, count, stream)
        assert parcels.lanes == count
        sizes = (parcels.mass, parcels.length, parcels.breadth)
        rows = list(zip(*(np.round(size, 9).tolist() for size in sizes), strict=True))
        assert set(rows) <= set(listed)
        for row, share in listed.items():
            # Stratified: off by one parcel at either end of a row's weight. At random: by four
            # standard deviations.
            off = 4 * np.sqrt(share * (1 - share) * count) if stream == FRESH else 2
            assert rows.count(row) == pytest.approx(share * count, abs=off)
        np.testing.assert_allclose(parcels.offset, 0.05)
    # In random order, another one for each stream.
    first = draw(config, 340, 0).mass
    np.testing.assert_array_equal(first, draw(config, 340, 0).mass)
    assert not np.array_equal(first, draw(config, 340, 7).mass)
    assert np.ptp(first[:40]) > 0


def test_listed_parcels_come_at_places_that_are_drawn(tmp_path):
    text = 'list = [{mass = "2 kg", weight = 3}, {mass = "8 kg", weight = 1}]\n'
    text += 'offset = {distribution = "uniform", lower = "20 mm", upper = "80 mm"}\n'
    config = _sorted(tmp_path, text + 'front = ["0 mm", "50 mm"]', "parcels.count=5")
    parcels = draw(config, 64, 0)
    assert (parcels.lanes, np.unique(parcels.offset).size) == (64, 64)
    for front in (0.0, 0.05):
        mass = parcels.mass[parcels.front == front]
        assert mass.size == 32
        assert np.sum(mass == 8) == 8
    # Mass and place are independent of each other: four standard deviations.
    heavy = draw(config, 1024, 3)
    offset = heavy.offset[heavy.mass == 8]
    assert np.mean(offset) == pytest.approx(0.05, abs=4 * 0.06 / np.sqrt(12 * offset.size))


def test_one_parcel_is_no_sample(tmp_path):
    with pytest.raises(ValueError, match="several parcels, .* one parcel at one place"):
        draw(_sorted(tmp_path, 'mass = "2 kg"'), 32, 0)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    out = tmp_path_factory.mktemp("robust")
    return main(_with(out=out), quiet=True), out


def test_measure_falls_and_the_limits_hold(small):
    outcome, _ = small
    assert outcome.ratio.upper < 1.0
    assert outcome.found.steps[-1].violation <= 0.05
    after = outcome.judged["after"]
    assert after.excluded == 0.0
    assert sum(after.statuses.values()) == _SMALL.fresh
    assert outcome.limits_hold
    for name in ("mean", "cvar", "worst"):
        interval = after.measures[name]
        assert interval.lower <= interval.value <= interval.upper + 1e-12


def test_files_and_resumption(small):
    outcome, out = small
    content = json.loads((out / "robust.json").read_text())
    assert content["recalled"] == 0
    assert len(content["steps"]) == len(outcome.found.steps)
    assert all(sum(step["statuses"]) == _SMALL.sample for step in content["steps"])
    with np.load(out / "fresh.npz") as fresh:
        assert fresh["after_severity"].shape == (_SMALL.fresh,)
    for name in ("exceedance", "by_mass", "search"):
        assert shows_data(out / f"{name}.png")
    assert report_pages.read(out / "report.html").pictures == 4
    assert configure(report_pages.arguments(out / "report.html", "robust_design")) == outcome.config
    assert (out / "fence.dxf").exists()
    again = main(_with(out=out, plots=False), quiet=True)
    np.testing.assert_array_equal(again.after, outcome.after)
    content = json.loads((out / "robust.json").read_text())
    assert content["recalled"] == len(outcome.found.steps)


def test_stochastic_descent_and_its_resumption(small, tmp_path):
    config = _with(out=tmp_path, method="stochastic", plots=False)
    once = main(config, quiet=True)
    assert len(once.found.steps) == 3
    lines = (tmp_path / "evaluations.jsonl").read_text().splitlines(keepends=True)
    (tmp_path / "evaluations.jsonl").write_text("".join(lines[:-1]))
    again = main(config, quiet=True)
    np.testing.assert_allclose(again.after, once.after, rtol=1e-12)
    assert json.loads((tmp_path / "robust.json").read_text())["recalled"] == 2


def test_flags():
    assert configure([]) == RobustConfig()
    config = configure(["--mass", "1", "5", "--measure", "worst", "--quick"])
    assert config.mass == (1.0, 5.0)
    assert config.sample == 96
    for changes, message in (
        (dict(level=1.0), "`level`"), (dict(mass=(0.0, 1.0)), "`mass`"),
        (dict(measure="median"), "`measure` must be one of"), (dict(fresh=3), "`fresh`"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=message):
            RobustConfig(**changes)
