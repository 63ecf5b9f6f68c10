"""The reproduction of the paper in its quick version, run once."""

import dataclasses
import json
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
import report_pages
from jobs.notebooks import FOLDER, assert_labelled, run
from pictures import numbers_first, shows_data

import fencejax as fj
from optimize import reproduce_paper
from optimize.reproduce_paper import job, main, maps, statements, tables
from optimize.reproduce_paper.case import lane
from optimize.reproduce_paper.configuration import PaperConfig
from optimize.reproduce_paper.cycle import first_and_last
from optimize.reproduce_paper.open_numbers import VARIANTS

_FAST = fj.Fidelity.fast()


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    out = tmp_path_factory.mktemp("paper")
    with numbers_first(job):
        return main(PaperConfig(out=out).quick(), quiet=True), out


def finding(findings, key):
    (found,) = [one for one in findings if one.key == key]
    return found


def test_whole_sort_is_the_impact_on_record(quick):
    outcome, _ = quick
    # At R = 1.08 m an independent version gave N_stiff / N = 3.05 and 0.077 m (two-link). The fast
    # fidelity is meant to be within 1 %.
    ratio = outcome.stiff.peak / outcome.impact.peak_force
    assert ratio[0] == pytest.approx(3.05, rel=0.01)
    assert outcome.impact.tip_deflection[0] == pytest.approx(0.077, rel=0.01)
    # 2 sin 0.30 + 1.2 x 1.523 = 2.42 m/s, the paper's speed, is that of the tip.
    assert outcome.stiff.tip_speed == pytest.approx([2.42, 2.42], abs=0.005)
    assert outcome.stiff.speed == pytest.approx([2.236, 2.236], abs=0.002)


def test_parcel_rides_into_the_first_touch(quick):
    outcome, _ = quick
    for index in range(2):
        one = lane(outcome.impact, index)
        first, _ = first_and_last(one)
        drive = fj.HarmonicDrive()
        # Within two steps of 0.5 ms of the instant at which the drive is at 0.30 rad; till then the
        # parcel has moved with the belt alone.
        assert one.time[first] == pytest.approx(float(drive.time_at(0.30)), abs=1e-3)
        ridden = one.x[first - 2] - one.x[0]
        assert ridden == pytest.approx(2.0 * one.time[first - 2], abs=1e-9)
        assert np.ptp(one.y[: first - 1]) < 1e-9


def test_slide_is_the_one_on_record(quick):
    outcome, _ = quick
    # Computed at finer steps: 270.5 N and 260.5 N, and y = 0.90 m at the end. The fast fidelity
    # smooths friction over 0.02 m/s, the parcel slides along the fence as slowly for a while.
    assert outcome.slide.peak_force == pytest.approx([270.5, 260.5], rel=0.02)
    assert outcome.slide.y[:, -1] == pytest.approx([0.90, 0.90], abs=0.02)


def test_undeformable_fence(quick):
    outcome, _ = quick
    # A rigid fence strikes as hard as a rigid obstacle but for what belt, friction and the swing
    # add, which are an order below; in the slide flexibility hardly matters.
    assert 1.0 < outcome.rigid.peak_force[0] / outcome.stiff.peak[0] < 1.1
    assert outcome.rigid.tip_deflection == pytest.approx([0.0, 0.0], abs=1e-6)
    assert outcome.rigid.peak_force[1] == pytest.approx(outcome.slide.peak_force[0], rel=0.01)


def test_every_statement_is_judged_and_explained(quick):
    outcome, _ = quick
    keys = [found.key for found in outcome.findings]
    assert len(set(keys)) == 17
    assert keys[: len(statements.STATEMENTS)] == [found.key for found in outcome.coarse]
    verdicts = {found.key: found.verdict for found in outcome.findings}
    contradicted = [key for key, verdict in verdicts.items() if verdict == "no"]
    assert contradicted == ["free end", "rigid third", "paths"]
    partly = [key for key, verdict in verdicts.items() if verdict == "partly"]
    assert partly == ["mass", "joint", "fall"]
    assert outcome.agrees
    surprised = [dataclasses.replace(found, contradicted=False) for found in outcome.findings]
    assert not dataclasses.replace(outcome, findings=surprised).agrees
    table = tables.statement_table(outcome.findings)
    assert table.count("why:") == 6
    assert all(found.says.split()[0] in table for found in outcome.findings)
    assert max(len(line) for line in table.splitlines()) <= 100


