"""Parameters found again from synthetic recordings, and files that cannot be used."""

import dataclasses

import numpy as np
import pytest
from scipy import stats

import fencejax as fj
from fencejax.scenes import numbers as scene_numbers
from fencejax.study import (
    Experiment,
    Recording,
    align,
    fit,
    identify,
)

_TRUTH = {"youngs_modulus": 2.6e9, "stiffness": 1.2e9, "damping": 4.0e5}
_NAMES = tuple(_TRUTH)
_TIME = np.linspace(0.0, 0.05, 101)[1:]
_NOISE = {"force": 25.0, "tip_deflection": 5e-4}


def impact(**numbers):
    """A normal impact: the cheapest scene with all that is looked for here."""
    parcel = fj.Parcel(**{k: v for k, v in numbers.items() if k != "youngs_modulus"})
    fence = fj.Fence(material=fj.Material(numbers.get("youngs_modulus", 3.0e9)))
    return fj.scenes.normal_impact(fence=fence, parcel=parcel, duration=0.05)


def clean(scene, time=_TIME):
    history = fj.simulate(scene, only=("history",)).history.at(time)
    return {
        "force": np.asarray(history.fence_force),
        "tip_deflection": np.asarray(history.tip_deflection),
    }


@pytest.fixture(scope="module")
def truth():
    return clean(impact(**_TRUTH))


def noisy(signals, seed, share=1.0):
    generator = np.random.default_rng(seed)
    return Recording(
        _TIME,
        {
            name: column + share * _NOISE[name] * generator.normal(size=column.size)
            for name, column in signals.items()
        },
    )


def test_what_is_in_doubt_is_fitted_finer():
    # Steps of 4 ms are too long for a blow of 20 ms: its force is that of other parameters.
    given = Experiment(impact(), Recording(_TIME, clean(impact(stiffness=1.2e9))))
    coarse = fj.Fidelity.coarse(step=4e-3, step_tolerance=None)
    plain = fit(given, ["stiffness"], fidelity=coarse, refine=False)
    assert plain.rung == 0
    assert any("step" in warning for warning in plain.warnings)
    found = fit(given, ["stiffness"], fidelity=coarse)
    assert found.rung > 0
    assert found.evaluations > plain.evaluations
    assert not any("step" in warning for warning in found.warnings)
    misses = [abs(each.values[0] / 1.2e9 - 1) for each in (plain, found)]
    assert misses[1] < min(0.01, 0.1 * misses[0])


def test_without_noise_the_truth_comes_back(truth):
    found = fit(Experiment(impact(), Recording(_TIME, truth)), _NAMES)
    assert found.converged
    # The derivatives are exact here, so that the search ends where rounding does: the relative
    # change that it stops at is 1e-9, and Gauss and Newton's method is quadratic there.
    assert found.values == pytest.approx(list(_TRUTH.values()), rel=1e-6)
    assert found.start == pytest.approx([3.0e9, 1.72e9, 3.3e5], rel=1e-12)
    assert max(found.standard_errors) < 1e-6
    assert found.fitted[0][0] == pytest.approx(truth["force"], abs=1e-3)


@pytest.fixture(scope="module")
def many(truth):
    return [fit(Experiment(impact(), noisy(truth, seed)), _NAMES) for seed in range(40)]


def test_intervals_cover_the_truth(many):
    exact = np.array(list(_TRUTH.values()))
    inside = np.array([(f.low <= exact) & (exact <= f.high) for f in many])
    # 120 intervals of 95 %, 40 of them independent: binomial, once in a thousand further out.
    low, high = stats.binom.ppf([5e-4, 1 - 5e-4], 40, 0.95)
    assert np.all(low <= np.sum(inside, axis=0))
    assert np.all(np.sum(inside, axis=0) <= high)
    # Deviations in the metric of the covariance: chi-squared of three times forty.
    total = 0.0
    for f in many:
        z = np.log(f.values / exact) / f.standard_errors
        total += z @ np.linalg.solve(f.correlation, z)
    low, high = stats.chi2.ppf([5e-4, 1 - 5e-4], 120)
    assert low < total < high


def test_noise_is_estimated(many):
    # Each of 40 estimates from some 100 rows: the mean is within three of its errors,
    # 3 / sqrt(2 100 40).
    for name, sigma in _NOISE.items():
        mean = np.mean([f.noise[name] for f in many])
        assert mean == pytest.approx(sigma, rel=3 / np.sqrt(2 * 100 * 40))
    # Noise does not follow itself: the limit is three errors of it.
    assert sum(any("follow" in w for w in f.warnings) for f in many) <= 2


def test_errors_grow_with_the_noise(truth):
    small, large = (
        fit(Experiment(impact(), noisy(truth, 3, share)), _NAMES) for share in (0.1, 1.0)
    )
    ratio = large.standard_errors / small.standard_errors
    # The same noise ten times larger: ten times the errors, as far as the problem is linear.
    assert ratio == pytest.approx(10.0, rel=0.1)
    assert large.correlation == pytest.approx(large.correlation.T)
    assert np.diag(large.correlation) == pytest.approx(1.0)


