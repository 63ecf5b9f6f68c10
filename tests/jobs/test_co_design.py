"""Fence and free-form motion together, in a small version."""

import json

import jax.numpy as jnp
import numpy as np
import pytest
import report_pages
from pictures import shows_data

import fencejax as fj
from fencejax.design import LaneProgram, extremes, ring_amplitude
from optimize.co_design import main, problem
from optimize.co_design.configuration import CoDesignConfig, configure
from optimize.common import starts

_SMALL = CoDesignConfig(
    masses=(15.0,), offsets=(0.1,), controls=4, budget=18, starts=2, scouting=8, fidelity="coarse",
    verify="coarse",
)  # fmt: skip


def test_extremes_of_a_motion_are_exact():
    angles = np.random.default_rng(0).uniform(0, 1, 6)
    drive = fj.SplineDrive(angles, 1.3)
    found = extremes(drive)
    spans, dt = 9, 1.3 / 9
    time = np.linspace(0, 1.3, spans * 2000 + 1)
    moved = drive.motion(jnp.asarray(time))
    speed, acceleration = np.asarray(moved.speed), np.asarray(moved.acceleration)
    rows, ends = np.abs(speed[:-1]).reshape(spans, 2000), np.abs(speed[2000::2000])
    # Sampled 2000 times a span: an inner extremum is missed by a' h^2 / 8, below 1e-5.
    np.testing.assert_allclose(found.speed, np.maximum(rows.max(1), ends), atol=1e-5)
    np.testing.assert_allclose(found.acceleration[1:-1], acceleration[2000:-1:2000], atol=1e-9)
    np.testing.assert_allclose(
        found.jerk, np.diff(np.asarray(found.acceleration)) / dt, rtol=1e-12
    )
    assert float(found.acceleration[0]) == pytest.approx(angles[0] * 0, abs=1e-12)