def test_numbers_of_the_statements(quick):
    outcome, _ = quick
    found = {one.key: one for one in outcome.findings}
    # The steps are 0.5 ms.
    assert found["static"].main == pytest.approx(3.0, abs=0.5)
    assert found["alike, impact"].main == pytest.approx(4.8, abs=0.5)
    assert found["alike, slide"].main == pytest.approx(3.8, abs=1.0)
    assert found["ends, impact"].main == pytest.approx(0.74, abs=0.01)
    # Of the largest forces along the fences, and of the coast after the impact.
    assert found["free end"].main == pytest.approx(0.6, abs=0.15)
    assert found["rigid third"].main == pytest.approx(42, abs=5)
    assert found["paths"].main == pytest.approx(82, abs=8)
    assert found["restitution"].main == pytest.approx(0.45, abs=0.02)
    assert found["fall"].main == pytest.approx(2.24, abs=0.01)
    joint = found["joint"].numbers
    assert joint["largest loss at R"] == pytest.approx(0.60, abs=0.1)
    largest = joint["largest loss against the one-link fence"]
    assert joint["loss at the outermost R"] < 0.5 * largest


def test_open_numbers_move_what_they_should(quick):
    outcome, _ = quick
    assert len(outcome.variants) == len(VARIANTS)
    by = {f"{v.title}: {v.label}": found for v, found in outcome.variants}
    base = outcome.coarse

    def main_of(findings, key):
        return finding(findings, key).main

    # Nearer to the hinge and stiffer: less of a drop. Less damping: more ringing left.
    assert main_of(by["R_s: 1.00 m"], "drop") < main_of(base, "drop") - 0.5
    assert main_of(by["Young's modulus: 3.4 GPa"], "drop") < main_of(base, "drop")
    assert main_of(by["damping ratio: 0.02"], "ringing") > 5 * main_of(base, "ringing")
    # The slide does not know where the impact takes place, nor the impact where the slide starts.
    assert main_of(by["R_s: 1.00 m"], "smooth") == pytest.approx(main_of(base, "smooth"), rel=1e-6)
    assert main_of(by["front, slide: 0.2 m"], "tip") == pytest.approx(
        main_of(base, "tip"), rel=1e-6
    )
    changed = tables.changes(base, by["R_s: 1.00 m"])
    assert changed["drop"] == ("yes", "partly")
    text = tables.dependence_table(base, outcome.variants)
    assert 'R_s: 1.00 m: "drop" turns from yes to partly' in text
    # Each statement whose verdict changes is explained once.
    moved = {key for _, found in outcome.variants for key in tables.changes(base, found)}
    assert text.count('why, "') == len(moved) > 0


@eqx.filter_jit
def impact(fence, mass, distance, fidelity=_FAST):
    """Peak force [N] and tip deflection [m] of the library's own oblique impact."""
    scene = fj.scenes.oblique_impact(
        fence=fence,
        parcel=fj.Parcel(mass=mass),
        distance=distance,
        drive_angle=0.30,
        duration=maps.DURATION,
    )
    result = fj.simulate(scene, fidelity=fidelity, history=False)
    return result.peak_force, result.tip_deflection


def test_maps_are_single_impacts(quick):
    outcome, _ = quick
    drawn = outcome.maps
    assert drawn.force.shape == (2, 10, 10)
    assert sum(drawn.counts().values()) == drawn.force.size
    assert drawn.counts()["PEAK_AT_TIP"] > 0
    for i, j in ((4, 6), (9, 2)):
        force, tip = impact(
            fj.Fence.one_link(), jnp.asarray(drawn.masses[i]), jnp.asarray(drawn.distances[j])
        )
        # A batch rounds differently; a step more or less counts for less than their tolerance.
        assert drawn.force[1, i, j] == pytest.approx(float(force), rel=_FAST.step_tolerance)
        assert drawn.tip[1, i, j] == pytest.approx(float(tip), rel=_FAST.step_tolerance)


