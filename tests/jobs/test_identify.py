"""The identification's script: its demonstration, its files read again, its flags."""

import json

import numpy as np
import pytest
import report_pages
from pictures import shows_data

from optimize.identify import main
from optimize.identify.configuration import IdentifyConfig, configure


@pytest.fixture(scope="module")
def demonstration(tmp_path_factory):
    out = tmp_path_factory.mktemp("identify")
    return main(configure(["--demo", "--quick", "--out", str(out)]), quiet=True), out


def test_demonstration(demonstration):
    outcome, out = demonstration
    assert outcome.succeeded
    assert report_pages.read(out / "report.html").pictures == 2
    named = {"time_offset": "first_touch"}
    assert set(outcome.deviations) == {named.get(name, name) for name in outcome.fit.names}
    # The chance that one of six normal numbers is further away is 4e-4.
    assert max(abs(v) for v in outcome.deviations.values()) < 4
    # Force and tip deflection determine all of them, friction and material, too.
    assert np.all(outcome.fit.standard_errors < 0.2)
    content = json.loads((out / "result.json").read_text())
    assert content["parameters"]["youngs_modulus"]["unit"] == "Pa"
    assert len(content["correlation"]) == 6
    assert content["records"][0]["first_touch"]["value"] == outcome.delays[0].value
    for name in ("fit", "correlation"):
        assert shows_data(out / f"{name}.png")


def test_script_reads_what_it_wrote(demonstration, tmp_path):
    outcome, out = demonstration
    config = configure([
        "--records", str(out / "demo.csv"), "--fidelity", "fast", "--starts", "1", "--no-plots",
        "--out", str(tmp_path), "--set", "distance=1.0",
    ])  # fmt: skip
    again = main(config, quiet=True)
    assert again.fit.values == pytest.approx(outcome.fit.values, rel=1e-6)
    assert not again.deviations
    assert again.succeeded


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({}, "records"),
        ({"demo": True, "records": ("a.csv",)}, "both"),
        ({"demo": True, "scene": "normal_impact"}, "oblique_impact"),
        ({"demo": True, "starts": 0}, "starts"),
        ({"demo": True, "signals": ("load",)}, "signals"),
        ({"records": ("a", "b", "c"), "set": ("mass=1", "mass=2")}, "set"),
        ({"records": ("a", "b", "c"), "delay": ("1 ms", "2 ms")}, "delay"),
        ({"records": ("a", "b"), "delay": ("1 ms", "auto")}, "delay"),
    ],
)
def test_configurations_that_cannot_be(changes, text):
    with pytest.raises(ValueError, match=text):
        IdentifyConfig(**changes)


def test_flags_that_cannot_be(tmp_path):
    rows = "\n".join(f"{k},{100 * k}" for k in range(1, 8))
    path = tmp_path / "ms.csv"
    path.write_text(f"time,force\n{rows}\n")
    base = ["--records", str(path), "--out", str(tmp_path)]
    for extra, text in (
        ([], "milliseconds"),
        (["--parameters", "mass"], "mass=lower:upper"),
        (["--parameters", "mass=5"], "name=lower:upper"),
        (["--signals", "x"], "column `x`"),
        (["--columns", "force=Kraft"], "one column 'Kraft' for `force`"),
        (["--delay", "soon"], "`delay`"),
    ):
        with pytest.raises(ValueError, match=text):
            main(configure([*base, *extra]), quiet=True)
    config = configure([*base, "--set", "mass=heavy"])
    with pytest.raises(ValueError, match="`mass` .* with or without a unit"):
        config.numbers(0)
