"""The search without constants: what it leaves out, keeps and shows."""

import json

import figures
import pytest
from robustness import ablation, search, thresholds

from fencejax.results import diagnostics, hold, rivals

_FOUND = search.Found(0.5, [0.01, 0.02], {"fence.E": 1e9}, 1e-4, 0)


@pytest.mark.parametrize(
    ("constant", "home"), [("_EDGE", hold), ("_IN_DOUBT", rivals), ("_RINGING", diagnostics)]
)
def test_a_constant_is_left_out_only_meanwhile(constant, home):
    usual = getattr(home, constant)
    with thresholds.left_out([constant]):
        changed = getattr(home, constant) / usual
        assert not 1e-6 < changed < 1e6
    assert getattr(home, constant) == usual


@pytest.mark.parametrize(("worst", "broken"), [(0.02, False), (0.03, True)])
def test_findings_are_kept_and_shown(worst, broken, monkeypatch, tmp_path):
    """2.5 per cent of the force is promised at `standard`."""
    left_out = []

    def searched(*arguments, **options):
        left_out.append(diagnostics._HELD)
        arguments[8](_FOUND._replace(course=[0.01, worst]))

    usual = diagnostics._HELD
    monkeypatch.setattr(search, "search", searched)
    kept = {}
    ablation.found_without(
        ["_HELD"], "impact", "value", "standard", 64, 1, 0, lambda found, text: kept.update(found)
    )
    assert left_out[0] > usual
    assert kept["broken"] is broken
    assert kept["error, found"] == worst
    path, tables = tmp_path / "found.json", []
    path.write_text(json.dumps({"_HELD | impact | value | standard": kept}))
    monkeypatch.setattr(figures, "write", tables.append)
    ablation._table(path)
    verdict = "**broken**" if broken else "kept"
    shown = tables[0]["ablation"]
    assert shown["columns"] == ["without", "value, `standard`"]
    row = shown["rows"]["`_HELD`, impact"]
    assert row["values"] == [f"{100 * worst:g} % of 128, {verdict}"]