def test_two_recordings_tell_more_than_one(truth):
    one = Experiment(impact(), noisy(truth, 5))
    found = fit([one, Experiment(impact(), noisy(truth, 6))], _NAMES, noise=_NOISE)
    alone = fit(one, _NAMES, noise=_NOISE)
    # Twice the rows at the same setting: errors smaller by sqrt(2), up to what the two samples of
    # noise make of s, of 200 and 400 rows.
    ratio = alone.standard_errors / found.standard_errors
    assert ratio == pytest.approx(np.sqrt(2), rel=0.2)
    assert len(found.fitted) == 2


def test_several_starts_end_at_the_same(truth):
    found = fit(Experiment(impact(), noisy(truth, 7)), _NAMES, starts=3, seed=2)
    assert len(found.costs) == 3
    assert found.costs[0] == pytest.approx(min(found.costs), rel=1e-2)
    lone = fit(Experiment(impact(), noisy(truth, 7)), _NAMES)
    assert found.values == pytest.approx(lone.values, rel=1e-4)


def test_offset_of_the_clock():
    scene = impact(**_TRUTH)
    hidden = 3.1e-3
    time = np.linspace(0.0, 0.04, 100)
    signals = clean(scene, time + hidden)
    offset = fj.DesignVariable("time_offset", -0.005, 0.005, "s", "linear")
    found = fit(Experiment(impact(), Recording(time, signals)), [*_NAMES, offset])
    # The recording itself is interpolated, as the model is: exact again.
    assert found.values[-1] == pytest.approx(hidden, abs=1e-8)
    assert found.values[:-1] == pytest.approx(list(_TRUTH.values()), rel=1e-5)


# ---- recordings by a clock of their own

_DELAY, _LENGTH = 0.0374, 0.05
_CLOCK = np.linspace(0.0, 0.12, 241)


def delayed(seed, gaps=()):
    """An impact that begins at `_DELAY` on the recording's clock, with noise, and with gaps: every
    third sample of the deflection, and what is in a span of times of both."""
    after = _CLOCK >= _DELAY
    scene = dataclasses.replace(impact(**_TRUTH), duration=0.09)
    signals = clean(scene, np.maximum(_CLOCK - _DELAY, 0.0))
    generator = np.random.default_rng(seed)
    for name, column in signals.items():
        column = np.where(after, column, 0.0) + _NOISE[name] * generator.normal(size=_CLOCK.size)
        signals[name] = column
    for start, end in gaps:
        for column in signals.values():
            column[(start <= _CLOCK) & (end > _CLOCK)] = np.nan
        signals["tip_deflection"][::3] = np.nan
    return Recording(_CLOCK, signals, "clock.csv")


def fitted(recording):
    found = align(impact(), recording, length=_LENGTH)
    assert found.offset is not None
    return found, fit(found.experiment, [*_NAMES, found.offset])


def test_the_trigger_delay_is_found_within_its_standard_error():
    deviations = []
    for seed in range(6):
        found, result = fitted(delayed(seed))
        # The scene's own numbers are off, and so is the delay that is taken to begin with.
        assert abs(found.delay - _DELAY) < found.offset.upper
        delay, error = found.delay - result.values[-1], result.standard_errors[-1]
        assert 0 < error < 1e-3
        deviations.append((delay - _DELAY) / error)
        assert result.values[:-1] == pytest.approx(list(_TRUTH.values()), rel=0.3)
    # The sum of six squared normal numbers: one time in a thousand beyond either bound.
    low, high = stats.chi2.ppf([1e-3, 1 - 1e-3], 6)
    assert low < np.sum(np.square(deviations)) < high


def test_missing_samples_do_not_count():
    whole = delayed(2)
    holed = delayed(2, gaps=[(0.045, 0.05)])
    assert holed.missing == {"force": 10, "tip_deflection": 10 + 77}
    (found, result), (_, full) = fitted(holed), fitted(whole)
    there = found.experiment.recording.present
    assert 0 < np.sum(there) < there.size
    # Degrees of freedom are of the samples that there are: the noise found is that which is there,
    # within four of its errors.
    for name, sigma in _NOISE.items():
        count = np.sum(np.isfinite(found.experiment.recording.signals[name]))
        assert result.noise[name] == pytest.approx(sigma, rel=4 / np.sqrt(2 * count))
    # Fewer samples tell less.
    assert np.all(result.standard_errors > full.standard_errors)
    assert np.abs(result.values[-1] - full.values[-1]) < 4 * result.standard_errors[-1]


def test_a_delay_that_is_given_is_taken():
    recording = delayed(0)
    found = align(impact(), recording, delay=_DELAY, length=_LENGTH)
    assert (found.delay, found.offset) == (_DELAY, None)
    used = found.experiment.recording
    assert used.time[0] >= 0
    assert used.time[-1] <= _LENGTH
    np.testing.assert_allclose(used.time + _DELAY, _CLOCK[_CLOCK >= _DELAY][: used.time.size])
    # To the recording's end, and the scene goes on as long.
    whole = align(impact(), recording, delay=_DELAY)
    assert whole.experiment.scene.duration == pytest.approx(0.12 - _DELAY)


