"""The main job in a small version: the force falls, the limits hold, the reference agrees."""

import dataclasses
import json
import types

import jax.numpy as jnp
import numpy as np
import pytest
import report_pages
from pictures import numbers_first, shows_data

import fencejax as fj
from fencejax import plot
from fencejax.design import Stop, fatigue
from optimize.common import nearby, report
from optimize.common.encounters import Encounter
from optimize.peak_force import impacts as batch, job, main
from optimize.peak_force.configuration import PeakForceConfig, configure

_SMALL = PeakForceConfig(
    distances=(0.9, 1.0),
    masses=(20.0,),
    duration=0.15,
    variables=("thickness", "length_ratio"),
    fidelity="fast",
    reserve=0.01,
    sort_masses=(),
)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    out = tmp_path_factory.mktemp("small")
    with numbers_first(job):
        return main(PeakForceConfig(**{**vars(_SMALL), "out": out})), out


def test_peak_force_falls_within_the_limits(small):
    outcome, _ = small
    before = np.max(outcome.measured["before"]["peak_force"])
    after = np.max(outcome.measured["after"]["peak_force"])
    assert after < 0.95 * before
    assert outcome.optimum.converged
    assert outcome.optimum.feasible
    assert max(outcome.optimum.residual[:2]) <= _SMALL.tolerance
    # At the reference fidelity the limits themselves hold: the reserve covers the difference.
    for limit in _SMALL.limits:
        assert np.min(limit.margin_of(outcome.measured["after"][limit.name])) >= 0
    assert outcome.succeeded


def test_reference_confirms_the_force(small):
    outcome, _ = small
    # fast is meant to be within 1 % of the peak force.
    found, after = outcome.measured["found"], outcome.measured["after"]
    np.testing.assert_allclose(found["peak_force"], after["peak_force"], rtol=1e-2)
    np.testing.assert_allclose(found["tip_deflection"], after["tip_deflection"], rtol=1e-2)
    assert outcome.confirmed


def test_tip_limit_is_what_holds_the_force_up(small):
    outcome, _ = small
    multipliers = outcome.optimum.multipliers.reshape(len(_SMALL.limits), -1)
    assert np.max(multipliers[0]) > 0.1
    # The quadratic programs are solved to 1e-7 of their largest number, here of order 1.
    np.testing.assert_allclose(multipliers[1:], 0, atol=1e-6)


def test_papers_fences_stand_beside_the_optimum(small):
    outcome, out = small
    rows = json.loads((out / "result.json").read_text())["side_by_side"]
    assert list(rows) == ["two-link", "one-link", "optimum"]
    assert rows["one-link"]["thickness"] == 0.073
    assert rows["one-link"]["rigid_length"] == 0
    assert rows["two-link"]["rigid_length"] == 0.45
    # rho z h_1 (l_s + l_p 2/3): the mean of a constant-strength taper is 2/3, the root of the
    # distance from the tip.
    for fence in ("two-link", "one-link"):
        row = rows[fence]
        length = row["rigid_length"] + row["flexible_length"] * 2 / 3
        mass = 1130 * 0.132 * row["thickness"] * length
        assert row["fence_mass"] == pytest.approx(mass, rel=1e-6)
    # Each of them is the impact alone, run by itself at the same fidelity.
    scene = fj.scenes.oblique_impact(
        fence=fj.Fence.one_link(), distance=0.9, parcel=fj.Parcel(mass=20.0), duration=0.15
    )
    alone = fj.simulate(scene, fidelity=fj.Fidelity.reference(), only=("peak_force",))
    together = outcome.measured["one_link"]["peak_force"]
    np.testing.assert_allclose(together[0], alone.peak_force, rtol=1e-6)
    assert rows["one-link"]["peak_force"] == np.max(together)
    assert rows["optimum"]["peak_force"] < rows["two-link"]["peak_force"]