def test_sensitivities_are_differences(quick):
    outcome, _ = quick
    found = outcome.sensitivities
    at = int(np.argmin(np.abs(found.distances - 1.0)))
    place, mass, width = jnp.asarray(found.distances[at]), jnp.asarray(15.0), 1e-2

    def force(fence, values):
        thickness, ratio, *material = (jnp.asarray(value) for value in values)
        flexible = fence.reach / (1 + ratio)
        varied = fj.Fence(
            rigid_length=ratio * flexible,
            flexible_length=flexible,
            width=fence.width,
            thickness=thickness,
            material=fj.Material(*material),
        )
        # Fixed steps: one step more between two ends is a jump, which a difference would count.
        steady = _FAST.replace(step_tolerance=None)
        return float(impact(varied, mass, place, steady)[0])

    for index, fence in enumerate((fj.Fence(), fj.Fence.one_link())):
        material = fence.material
        values = np.array([
            float(fence.thickness), float(fence.rigid_length / fence.flexible_length),
            float(material.youngs_modulus), float(material.density), float(material.damping_ratio),
        ])  # fmt: skip
        unmoved = force(fence, values)
        assert found.force[index, at] == pytest.approx(unmoved, rel=_FAST.step_tolerance)
        for number, value in enumerate(values):
            ratio = number == 1
            step = width if ratio else width * value
            # A ratio of 0 cannot be lowered: a difference to one side, of the first order.
            ends = {0.0: unmoved} if ratio and value == 0 else {}
            for shift in (-step, step)[len(ends) :]:
                moved = values.copy()
                moved[number] += shift
                ends[shift] = force(fence, moved)
            (low, below), (high, above) = ends.items()
            slope = (above - below) / (high - low) * (1.0 if ratio else value) / unmoved
            # The slopes are off by shares of a per cent at `fast`, the differences by the square of
            # their width.
            assert found.slope[index, at, number] == pytest.approx(slope, rel=1e-2, abs=2e-2)


def test_notebook_of_the_validation(quick, lenient, monkeypatch):
    """It shows what the quick job found: the job that ran above."""
    outcome, _ = quick

    def found(config, quiet):
        assert dataclasses.replace(config, out=Path(), plots=True) == PaperConfig(Path()).quick()
        return outcome

    monkeypatch.setattr(reproduce_paper, "main", found)
    names, shown = run(FOLDER / "validation.ipynb")
    assert_labelled(shown)
    # At the default settings N_stiff / N_max is 3.05: the open numbers move it either way.
    assert names["values"].min() < 3.05 < names["values"].max()


def test_files(quick):
    outcome, out = quick
    for name in (
        "figure_08_impact", "figure_09_force", "figure_10_tip", "figure_11_slide", "sensitivities",
    ):  # fmt: skip
        assert shows_data(out / f"{name}.png")
    assert report_pages.read(out / "report.html").pictures == 5
    page = report_pages.text(out / "report.html")
    assert all(" ".join(finding.says.split()) in page for finding in outcome.findings)
    content = json.loads((out / "result.json").read_text())
    assert content["agrees"] is True
    assert len(content["statements"]) == 17
    assert np.shape(content["maps"]["force"]) == (2, 10, 10)
    assert np.shape(content["sensitivities"]["slope"]) == (2, 8, 5)
    assert [v["number"] for v in content["open_numbers"]["variants"]] == [v.title for v in VARIANTS]
    assert content["impact"]["two-link"]["point_2"]["y"] > statements.BELT_WIDTH
    assert content["elapsed"]["total"] >= sum(
        seconds for part, seconds in content["elapsed"].items() if part != "total"
    ) - 1e-6  # fmt: skip
    assert outcome.elapsed["total"] > 0
