"""Sweeps: outputs and gradients of all lanes, plans, the table, the script."""

import dataclasses
import json

import numpy as np
import pytest
import report_pages
from pictures import shows_data
from study.small_sweep import PLAIN, SMALL, assert_same, small, tiny

import fencejax as fj
from fencejax.study import (
    IMPOSSIBLE,
    Plan,
    SweepTable,
    lanes,
    run_sweep,
    sampling,
)
from optimize.sweep import main
from optimize.sweep.configuration import SweepConfig, configure


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The small sweep, computed at one go by this process."""
    return main(small(tmp_path_factory.mktemp("whole")), quiet=True).table


# ---- what is computed


FORCE_AND_TIP = ("peak_force", "tip_deflection")


def scene_of(numbers):
    return fj.scenes.oblique_impact(
        fence=fj.Fence(
            rigid_length=numbers["reach"] * 0.375, flexible_length=numbers["reach"] * 0.625
        ),
        parcel=fj.Parcel(mass=numbers["mass"]), distance=numbers["distance"],
        duration=SMALL.duration,
    )  # fmt: skip


def test_outputs_are_those_of_simulate(whole):
    lane = 3 * 12 + 2 * 4 + 1
    numbers = {name: column[lane] for name, column in whole.variables.items()}
    result = fj.simulate(scene_of(numbers), fidelity=fj.Fidelity.fast(), only=FORCE_AND_TIP)
    for name in FORCE_AND_TIP:
        # The same arithmetic, vectorised otherwise: round-off of some hundred steps.
        np.testing.assert_allclose(whole.outputs[name][lane], getattr(result, name), rtol=1e-11)
    assert whole.status[lane] == result.status


def test_impossible_lanes_are_counted_and_not_numbers(whole):
    beyond = whole.variables["distance"] > whole.variables["reach"]
    assert 0 < np.sum(beyond) < beyond.size
    np.testing.assert_array_equal(whole.status == IMPOSSIBLE, beyond)
    np.testing.assert_array_equal(np.isnan(whole.outputs["peak_force"]), beyond)
    assert whole.counts()["IMPOSSIBLE"] == np.sum(beyond)
    assert sum(whole.counts().values()) == beyond.size
    # The others are good, but where the parcel meets the very tip: the force ends there. So it does
    # where the heaviest one, next to the tip, has bent the fence and come there.
    at_tip = np.isclose(whole.variables["distance"], whole.variables["reach"])
    heaviest = whole.variables["mass"] == whole.variables["mass"].max()
    at_tip |= heaviest & (whole.variables["reach"] - whole.variables["distance"] < 0.101) & ~beyond
    np.testing.assert_array_equal(whole.status == fj.Status.PEAK_AT_TIP, at_tip)
    np.testing.assert_array_equal(whole.good, ~beyond & ~at_tip)


def test_lanes_in_doubt_are_computed_finer(tmp_path):
    """Steps of 3 ms are too long for the lighter half of these parcels."""
    fidelity = tiny().fidelity.replace(step=3e-3, step_tolerance=None)
    base = dataclasses.replace(tiny(), fidelity=fidelity)
    plain = run_sweep(dataclasses.replace(base, refine=False), tmp_path / "plain", **PLAIN)
    too_coarse = plain.status == fj.Status.STEP_TOO_COARSE
    assert 4 <= np.sum(too_coarse) <= 12
    assert np.all(plain.rung == 0)
    table = run_sweep(base, tmp_path / "refined", **PLAIN)
    np.testing.assert_array_equal(table.rung, np.where(too_coarse, 1, 0))
    assert np.all(table.good)
    finer = dataclasses.replace(base, fidelity=base.fidelity.ladder()[1], refine=False)
    finer = run_sweep(finer, tmp_path / "finer", **PLAIN)
    for name, column in table.outputs.items():
        np.testing.assert_array_equal(column[~too_coarse], plain.outputs[name][~too_coarse])
        # The same arithmetic in groups of another size: round-off of some hundred steps.
        np.testing.assert_allclose(column[too_coarse], finer.outputs[name][too_coarse], rtol=1e-11)
    assert "computed finer" in repr(table)
    assert_same(SweepTable.load(tmp_path / "refined"), table)
    np.testing.assert_array_equal(table.to_pandas()["rung"], table.rung)


def test_chunks_and_padding_do_not_change_results(whole, tmp_path):
    # 60 lanes: 4 chunks of 16 with 4 lanes of padding, or 3 of 24 with 12; the groups stay.
    other = run_sweep(SMALL.sweep(), tmp_path, chunk=24, group=8)
    assert_same(other, whole)


def test_lanes_without_good_numbers_are_counted(tmp_path):
    mass, place = np.tile([5.0, 1e12], 8), np.repeat([0.6, 0.8], 8)
    samples = sampling.given({
        "mass": mass, "reach": np.repeat([1.1, 1.2], 8), "distance": place,
    })  # fmt: skip
    sweep = dataclasses.replace(SMALL.sweep(), samples=samples)
    reported = []
    table = run_sweep(sweep, tmp_path, chunk=16, group=8, progress=reported.append)
    assert np.all(table.status[mass < 10] <= fj.Status.LEFT_OVER_TIP)
    assert np.all(table.status[mass > 10] > fj.Status.LEFT_OVER_TIP)
    assert reported[-1].bad == 8
    # No finer fidelity gives what a parcel of 1e12 kg does.
    assert np.all(table.rung[mass < 10] == 0)
    # Sound lanes are not touched by their neighbours: each place has its one force.
    force = table.outputs["peak_force"]
    for here in (0.6, 0.8):
        np.testing.assert_allclose(force[(mass < 10) & (place == here)], force[place == here][0])
    assert np.all(force[mass < 10] > 100)


def test_gradient_is_that_of_the_outputs(tmp_path):
    # A point and its neighbours: central differences, error of second order in the step and
    # Newton's tolerance 1e-6 over it.
    base, step = np.array([5.0, 0.7]), 3e-3
    rows = [base]
    for index in range(2):
        for sign in (1, -1):
            row = base.copy()
            row[index] *= 1 + sign * step
            rows.append(row)
    mass, distance = np.array(rows).T
    samples = sampling.given({"mass": mass, "distance": distance})
    sweep = dataclasses.replace(
        tiny(), samples=samples, outputs=("peak_force",), gradient_of="peak_force"
    )
    table = run_sweep(sweep, tmp_path)
    assert_same(SweepTable.load(tmp_path), table)
    force = table.outputs["peak_force"]
    for index, name in enumerate(samples.names):
        up, down = force[1 + 2 * index], force[2 + 2 * index]
        slope = (up - down) / (2 * step * base[index])
        np.testing.assert_allclose(table.gradient[name][0], slope, rtol=1e-2)


# ---- plans


def test_plan_covers_all_lanes_whatever_the_machine():
    for count in (1, 5, 63, 64, 65, 1000, 20000, 10**6):
        for platform in ("cpu", "gpu"):
            plan = Plan.of(count, None, None, platform)
            assert plan.chunk % plan.group == 0
            assert plan.chunk * plan.chunks >= count > plan.chunk * (plan.chunks - 1)
    assert Plan.of(10**6, None, None, "cpu") == Plan(4096, 64, 245)
    # A chunk beyond the sweep would be padding.
    assert Plan.of(100, 8 * 10**12, 8, "cpu") == Plan(104, 8, 1)
    # So would a group.
    assert Plan.of(100, None, 10**12, "cpu") == Plan(100, 100, 1)
    assert Plan.of(100, 128, 128, "cpu") == Plan(100, 100, 1)
    with pytest.raises(ValueError, match="`chunk` must be a multiple of `group` = 8.*Write 24"):
        Plan.of(100, 20, 8, "cpu")


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"outputs": ("hue",)}, "`outputs` must be one of"),
        ({"outputs": ()}, "`outputs` must name at least one"),
        ({"gradient_of": "impulse"}, "`gradient_of` must be one of"),
        ({"samples": sampling.grid(["mass"], 2)}, "`family` must have the names of the samples"),
    ],
)
def test_bad_sweeps_are_refused(changes, text):
    with pytest.raises(ValueError, match=text):
        dataclasses.replace(SMALL.sweep(), **changes)


# ---- the table


def table_of(shape, kind, gradient=True):
    count = int(np.prod(shape))
    rng = np.random.default_rng(3)
    variables = {"mass": 1 + rng.random(count), "distance": 0.5 + rng.random(count)}
    if kind == "grid":
        mesh = np.meshgrid(np.linspace(1, 2, shape[0]), np.linspace(0.5, 1, shape[1]),
                           indexing="ij")  # fmt: skip
        variables = dict(zip(variables, (m.ravel() for m in mesh), strict=True))
    force = 100 * variables["mass"] * variables["distance"] ** 2
    status = np.zeros(count, np.int32)
    status[1], status[3] = IMPOSSIBLE, fj.Status.NEVER_TOUCHED
    leave = np.where(status == 3, np.nan, 1.0)
    leave[[1, 3, 4]] = np.nan
    columns = {
        "peak_force": force, "leave_x": leave,
        "d_peak_force_d_mass": force / variables["mass"],
        "d_peak_force_d_distance": 2 * force / variables["distance"],
    }  # fmt: skip
    return SweepTable(lanes(
        variables, columns, status,
        units={
            "mass": "kg", "distance": "m", "peak_force": "N", "leave_x": "m",
            "d_peak_force_d_mass": "(N) / (kg)", "d_peak_force_d_distance": "(N) / (m)",
        },
        scalings={"mass": "logarithmic", "distance": "linear"}, outputs=("peak_force", "leave_x"),
        gradient_of="peak_force", shape=shape, configuration={"samples": {"kind": kind}},
    ))  # fmt: skip


def test_missing_numbers_are_counted_in_good_lanes():
    # Lane 1 is no scene; 3 never touched and 4 have no place where the parcel leaves.
    assert table_of((4, 3), "grid").missing() == {"leave_x": 2}


def test_columns_by_name():
    table = table_of((4, 3), "grid")
    assert table.units == {"mass": "kg", "distance": "m", "peak_force": "N", "leave_x": "m"}
    assert table.scalings == {"mass": "logarithmic", "distance": "linear"}
    assert table.gradient_of == "peak_force"
    force = 100 * table.variables["mass"] * table.variables["distance"] ** 2
    np.testing.assert_array_equal(table.outputs["peak_force"], force)
    np.testing.assert_array_equal(table.gradient["mass"], force / table.variables["mass"])
    np.testing.assert_array_equal(table.axes["distance"], [0.5, 0.75, 1.0])
    assert table.grid("peak_force").shape == (4, 3)
    assert table.counts() == {"IMPOSSIBLE": 1, "SUCCESSFUL": 10, "NEVER_TOUCHED": 1}
    with pytest.raises(ValueError, match="Only a grid has axes"):
        _ = table_of((12,), "sobol").axes


def test_dataset_is_labelled():
    data = table_of((4, 3), "grid").to_xarray()
    assert dict(data.sizes) == {"mass": 4, "distance": 3}
    assert data.peak_force.attrs["units"] == "N"
    assert data.mass.attrs["units"] == "kg"
    assert data.d_peak_force_d_mass.attrs["units"] == "(N) / (kg)"
    at = data.peak_force.sel(mass=2.0, distance=0.75)
    assert float(at) == pytest.approx(100 * 2 * 0.75**2)
    assert data.status.attrs["flag_meanings"].split()[0] == "IMPOSSIBLE"
    loose = table_of((12,), "sobol").to_xarray()
    assert dict(loose.sizes) == {"lane": 12}
    np.testing.assert_array_equal(loose.mass, table_of((12,), "sobol").variables["mass"])


def test_frame_has_a_row_a_lane():
    table = table_of((4, 3), "grid")
    frame = table.to_pandas()
    assert set(frame) == {
        "mass", "distance", "peak_force", "leave_x", "status", "d_peak_force_d_mass",
        "d_peak_force_d_distance",
    }  # fmt: skip
    assert len(frame) == 12
    np.testing.assert_array_equal(frame["mass"], table.variables["mass"])
    printed = repr(table)
    assert printed.startswith("SweepTable of ")
    assert "IMPOSSIBLE 1" in printed
    assert "mass [kg]" in printed
    assert frame["status"].iloc[1] == IMPOSSIBLE


# ---- the script


def test_figures_fit_the_points():
    drawn = table_of((4, 3), "grid").plot()
    assert set(drawn) == {"peak_force", "leave_x", "elasticities"}
    axes, bar = drawn["peak_force"].axes[:2]
    assert axes.get_xlabel() == "distance [m]"
    assert axes.get_ylabel() == "mass [kg]"
    assert axes.get_yscale() == "log"
    assert bar.get_ylabel() == "peak force [N]"
    # The lane without a scene is left blank, the others hold their values.
    shown = axes.collections[0].get_array()
    assert shown is not None
    assert int(np.ma.count_masked(shown)) == 1
    loose = table_of((64,), "sobol").plot()["peak_force"]
    panels = [panel for panel in loose.axes if panel.get_visible()]
    assert [panel.get_xlabel() for panel in panels] == ["mass [kg]", "distance [m]"]
    assert panels[0].get_ylabel() == "peak force [N]"


def test_arrays_are_drawn_as_a_table_is():
    table = table_of((4, 3), "grid")
    forces = {"peak_force": table.grid("peak_force")}
    status = table.grid("status")
    units = {"mass": "kg", "distance": "m"}
    drawn = fj.plot.sweep(table.axes, forces, status=status, units=units)["peak_force"]
    expected = table.plot()["peak_force"]
    for ours, other in zip(drawn.axes, expected.axes, strict=True):
        assert ours.get_xlabel() == other.get_xlabel()
        assert ours.get_ylabel() == other.get_ylabel()
    np.testing.assert_array_equal(
        drawn.axes[0].collections[0].get_array(), expected.axes[0].collections[0].get_array()
    )
    ratios = {"mass": np.geomspace(1, 50, 9)}
    line = fj.plot.sweep(ratios, {"peak_force": np.arange(9.0)}, units=units)["peak_force"].axes[0]
    assert line.get_xscale() == "log"
    with pytest.raises(ValueError, match="`units` must say the unit of 'place'"):
        fj.plot.sweep({"place": np.ones(3)}, {"peak_force": np.ones(3)})
    with pytest.raises(ValueError, match=r"`outputs` must hold .*\(4, 3\), but 'status'"):
        fj.plot.sweep(table.axes, forces, status=status.T, units=units)


def test_script_writes_its_files_and_says_whether_it_succeeded(
    whole, tmp_path, capsys, monkeypatch
):
    outcome = main(small(tmp_path, plots=True))
    assert_same(outcome.table, whole)
    reported = capsys.readouterr().out
    assert "60 of 60 lanes" in reported
    assert "IMPOSSIBLE 10" in reported
    content = json.loads((tmp_path / "result.json").read_text())
    assert content["statuses"] == whole.counts()
    assert shows_data(tmp_path / "peak_force.png")
    reported = report_pages.text(tmp_path / "report.html")
    assert "IMPOSSIBLE 10 there is no such scene" in reported
    assert outcome.succeeded
    (tmp_path / "result.json").unlink()

    def broken(table):
        raise RuntimeError("no picture")

    with monkeypatch.context() as patch:
        patch.setattr(type(outcome.table), "plot", broken)
        with pytest.raises(RuntimeError, match="no picture"):
            main(small(tmp_path, plots=True), quiet=True)
    # Numbers are written before pictures.
    assert json.loads((tmp_path / "result.json").read_text())["statuses"] == whole.counts()
    strict = main(small(tmp_path, tolerated=0.01))
    assert not strict.succeeded
    assert "more than the 1 % of --tolerated" in capsys.readouterr().out


def test_flags():
    assert configure([]) == SweepConfig()
    config = configure([
        "--vary", "mass", "thickness=0.02:0.06:7:linear", "--set", "distance=900 mm",
        "--gradient", "impulse",
    ])  # fmt: skip
    samples = config.samples()
    assert samples.names == ("mass", "thickness")
    assert samples.shape == (48, 7)
    assert samples.variables[1].scaling == "linear"
    sweep = config.sweep()
    assert sweep.family.fixed == {"distance": 0.9}
    assert sweep.outputs == ("peak_force", "tip_deflection", "impulse")
    assert configure(["--quick"]).fidelity == "fast"


def test_help_names_every_default(capsys):
    with pytest.raises(SystemExit) as leaving:
        configure(["--help"])
    assert leaving.value.code == 0
    assert capsys.readouterr().out.count("(default:") == len(vars(SweepConfig())) + 1


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"vary": ("mass=1",)}, "`vary` must read name"),
        ({"vary": ("mass=a:b",)}, "`vary` must read name"),
        ({"vary": ("mass=1:2:3",), "sampling": "sobol"}, "must not give points a variable"),
        ({"set": ("distance",)}, "`set` must hold each name once as NAME=VALUE"),
        ({"workers": 2, "scheduler": "tcp://host:8786"}, "`workers` starts a Dask cluster on this"),
        ({"workers": 10**6}, "`workers` must be at most 1024"),
        ({"devices": 10**6}, "`devices` must be at most 1024"),
        ({"scene": "free_fall"}, "`scene` must be one of"),
        ({"tolerated": 2.0}, "`tolerated` must be within"),
        ({"points": 1}, "`points` must be at least 2"),
    ],
)
def test_bad_flags_are_refused(changes, text):
    with pytest.raises(ValueError, match=text):
        SweepConfig(**changes).sweep()