def test_ring_amplitude_of_a_static_bend():
    # A tip bent by a in the first mode holds m_0 omega^2 (a / phi)^2 / 2: the amplitude is its
    # root, and for a constant-strength link it lies near that of a static tip force,
    # a = sqrt(2 E / k), k = E I_1 / l_p^3 / (2 / 3): w'' is constant over the link up to the
    # square root of its thickness, so that w(tip) = F l_p^3 / (E I_1) 2/3.
    fence = fj.Fence()
    one, four = (float(ring_amplitude(jnp.asarray(e), fence)) for e in (0.5, 2.0))
    assert four == pytest.approx(2 * one, rel=1e-9)
    second_moment = 0.132 * 0.045**3 / 12
    stiffness = 1.5 * 3.0e9 * second_moment / 0.75**3
    # The first mode is near the static bend; its stiffness is a little higher.
    assert one == pytest.approx(np.sqrt(2 * 0.5 / stiffness), rel=0.1)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The search without finer rungs for designs in doubt: two programs more, each with the
    derivatives of a whole sort; `tests/design/test_program.py` has what they do."""
    out = tmp_path_factory.mktemp("co_design")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            problem, "LaneProgram",
            lambda read, combine, ladder, **_: LaneProgram(read, combine, ladder[:1]),
        )
        yield main(CoDesignConfig(**{**vars(_SMALL), "out": out}), quiet=True), out


def test_force_falls_and_every_limit_holds(small):
    outcome, _ = small
    before, after = (outcome.measured[when] for when in ("before", "after"))
    assert np.max(after["peak_force"]) < 0.8 * np.max(before["peak_force"])
    assert outcome.optimum.feasible
    assert outcome.verified.confirmed
    config = outcome.config
    drive = outcome.joint.space.apply(outcome.after)[1]
    moved = drive.motion(jnp.linspace(0, config.period, 3001))
    # The optimiser's feasibility is 1e-4.
    assert np.max(np.abs(moved.speed)) <= config.speed_limit * 1.0002
    assert np.max(np.abs(moved.acceleration)) <= config.acceleration_limit * 1.0002
    assert np.max(np.abs(after["jerk"])) <= config.jerk_limit * 1.0002
    assert np.max(after["ring_amplitude"]) <= config.ring_limit
    assert np.min(after["crossing"]) >= 0
    assert np.max(after["peak_torque"]) <= config.torque_limit
    # Home again, and never through the border.
    assert abs(float(moved.angle[-1])) < 1e-9
    assert np.min(moved.angle) > -2e-3


def test_files_and_resumption(small):
    outcome, out = small
    assert configure(report_pages.arguments(out / "report.html", "co_design")) == outcome.config
    assert "What decides" in report_pages.read(out / "report.html").headings
    assert (out / "fence.dxf").exists()
    content = json.loads((out / "co_design.json").read_text())
    assert content["feasible"] is True
    assert len(content["history"]) == len(outcome.optimum.history)
    assert content["smallest_margins"]["after"]["jerk"] >= -1e-3
    # A fence that bends hits less; nothing moves the parcel with less than 0.85 m g, shared with
    # the fence's friction.
    after = np.max(outcome.measured["after"]["peak_force"])
    assert content["constant_push"] == pytest.approx(0.85 * 15 * 9.81 / np.hypot(1, 0.35))
    assert content["constant_push"] < after < content["does_not_bend"]
    for name in ("motion", "sorts", "search"):
        assert shows_data(out / f"{name}.png")
    again = main(CoDesignConfig(**{**vars(_SMALL), "out": out, "plots": False}), quiet=True)
    np.testing.assert_array_equal(again.after, outcome.after)
    content = json.loads((out / "co_design.json").read_text())
    # All of the first searches, and of the one that went on once more.
    scouted = sum(len(one.history) for one in outcome.tried)
    assert content["recalled"] == scouted + len(outcome.optimum.history)
    assert len(content["starts"]) == 2
    # `None` where a search met nothing within limits.
    forces = [one["lowest_force"] for one in content["starts"] if one["lowest_force"]]
    assert outcome.optimum.objective <= 1.01 * min(forces)
    assert "2 starts" in (out / "report.html").read_text()


def test_starts_keep_the_drive():
    base = np.linspace(0.2, 0.8, 4)
    found = starts.spread(base, 5, (0, 2))
    np.testing.assert_array_equal(found[0], base)
    np.testing.assert_array_equal(found[:, [1, 3]], np.tile(base[[1, 3]], (5, 1)))
    assert len(np.unique(found[:, 0])) == 5
    assert np.all((found[1:, [0, 2]] >= 0.1) & (found[1:, [0, 2]] <= 0.9))


def test_the_most_promising_start_is_gone_on_with():
    # Two valleys, the higher one at 0.2; a search from each ends in its own.
    def problem(z):
        force = 3 - jnp.exp(-100 * (z - 0.2) ** 2) - 2 * jnp.exp(-100 * (z - 0.8) ** 2)
        return force, z, jnp.zeros(0, int)

    at = np.array([[0.25], [0.75]])
    tried, which = starts.scouted(lambda z, budget: fj.minimize(problem, z, budget=budget), at, 4)
    assert which == 1
    assert [len(one.history) for one in tried] == [4, 4]
    assert starts.lowest(tried[1]) < 1.1 < 1.9 < starts.lowest(tried[0])
    assert starts.best(tried) is tried[1]
    assert starts.summary(tried).startswith("After 4 evaluations from each of 2 starts")
    assert starts.summary(tried[:1]) == ""


def test_start_is_near_the_papers_drive():
    space = CoDesignConfig().space
    time = jnp.linspace(0, 1.36, 50)
    paper = np.asarray(fj.HarmonicDrive().angle(time))
    # The harmonic drive starts with an acceleration of 7 rad/s^2, the spline with none.
    np.testing.assert_allclose(space.drive.angle(time), paper, atol=0.03)


def test_flags():
    assert configure([]) == CoDesignConfig()
    assert configure(["--quick"]).controls == 5
    with pytest.raises(ValueError, match="`jerk_limit` must be above 0"):
        CoDesignConfig(jerk_limit=0.0)
    with pytest.raises(ValueError, match="`controls` must be at least 3"):
        CoDesignConfig(controls=2)
