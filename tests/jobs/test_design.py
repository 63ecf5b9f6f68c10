"""The design for one's own machine, in a small version: the job, and its problem's gradient."""

import dataclasses
import json

import ezdxf
import numpy as np
import pytest
import report_pages

import fencejax as fj
from fencejax.design import RELAXED
from fencejax.sorter import Objective, Price, rigid
from optimize.design import job, main, page, words
from optimize.design.configuration import DesignConfig, configure
from optimize.design.tolerances import tolerances

# Sorts that are soon over, the parcel in reach of the fence when the drive starts, and with few
# parts: one corner, no border, no friction but the belt's. Less is to be compiled.
TINY = """
title = "tiny"
period = "0.5 s"
fence_friction = false
border = false
[parcels]
mass = ["5 kg", "30 kg"]
front = "0.8 m"
offset = "10 mm"
corners = [1, 2]
[fence]
thickness = {lower = "20 mm", upper = "70 mm", start = "30 mm"}
length_ratio = {lower = 0.2, upper = 1, start = 0.6}
material = ["PA6 dry", "UHMW-PE"]
[drive]
cycle_time = "0.5 s"
top_speed = "3 rad/s"
[limits]
sorted = "-0.6 m"
tip_deflection = "170 mm"
torque = LIMIT
life = 1e4
"""


def written(folder, torque):
    """A sorter file with a limit of the torque [N m]."""
    (folder / "tiny.toml").write_text(TINY.replace("LIMIT", str(torque)))
    return DesignConfig(
        out=folder / "out", sorter=str(folder / "tiny.toml"), fidelity="fast", check="fast",
        rungs=1, budget=6,
    )  # fmt: skip


@pytest.fixture(scope="module")
def outcome(tmp_path_factory):
    """What the job finds for it."""
    return main(written(tmp_path_factory.mktemp("design"), 3000), quiet=True)


def test_every_material_is_designed_and_ranked(outcome):
    found = outcome.solutions
    assert sorted(one.candidate.name for one in found) == ["PA6 dry", "UHMW-PE"]
    assert found[0].rank <= found[1].rank
    for one in found:
        assert one.feasible
        # Less than at a feasible start, or feasible.
        assert one.after.objective < one.before.objective or one.before.violation > 0.1
        # The optimiser's feasibility.
        assert one.after.violation <= 1e-3
    # One program for both.
    assert [program._cache_size() for program in outcome.problem.program._each] == [1]


def test_what_is_measured_is_what_a_simulation_of_the_scene_finds(outcome):
    best, problem = outcome.best, outcome.problem
    scene = problem.scene(best.after.point, best.candidate, 1)
    # The rung that the lane was read at; batches round differently, 1e-9 and less.
    rung = int(best.after.measured.rungs[1])
    result = fj.simulate(scene, fidelity=fj.Fidelity.fast().ladder()[rung], history=False)
    found = best.after.measured.values["peak_force"][1]
    assert found == pytest.approx(float(result.peak_force), rel=1e-7)


def test_gradient_of_the_problem(outcome):
    problem, candidate = outcome.problem, outcome.problem.candidates[1]
    data, point, step = problem.data(candidate), np.array([0.55, 0.4]), 1e-4
    at = problem.program(point, *data)
    for index in range(2):
        ends = []
        for sign in (1, -1):
            moved = point.copy()
            moved[index] += sign * step
            ends.append(problem.program(moved, *data, least=at.rungs))
        for name in ("objectives", "margins"):
            rows = getattr(at, name[:-1] + "_rows")[:, index]
            upper, lower = (getattr(end, name) for end in ends)
            off = np.abs(rows - (upper - lower) / (2 * step)) / np.max(np.abs(rows))
            if name == "margins":
                stress = np.array([problem.margin(row)[0] == "stress" for row in range(rows.size)])
                # Of a stress that is read at samples, 0.5 ms apart, `fast` gives the slope at the
                # sample and not that of the peak.
                assert np.max(off[stress]) < 0.05
                off = off[~stress]
            # Central differences are off by f''' h^2 / 6, and by 1e-10 / h where steps of the
            # solver end at their tolerance.
            assert np.max(off) < 2e-3


