"""The comparison of concepts: its table, its problems, and how it goes about its searches."""

import csv
import dataclasses
import json
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest
import report_pages
from pictures import shows_data

import fencejax as fj
from fencejax.design import objectives, sorting
from fencejax.sorter import Look, Measured, Objective, Solution, SorterProblem
from optimize.concepts import figures, job, main, quantities, search, words
from optimize.concepts.configuration import ConceptsConfig, configure
from optimize.concepts.means import Concept
from optimize.concepts.problem import Group, grouped, period, swinging

_SORTER = """
title = "tiny"
[parcels]
mass = ["5 kg", "30 kg"]
[fence]
thickness = {lower = "20 mm", upper = "70 mm", start = "30 mm"}
[motor]
torque = "1000 N m"
[limits]
tip_deflection = "60 mm"
ring = "10 mm"
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    folder = tmp_path_factory.mktemp("concepts")
    (folder / "tiny.toml").write_text(_SORTER)
    return ConceptsConfig(
        out=folder / "out", sorter=str(folder / "tiny.toml"), rates=(2400.0, 3600.0),
        concepts=("rigid", "rigid+pad", "one_link", "two_link+motion"), verify="fast",
    )  # fmt: skip


@pytest.fixture(scope="module")
def groups(config):
    return grouped(config, config.read)


def test_concepts_are_read_and_ordered():
    assert Concept.read("pad+two_link").name == "two_link+pad"
    assert Concept.read("one_link+clutch").title == "one-link, clutch"
    two, one, pad, free = map(
        Concept.read, ("two_link", "one_link", "two_link+pad", "two_link+motion")
    )
    assert two.holds(one)
    assert pad.holds(two)
    assert free.holds(two)
    assert not one.holds(two)
    assert not two.holds(Concept.read("rigid"))
    assert not Concept.read("rigid").holds(Concept.read("rigid"))
    clutch = Concept.read("one_link+clutch")
    assert clutch.stiffens_to(Concept.read("rigid+clutch"))
    assert clutch.stiffens_to(Concept.read("rigid+shaft"))
    for other in ("rigid", "rigid+pad", "rigid+motion", "one_link"):
        assert not clutch.stiffens_to(Concept.read(other))
    # Special cases first, whatever order they are given in.
    read = ConceptsConfig(concepts=("two_link+motion", "two_link+pad", "one_link")).read
    assert [c.name for c in read] == ["one_link", "two_link+pad", "two_link+motion"]
    for wrong in ("pad", "one_link+two_link", "rigid+spring", "rigid+pad+pad"):
        with pytest.raises(ValueError, match="`concepts` must join"):
            Concept.read(wrong)


def test_flags():
    assert configure([]) == ConceptsConfig()
    assert len(configure(["--quick"]).concepts) == 3
    assert configure(["--rates", "3000", "2000"]).paces == (2000.0, 3000.0)
    for given in (["--rates", "0"], ["--concepts", "rigid", "rigid"]):
        with pytest.raises(ValueError, match=f"`{given[0][2:]}`"):
            configure(given)


def test_concepts_of_one_program_differ_in_data_alone(groups):
    rigid, bends, free = groups
    assert [[c.name for c in g.concepts] for g in groups] == [
        ["rigid", "rigid+pad"], ["one_link"], ["two_link+motion"],
    ]  # fmt: skip
    # Scenes lack the parts that no concept of the group has; parts that all have are not fixed.
    assert rigid.problem.machine.fence.pad is not None
    assert rigid.problem.machine.fence.shaft is None
    assert bends.problem.machine.fence.pad is None
    assert rigid.fixed == ("fence.pad.thickness", "fence.pad.modulus")
    assert free.fixed == ()
    assert rigid.fidelity("reference").modes == 0
    z, rate = rigid.problem.start, 3600.0
    alone, padded = (rigid.candidate(c, rate) for c in rigid.concepts)
    for candidate, thickness in ((alone, 0.0), (padded, 0.01)):
        fence = rigid.problem.scene(z, candidate, 1).fence
        assert float(fence.pad.thickness) == pytest.approx(thickness)
        assert float(fence.thickness) == pytest.approx(0.03)
        limits = dict(rigid.problem.limits(candidate))
        assert limits["cycle"].bound == limits["clear_period"].bound == period(rate) == 1.0
        assert limits["tip_deflection"].quantity == quantities.TIP_GIVE
        assert limits["ring"].quantity == quantities.HOME_RING
    assert rigid.design(rigid.concepts[0], z)["fence.pad.thickness"] == 0.0
    # The same sorts for either objective.
    force, load = rigid.problems.values()
    assert force.program._each is load.program._each
    assert load.machine.objective.quantity is quantities.LOAD


def test_what_a_problem_does_not_have_is_refused(groups):
    rigid, bends, _ = groups
    problem, candidate = rigid.problem, rigid.candidate(rigid.concepts[0], 2400.0)
    with pytest.raises(ValueError, match="`bounds` must name limits of the sorter, .*holds life"):
        problem.limits(candidate._replace(bounds={"life": 1.0}))
    with pytest.raises(ValueError, match="`fixed` must name free numbers"):
        SorterProblem(bends.problem.machine, fixed=("fence.pad.thickness",))
    with pytest.raises(ValueError, match="`objective` must be of a quantity that is read"):
        problem.with_objective(Objective(objectives.IMPULSE))


def test_a_design_of_another_group_at_another_rate(groups):
    rigid, bends, free = groups
    own = bends.design(bends.concepts[0], bends.problem.start)
    quick = bends.problem.values(bends.point(own, 3600.0))
    # As far a swing, within the shorter period.
    assert quick["drive.cycle_time"] < 1.0 < own["drive.cycle_time"]
    swings = [d["drive.top_speed"] * d["drive.cycle_time"] for d in (own, quick)]
    assert swings[1] == pytest.approx(swings[0])
    stiff = bends.point(rigid.design(rigid.concepts[1], rigid.problem.start), 2400.0)
    assert bends.problem.values(stiff)["fence.thickness"] == pytest.approx(0.07)
    found = free.problem.values(free.point(own, 2400.0))
    assert found["fence.thickness"] == pytest.approx(own["fence.thickness"])
    angles = [value for name, value in found.items() if "control_angles" in name]
    cycle = found["drive.cycle_time"]
    time = jnp.linspace(0.0, cycle, 50)
    harmonic = fj.HarmonicDrive(own["drive.top_speed"], own["drive.cycle_time"])
    # The spline comes up to the harmonic drive's first acceleration a over one of its spans d, by
    # when it lags by a d^2 / 6.
    away = fj.SplineDrive(angles, cycle).angle(time) - harmonic.angle(time)
    lag = float(harmonic.motion(0.0).acceleration) * (cycle / (len(angles) + 3)) ** 2 / 6
    assert np.max(np.abs(away)) < lag


def test_torques_that_swing_a_fence_as_a_drive_does(groups):
    problem = groups[1].problem
    drive = fj.HarmonicDrive(1.5, 1.2)
    hinge = {"inertia": 2.0, "damping": 80.0, "stiffness": 300.0}
    # Parcels that weigh nothing are no load.
    columns = {name: 0.0 * column for name, column in problem.machine.parcels.columns.items()}
    parcels = dataclasses.replace(problem.machine.parcels, columns=columns)
    machine = dataclasses.replace(problem.machine, parcels=parcels)
    torques = swinging(drive, machine, hinge.values(), 61)
    swung = fj.TorqueDrive(torques, 1.2, **hinge)
    for time in (0.3, 0.6, 1.0):
        found = swung.unloaded(time, machine.fence.inertia).angle
        # Lines between values 20 ms apart: off by (2 pi / 60)^2 / 8 of the torque, 0.14 %.
        assert float(found) == pytest.approx(float(drive.angle(time)), abs=3e-3)
    # With parcels more is needed on the way out, and no more on the way home.
    more = swinging(drive, problem.machine, hinge.values(), 61) - torques
    assert np.all(more[1:30] > 0)
    np.testing.assert_array_equal(more[31:], 0.0)


def test_the_problem_of_a_torque_drive(config):
    (group,) = grouped(config, [Concept.read("rigid+torque")])
    assert (group.name, group.fixed) == ("rigid-torque", ())
    problem, candidate = group.problem, group.candidate(group.concepts[0], 3600.0)
    drive = problem.scene(problem.start, candidate, 0).drive
    assert isinstance(drive, fj.TorqueDrive)
    assert drive.torques.shape == (config.controls,)
    limits = {name: limit.quantity for name, limit in problem.limits(candidate)}
    assert limits["clear_period"] == sorting.CLEAR_PERIOD_OF_TORQUE
    # A harmonic drive's design begins as its motion.
    given = {"drive.top_speed": 2.0, "drive.cycle_time": 1.2}
    found = problem.values(group.point(given, 2400.0))
    torques = [value for name, value in found.items() if "torques" in name]
    drive = fj.HarmonicDrive(2.0, 1.2)
    hinge = [found[path] for path in ("drive.inertia", "drive.damping", "drive.stiffness")]
    expected = swinging(drive, problem.machine, hinge, config.controls)
    np.testing.assert_allclose(torques, np.clip(expected, -1000, 1000), rtol=1e-9)


def _step(before, now, cycle=1.0, **fields):
    def sample(time, fields):
        energy = SimpleNamespace(fence=2.0 * time, strain=3.0 * time)
        return SimpleNamespace(time=time, energy=energy, **fields)

    scene = SimpleNamespace(
        fence=SimpleNamespace(reach=1.2), drive=SimpleNamespace(cycle=cycle)
    )
    return SimpleNamespace(before=sample(before, fields), now=sample(now, fields), scene=scene)


def test_limits_that_all_concepts_share():
    give = quantities.TIP_GIVE.measures[0].accumulator.update
    # w - R theta: behind by the bending and by the turn of the shaft.
    assert float(give(0.0, _step(0.0, 0.1, tip_deflection=0.02, twist=-0.01))) == pytest.approx(
        0.02 + 1.2 * 0.01
    )
    assert float(give(0.05, _step(0.0, 0.1, tip_deflection=0.02, twist=None))) == 0.05
    update = quantities.HOME_RING.measures[0].accumulator.update
    # 5 t along the line through both samples, at the cycle's end; later samples change nothing.
    state = update(0.0, _step(0.5, 0.9))
    assert float(state) == pytest.approx(4.5)
    state = update(state, _step(0.9, 1.2))
    assert float(state) == pytest.approx(5.0)
    assert float(update(state, _step(1.2, 1.3))) == pytest.approx(5.0)


@pytest.fixture(scope="module")
def stubbed(config, groups):
    """The job with sorts in closed form. A search ends at 3/4 of the ranges at 3600/h, with 400 N;
    at 2400/h at 1/4 with 600 N, but with 300 N where it begins at 3/4. A rigid fence has twice the
    force, less a tenth by a pad, and breaks a limit at 3600/h without one."""

    def look(problem, candidate, point, fidelity):
        (group,) = (g for g in groups if g.problem.space is problem.space)
        fast = candidate.bounds["cycle"] == 1.0
        bare = candidate.numbers.get("fence.pad.thickness") == 0.0
        force = 400.0 if fast else 600.0 if point[0] < 0.5 else 300.0
        force *= 1.0 if group.bends else 2.0 if bare else 1.8
        short = 0.2 if bare and fast else 0.0
        count = problem.machine.parcels.count
        values = {q.name: np.full(count, force) for q in problem.quantities}
        found = Measured(values, np.zeros(count, int), np.zeros(count, int))
        return Look(np.asarray(point), np.array([force]), np.array([-short]), found)

    def solve(problem, candidate, *, start, **settings):
        begun.append(start)
        fast = candidate.bounds["cycle"] == 1.0
        far = fast or np.all(start == 0.75)
        at = look(problem, candidate, np.full(start.size, 0.75 if far else 0.25), None)
        return Solution(candidate, at, at, None, at.violation == 0.0, None, (), 1)

    begun = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "look", look)
        patch.setattr(search, "solve", solve)
        patch.setattr(job, "grouped", lambda *_: groups)
        patch.setattr(Group, "compile", lambda _: None)
        return main(config, quiet=True), begun


def test_the_front_and_who_wins(stubbed, config):
    outcome, begun = stubbed
    # Four concepts at two rates, for force and for load.
    assert len(outcome.points) == 16
    assert outcome.searches == len(begun) > 16
    last = outcome.of("peak_force", 3600.0)[-2:]
    assert [p.concept.name for p in last] == ["rigid+pad", "rigid"]
    assert not last[-1].feasible
    # The way back: from the design of 3600/h on, 300 N were found at 2400/h.
    wins = " ".join(json.loads((config.out / "concepts.json").read_text())["wins"])
    assert "At 2400/h one-link has the least peak force, 300 N" in wins
    assert "At 3600/h one-link has the least peak force, 400 N" in wins
    assert "a constant push would need " in wins
    # No way back for a rigid fence, whose design of 3600/h breaks a limit.
    assert "rigid 1200 N" in wins
    assert "breaks a limit by 20 %" in words.table(outcome, "peak_force")
    assert outcome.succeeded


def test_files(stubbed, config):
    content = json.loads((config.out / "concepts.json").read_text())
    assert content["complete"] is True
    assert content["least_force"]["one_link"] == 300.0
    rows = list(csv.DictReader((config.out / "concepts.csv").read_text().splitlines()))
    assert len(rows) == len(content["designs"]) == 16
    assert rows[0]["concept"] == "rigid"
    assert float(rows[0]["peak_force [N]"]) == pytest.approx(1200.0)
    assert shows_data(config.out / "concepts.png")
    page = report_pages.read(config.out / "report.html")
    assert page.headings == [
        "The machine", "The concepts", "Figures", "Least peak force", "Least peak load",
        "The winners' designs", "Statuses and checks", "Assumptions",
        "How to make this page again",
    ]  # fmt: skip
    assert configure(report_pages.arguments(config.out / "report.html", "concepts")) == config
    assert content["wins"][0].rstrip(".") in report_pages.text(config.out / "report.html")


def test_titles_of_the_figure_say_whose_torque_and_mass(stubbed, tmp_path, monkeypatch):
    drawn, make = [], figures.new_figure
    monkeypatch.setattr(figures, "new_figure", lambda *size: drawn.append(make(*size)) or drawn[0])
    figures.fronts(stubbed[0], tmp_path)
    places = ("left", "center", "right")
    titles = {axes.get_title(loc=place) for axes in drawn[0].axes for place in places}
    assert {"torque of the least-force design", "mass of the least-force design"} <= titles
