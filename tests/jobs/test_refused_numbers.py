"""Impossible numbers for a job are refused before anything is compiled or written."""

import importlib

import pytest

REFUSED = [
    ("peak_force", ["--masses", "10", "-3"], r"`masses` must be above 0 \[kg\], but is -3"),
    ("peak_force", ["--sort-masses", "0"], r"`sort_masses` must be above 0 \[kg\], but is 0"),
    ("peak_force", ["--tip-limit", "-0.08"], r"`tip_limit` must be above 0 \[m\], but is -0.08"),
    ("peak_force", ["--stress-limit", "0"], r"`stress_limit` must be above 0 \[Pa\]"),
    ("peak_force", ["--tip-clearance", "0"], r"`tip_clearance` must be above 0 \[m\]"),
    ("peak_force", ["--distances", "-1"], r"`distances` must be at least 0 \[m\]"),
    ("peak_force", ["--duration", "0"], r"`duration` must be above 0 \[s\]"),
    ("peak_force", ["--crossing", "nan"], r"`crossing` must be finite \[m\], but is nan"),
    ("peak_force", ["--reserve", "-1"], r"`reserve` must be at least 0 \[1\]"),
    ("peak_force", ["--penalty", "0"], r"`penalty` must be above 0 \[1\]"),
    ("pareto", ["--masses", "-3"], r"`masses` must be above 0 \[kg\], but is -3"),
    ("pareto", ["--offsets", "-0.1"], r"`offsets` must be at least 0 \[m\]"),
    ("pareto", ["--tip-limit", "0"], r"`tip_limit` must be above 0 \[m\]"),
    ("pareto", ["--agreement", "-1"], r"`agreement` must be above 0 \[1\]"),
    ("co_design", ["--masses", "-3"], r"`masses` must be above 0 \[kg\], but is -3"),
    ("co_design", ["--offsets", "-0.1"], r"`offsets` must be at least 0 \[m\]"),
    ("co_design", ["--tolerance", "0"], r"`tolerance` must be above 0 \[1\]"),
    ("robust_design", ["--mass", "-1", "3"], r"`mass` must be above 0 \[kg\], but is -1"),
    ("robust_design", ["--mass", "3", "1"], "`mass` must be two numbers, the second at least"),
    ("robust_design", ["--tip-limit", "-1"], r"`tip_limit` must be above 0 \[m\]"),
    ("robust_design", ["--belt-friction", "-1", "1"], r"`belt_friction` must be at least 0 \[1\]"),
    ("robust_design", ["--rate", "inf"], r"`rate` must be finite \[1\], but is inf"),
    ("robust_design", ["--seed", "-1"], r"`seed` must be at least 0 \[1\]"),
    ("design", ["--reserve", "-0.1"], r"`reserve` must be at least 0 \[1\]"),
    ("concepts", ["--rates", "-2400"], r"`rates` must be above 0 \[1/h\], but is -2400"),
    ("sweep", ["--duration", "-1"], r"`duration` must be at least 0 \[s\]"),
    ("sweep", ["--seed", "-1"], r"`seed` must be at least 0 \[1\]"),
    ("reproduce_paper", ["--distance", "-1"], r"`distance` must be at least 0 \[m\]"),
    (
        "identify", ["--demo", "--noise", "force=0"],
        r"`noise` must hold standard deviations above 0, but that of force is 0 \[N\]",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("job", "given", "message"), REFUSED)
def test_a_number_out_of_its_bound_is_refused_as_it_is_given(job, given, message):
    configure = importlib.import_module(f"optimize.{job}.configuration").configure
    with pytest.raises(ValueError, match=message):
        configure(given)


@pytest.mark.parametrize(
    ("job", "given", "message"),
    [
        (
            "peak_force", ["--distances", "0.9", "1.5"],
            r"10 kg at R = 1.5 m: Argument `distance` must be at most 1.2 \[m\], but is 1.5",
        ),
        ("peak_force", ["--drive-angle", "0.9"], r"`drive_angle` must be at most 0.66\d* \[rad\]"),
        ("pareto", ["--distances", "1.5"], "`distance` must be at most 1.2, .* but is 1.5"),
        (
            "robust_design", ["--scenes", "impacts", "--distance", "0.8", "1.5"],
            "distance 1.5 m.*`distance` must be at most 1.2, .* but is 1.5",
        ),
        ("co_design", ["--front", "1e13"], r"`front` must be 0 ... 1e\+12 \[m\] in size"),
    ],
)  # fmt: skip
def test_what_the_machine_does_not_reach_is_refused_before_a_search(job, given, message, tmp_path):
    module = importlib.import_module(f"optimize.{job}.configuration")
    main = importlib.import_module(f"optimize.{job}").main
    with pytest.raises(ValueError, match=message):
        main(module.configure([*given, "--out", str(tmp_path / "out")]), quiet=True)
    # Nothing was written, and nothing simulated that would have been.
    assert not (tmp_path / "out").exists()