def test_what_it_says_and_writes(outcome):
    text = words.mine(outcome.problem, outcome.best, outcome.stiff, outcome.push)
    assert text.startswith("Result for this machine: ")
    assert "; a constant push would need " in text
    assert "the largest peak force over the 2 parcels and places of tiny" in text
    assert outcome.stiff > outcome.best.after.objective > outcome.push
    content = json.loads((outcome.config.out / "design.json").read_text())
    assert [row["feasible"] for row in content["solutions"]] == [True, True]
    assert content["parcels"] == ["5 kg", "30 kg"]


@pytest.mark.parametrize(("over", "share"), [("cvar", 0.5), ("mean", 0.1)])
def test_what_stands_beside_a_mean_or_a_cvar_is_one_too(outcome, over, share, monkeypatch):
    """Of weights 0.9 and 0.1 the largest 20 % are one half of each parcel."""
    goal = Objective(fj.objectives.PEAK_FORCE, over, 0.8)
    problem = outcome.problem.with_objective(goal)
    parcels = dataclasses.replace(problem.machine.parcels, weights=np.array([0.9, 0.1]))
    problem.machine = dataclasses.replace(problem.machine, parcels=parcels)
    check, best = fj.Fidelity.fast(), outcome.best

    def of(forces):
        # The heavier parcel has the larger force.
        assert forces[1] > forces[0]
        return pytest.approx((1 - share) * forces[0] + share * forces[1], rel=1e-12)

    forces = best.after.measured.values["peak_force"]
    own, *_ = problem.judged(best.after.measured, best.candidate)
    assert own == of(forces)
    # Neither parcel of `outcome` needs a push to get as far as its limit asks.
    monkeypatch.setattr(job, "constant_push", lambda *_: np.array([10.0, 30.0]))
    stiff, push = job.compared(problem, best, check)
    assert stiff == of(rigid(problem, best, check).values["peak_force"])
    assert push == of([10.0, 30.0])
    after = best.after._replace(objectives=own)
    best = dataclasses.replace(best, after=after, before=after)
    name = {"cvar": "CVaR of the peak force", "mean": "mean peak force"}[over]
    text = words.mine(problem, best, stiff, push)
    assert f" N, the {name} over the 2 parcels" in text
    assert ("(CVaR at level 0.8), by the parcels' weights." in text) == (over == "cvar")
    assert text.endswith(" by the parcels' weights.")
    # The hardest parcel has a force of its own, which is named.
    largest = f"largest {fj.printing.shown(forces[1], 'N')}, 30 kg"
    row = next(r for r in words.before_and_after(problem, best).splitlines() if name in r)
    assert row.endswith(largest)
    other = dataclasses.replace(outcome, problem=problem, solutions=[best])
    results, every = page._results(other)
    assert results.rows[0][0] == name
    assert results.rows[0][-1] == largest
    assert [row[1] for row in every.rows] == ["0.9", "0.1"]
    assert f"The search: the {name}" in page._figures(other)[0].caption


def test_what_decides_is_near(outcome):
    """Nothing decides by limits that are far away, wherever a search ends."""
    problem, best = outcome.problem, outcome.best
    least = {name: np.inf for name in problem.limit_names}
    for index, margin in enumerate(best.optimum.last.margins):
        name, _ = problem.margin(index)
        least[name] = min(least[name], margin)
    assert all(least.get(price.name, 0.0) <= RELAXED and price.gain > 0 for price in best.prices)
    price = Price("tip_deflection", 0.17, 0.187, "m", ("5 kg",), 3.0)
    report = words.decides(problem, dataclasses.replace(best, prices=(price,)))
    assert "tip deflection (5 kg): 187 mm instead of 170 mm, 3 N less" in report
    for stop, report in (
        (fj.Stop.BUDGET, "No limit and no bound decides where the search ended: the budget"),
        (fj.Stop.OPTIMAL, "No limit decides, and no bound that could give way."),
    ):
        optimum = dataclasses.replace(best.optimum, stop=stop)
        other = dataclasses.replace(best, prices=(), optimum=optimum)
        assert words.decides(problem, other).startswith(report)