def test_recordings_that_cannot_be_aligned_are_refused_by_their_own_cause():
    recording = delayed(0)

    def refused(**changes):
        settings = {"length": changes.pop("length", None), "delay": changes.pop("delay", None)}
        with pytest.raises(ValueError, match="clock.csv") as error:
            align(impact(), dataclasses.replace(recording, **changes), **settings)
        return str(error.value)

    signals = {name: -column for name, column in recording.signals.items()}
    assert "Change its sign" in refused(signals=signals)
    assert "Give the `delay`" in refused(signals={"y": recording.signals["force"]})
    assert "rows after the delay" in refused(delay=0.5)
    # Seconds that are milliseconds, or rows that are too far apart: both are reported with what
    # they may be.
    coarse = refused(time=1e3 * _CLOCK)
    assert "rows must be nearer to each other" in coarse
    assert "If these are milliseconds" in coarse
    long = Recording(0.002 * np.arange(4000), {"force": np.full(4000, 1.0)}, "clock.csv")
    message = refused(time=long.time, signals=long.signals, delay=0.0)
    assert "Give the `length`" in message


def test_undetermined_parameters_are_reported(truth):
    # E, the width z and rho act through E z and rho z alone; the parcel's breadth not at all.
    wanted = [
        "youngs_modulus",
        fj.DesignVariable("width", 0.05, 0.4, "m"),
        fj.DesignVariable("density", 300.0, 4000.0, "kg/m^3"),
        fj.DesignVariable("breadth", 0.2, 0.5, "m"),
    ]
    found = fit(Experiment(impact(), noisy(truth, 8)), wanted, most=20)
    assert found.standard_errors[3] == np.inf
    assert any("breadth is not determined" in w for w in found.warnings)
    # The one direction is determined only to rounding, some 1e-8 of the others.
    assert found.condition > 1e6
    assert any("hardly distinguishable" in w for w in found.warnings)
    assert found.weakest == pytest.approx(found.weakest[1] * np.array([-1, 1, -1, 0]), abs=1e-4)


def test_active_bounds_are_reported(truth):
    tight = fj.DesignVariable("youngs_modulus", 2.9e9, 3.5e9, "Pa")
    found = fit(Experiment(impact(), noisy(truth, 9)), [tight, *_NAMES[1:]])
    assert found.values[0] == pytest.approx(2.9e9, rel=1e-3)
    assert any("at its lower bound" in w for w in found.warnings)


def test_a_wrong_model_is_reported(truth):
    # The parcel weighed 15 kg; whoever fits takes it for 10 kg.
    found = fit(Experiment(impact(mass=10.0), noisy(truth, 10)), _NAMES)
    assert any("follow one another" in w for w in found.warnings)


def test_units_that_are_suspected(truth):
    def refused(time, factor):
        signals = {name: factor * column for name, column in truth.items()}
        with pytest.raises(ValueError, match="header|seconds") as error:
            fit(Experiment(impact(), Recording(time, signals, "a.csv")), _NAMES)
        return str(error.value)

    assert "if these are milliseconds" in refused(1e3 * _TIME, 1.0)
    assert "If they are not in seconds" in refused(1e-3 * _TIME, 1.0)
    assert "signal `force`" in refused(_TIME, 1e-3)
    assert "a.csv" in refused(_TIME, 1e3)


def test_arguments_that_cannot_be(truth):
    recording = Recording(_TIME, truth)
    one = Experiment(impact(), recording)
    for experiments, parameters, settings, text in (
        ([], _NAMES, {}, "at least one"),
        (one, [], {}, "parameters"),
        (one, ["mass"], {}, "bounds for 'mass'"),
        (one, ["time_offset"], {}, "alone"),
        (one, [fj.DesignVariable("mass", 20.0, 30.0, "kg")], {}, "the search starts there"),
        (one, [fj.DesignVariable("breadth", -1.0, 1.0, "m", "linear")], {}, "breadth"),
        (one, _NAMES, {"noise": {"force": 1.0}}, "lacks 'tip_deflection'"),
        (one, _NAMES, {"noise": {"force": 0.0, "tip_deflection": 1.0}}, "noise"),
        (one, _NAMES, {"confidence": 1.0}, "confidence"),
        (one, ["time_offset", "damping"], {}, "duration=0.07"),
    ):
        with pytest.raises(ValueError, match=text):
            fit(experiments, parameters, **settings)
    with pytest.raises(ValueError, match="must rise"):
        Recording(_TIME[::-1], truth)
    with pytest.raises(ValueError, match="signals must be of"):
        Recording(_TIME, {"noise": _TIME})


def test_every_parameter_is_a_number_of_some_scene():
    scene = fj.scenes.whole_sort()
    for name, variable in identify.PARAMETERS.items():
        if name != identify.OFFSET:
            assert scene_numbers.number(scene, name).unit == variable.unit