def test_files(small):
    outcome, out = small
    result = json.loads((out / "result.json").read_text())
    history = json.loads((out / "history.json").read_text())
    assert result["feasible"] is True
    assert result["design"]["before"] == {"thickness": 0.045, "length_ratio": 0.6}
    assert len(history) == len(outcome.optimum.history)
    for name in ("force", "tip_deflection", "convergence", "gradient"):
        assert shows_data(out / f"{name}.png")
    page = out / "report.html"
    # The four figures and the drawing.
    assert report_pages.read(page).pictures == 5
    assert {"What decides", "Tolerances"} <= set(report_pages.read(page).headings)
    assert "rigid obstacle's force over it" in report_pages.text(page)
    assert "Result for this machine: " in report_pages.text(page)
    assert configure(report_pages.arguments(page, "peak_force")) == PeakForceConfig(
        **{**vars(_SMALL), "out": out}
    )
    assert (out / "fence.dxf").exists()


def test_prices_and_tolerances_are_the_gradients(small):
    outcome, _ = small
    optimum, lanes = outcome.optimum, optimum_lanes(outcome)
    rows = [nearby.Rows.of(limit, lanes) for limit in outcome.limits]
    (prices,) = nearby.price_parts(outcome.space, optimum, rows, "N")
    assert [row[0] for row in prices.rows][0] == "tip deflection"
    # By the multipliers: what a tenth more of the bound is worth.
    rates = optimum.multipliers[:lanes] * optimum.scale
    assert prices.rows[0][3] == f"{0.1 * np.sum(rates):.3g} N less"
    table, *_ = nearby.tolerance_parts(outcome.space, optimum, rows, "N", _SMALL.reserve)
    step = np.array([np.log(1.05) / np.log(9), 0.0])
    exact = np.max(optimum.objectives + optimum.scale * optimum.last.objective_rows @ step)
    assert table.rows[1][:4] == [
        "thickness", table.rows[0][1], "+5 %", f"{100 * (exact / optimum.objective - 1):+.1f} %",
    ]  # fmt: skip


def test_room_until_a_limit_is_used_up(small):
    assert [nearby.room_text(room) for room in (0.0, 1e-12, 0.5, 19.0, 21.0)] == [
        "< 0.01 %", "< 0.01 %", "2.5 %", "95 %", "> 100 %",
    ]  # fmt: skip
    outcome, _ = small
    rows = [nearby.Rows.of(limit, optimum_lanes(outcome)) for limit in outcome.limits]
    room = "may be off by so much"
    table, *_ = nearby.tolerance_parts(outcome.space, outcome.optimum, rows, "N", 0.0)
    assert table.titles[-1] == room
    # A design that breaks a limit has no room in any number.
    last = dataclasses.replace(outcome.optimum.last, margins=outcome.optimum.last.margins - 0.2)
    broken = dataclasses.replace(outcome.optimum, last=last, feasible=False)
    table, *_ = nearby.tolerance_parts(outcome.space, broken, rows, "N", 0.0)
    assert room not in table.titles
    assert all(len(row) == len(table.titles) for row in table.rows)
    assert room not in table.note


def optimum_lanes(outcome):
    return outcome.measured["after"]["peak_force"].size


def test_a_bound_on_the_life_is_computed_before_the_checks_are_traced(monkeypatch):
    config = configure(["--sorter", "paper", "--set", "limits.life=1e6", "--sort-masses"])
    seen = []
    monkeypatch.setattr(
        batch, "measure", lambda *parts, **rest: (seen.append(parts[3]), jnp.zeros(()))[1]
    )
    impacts = batch.Impacts(
        config.distances, config.masses, config.drive_angle, config.duration, config.machine
    )
    checks = job._Checks(config, config.space, impacts)
    # An error of the tracing appears here.
    checks._impacts.result()
    bounds = {limit.name: limit.bound for limit in seen[0]}
    sheet = config.machine.materials[0]
    wanted = fatigue.amplitude_for(1e6, sheet.fatigue_strength, fatigue.exponent_of(sheet.material))
    assert bounds["fatigue_stress"] == pytest.approx(float(wanted))