def test_the_page_and_the_drawing(outcome):
    out = outcome.config.out
    reader = report_pages.read(out / "report.html")
    assert reader.headings == [
        "The machine", "The design", "Materials and sizes compared", "Results and limits",
        "Figures", "What decides", "Tolerances", "Statuses and checks", "Assumptions",
        "How to make this page again",
    ]  # fmt: skip
    report = report_pages.text(out / "report.html")
    assert words.mine(outcome.problem, outcome.best, outcome.stiff, outcome.push) in report
    for name in outcome.problem.limit_names:
        assert words.plain(name) in report
    assert configure(report_pages.arguments(out / "report.html", "design")) == outcome.config
    # Drawing, search, elasticities.
    assert reader.pictures == 3
    best, problem = outcome.best, outcome.problem
    fence = problem.scene(best.after.point, best.candidate, 0).fence
    drawing = ezdxf.readfile(out / "fence.dxf").modelspace()
    measured = sorted(d.get_measurement() for d in drawing.query("DIMENSION"))
    lengths = (fence.thickness, fence.rigid_length, fence.flexible_length, fence.reach)
    assert measured == pytest.approx([1e3 * float(length) for length in lengths], rel=1e-9)


def test_where_a_materials_numbers_come_from():
    typical = "typical of its class, to be replaced by the supplier's"
    own = {"youngs_modulus": "1.6 GPa", "density": 1010, "conditions": "dry"}
    for given, said in (
        ("POM", typical), ({"name": "POM"}, typical), ({**own, "name": "my PA12"}, "for dry."),
        ({"name": "POM", "density": 1400}, "with numbers from the sorter file, for 23 C"),
    ):  # fmt: skip
        (sheet,) = fj.Sorter(fence={"material": given}).materials
        text = words.material(sheet)
        assert said in text
        assert (typical in text) == (said == typical)


def test_tolerances(outcome):
    problem, best = outcome.problem, outcome.best
    found = tolerances(problem, best, fj.Fidelity.fast())
    # Two numbers are free, three are the material's, each moved either way.
    assert [row.name for row in found.rows[::2]] == [
        *problem.variable_names, "material.youngs_modulus", "material.density",
        "material.damping_ratio",
    ]  # fmt: skip
    assert [row.share for row in found.rows] == [-0.05, 0.05] * 5
    # No program was compiled for it, nor at a rung that nothing was computed at.
    assert {program._cache_size() for program in problem._measures.values()} <= {0, 1}
    for row in found.rows[:4]:
        # Moved as a simulation of a fence made so finds it.
        point = best.after.point.copy()
        index = problem.variable_names.index(row.name)
        variable = problem.space.variables[index]
        point[index] = float(variable.share((1 + row.share) * row.value))
        again = problem.measure(point, best.candidate, fj.Fidelity.fast(), refine=False)
        assert row.simulated == np.max(again.values["peak_force"])
        # The gradient's line through the least margin leaves it by half its curvature times the
        # square of the step; a kink, where another sort or limit is the tightest, is followed.
        assert row.predicted_margin == pytest.approx(row.margin, abs=0.05)
        assert row.room >= 0


def test_a_conflict_is_named(outcome, tmp_path):
    # The same program: only bounds differ. 30 N m is less than it takes to swing the fence alone.
    found = main(written(tmp_path, 30), quiet=True)
    assert not found.succeeded
    assert all(not one.feasible for one in found.solutions)
    assert "torque" in [price.name for one in found.solutions for price in one.prices]
    report = words.decides(found.problem, found.best)
    assert "these fight" in report.lower()
    assert words.mine(found.problem, found.best, None).startswith("No design holds all limits. The")
    assert "the violation falls by " in words.decides(found.problem, found.best)
    # Nothing worse than the start is shown as found.
    for one in found.solutions:
        assert one.after.violation <= one.before.violation


def test_flags():
    config = configure(["--sorter", "parcel_hub", "--set", "belt.speed=2 m/s", "thickness=20 mm"])
    assert float(config.machine.belt.speed) == 2
    assert "fence.thickness" not in config.machine.free
    freed = configure(["--free", "fence.width=100mm:200mm"]).machine
    assert freed.free["fence.width"][:2] == (0.1, 0.2)
    for texts in (["belt.speed"], ["belt.speed="], ["belt.speed=1", "belt.speed=2"]):
        with pytest.raises(ValueError, match="`set` must hold each name once as NAME=VALUE"):
            assert configure(["--set", *texts]).machine