def test_no_feasible_design(tmp_path, capsys):
    # The program of `small`, whose bounds are data.
    changes = dict(out=tmp_path, tip_limit=0.001, reference=False, plots=False)
    outcome = main(PeakForceConfig(**{**vars(_SMALL), **changes}))
    assert outcome.optimum.stop is Stop.INFEASIBLE
    assert not outcome.succeeded
    least = min(record.violation for record in outcome.optimum.history)
    assert outcome.optimum.residual.violation == least
    printed = capsys.readouterr().out
    assert "no feasible design found" in printed
    assert "least-violating" in printed
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["feasible"] is False


def test_flags():
    assert configure([]) == PeakForceConfig()
    config = configure([
        "--tip-limit", "0.05", "--masses", "10", "--sort-masses", "--no-plots",
        "--free", "thickness=0.02:0.08",
    ])  # fmt: skip
    assert config.tip_limit == 0.05
    assert config.masses == (10.0,)
    assert config.sort_masses == ()
    assert not config.plots
    assert config.space.names == PeakForceConfig().space.names
    thickness = config.space.variables[0]
    assert (thickness.lower, thickness.upper) == (0.02, 0.08)
    near_tip = configure(["--worst-case", "--budget", "7"])
    assert (near_tip.distances, near_tip.masses, near_tip.budget) == ((1.08,), (15.0,), 7)


def test_help_names_every_default(capsys):
    with pytest.raises(SystemExit) as leaving:
        configure(["--help"])
    assert leaving.value.code == 0
    assert capsys.readouterr().out.count("(default:") == len(vars(PeakForceConfig())) + 2


def test_what_is_freed_is_designed():
    # By any of its names, and beside the job's own variables.
    config = configure(["--free", "fence.thickness=20 mm:80 mm", "density=1000:1.2 g/cm^3"])
    own = PeakForceConfig().space.names
    assert config.space.names == ("fence.thickness", *own[1:], "density")
    spans = {v.name: (v.lower, v.upper) for v in config.space.variables}
    assert spans["fence.thickness"] == pytest.approx((0.02, 0.08))
    assert spans["density"] == pytest.approx((1000.0, 1200.0))
    with pytest.raises(ValueError, match="`free` must hold each name once"):
        assert PeakForceConfig(free=("density",)).space
    with pytest.raises(ValueError, match="thickness"):
        assert PeakForceConfig(free=("thickness=0.08:0.02",)).space


def test_a_start_that_cannot_be_evaluated_is_reported_lane_by_lane():
    encounters = Encounter.grid(offset=(0.05, 0.2), mass=(2.0, 30.0))
    statuses = np.array([fj.Status.SUCCESSFUL, fj.Status.LARGE_DEFLECTION,
                         fj.Status.STEP_TOO_COARSE, fj.Status.LARGE_DEFLECTION])  # fmt: skip
    lines = report.failed_start(encounters.text, statuses).splitlines()
    assert "cannot be evaluated" in lines[0]
    meaning = fj.Status.LARGE_DEFLECTION.text
    assert lines[1] == f"  30 kg, offset 50 mm; 30 kg, offset 200 mm: LARGE_DEFLECTION, {meaning}"
    # What is in numerical doubt is no reason.
    assert len(lines) == 3
    assert "--set" in lines[2]


def test_trace_without_history_is_refused():
    with pytest.raises(ValueError, match="holds none"):
        plot.Trace.of(types.SimpleNamespace(history=None))


def test_axes_are_labelled_with_units():
    trace = plot.Trace(jnp.arange(3.0), jnp.array([0.0, 5.0, 1.0]), jnp.zeros(3))
    force = plot.force({"before": trace, "after": trace}, stiff_force=9.0)
    assert force.get_ylabel() == "reaction force N [N]"
    assert [text.get_text() for text in force.get_legend().get_texts()] == [
        "before", "after", "rigid obstacle",
    ]  # fmt: skip
    assert plot.tip_deflection(trace, limit=0.08).get_ylabel() == "tip deflection [mm]"
    bars = plot.gradient_bars({"peak_force": {"thickness": 1.0, "density": -0.1}})
    assert "[1]" in bars.get_xlabel()
