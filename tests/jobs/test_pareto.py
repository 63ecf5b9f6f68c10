"""The front of peak force against another quantity, in a small version."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import report_pages
from pictures import shows_data

import fencejax as fj
from fencejax.design import objectives
from optimize.pareto import main
from optimize.pareto.configuration import ParetoConfig, configure
from optimize.pareto.constant_force import Blow, blows

_SMALL = ParetoConfig(
    masses=(15.0,), distances=(0.95,), duration=0.12, crossing=-0.3,
    variables=("thickness", "length_ratio"), points=4, starts=1, fidelity="fast", verify="fast",
)  # fmt: skip


def _with(**changes):
    return ParetoConfig(**{**vars(_SMALL), **changes})


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    out = tmp_path_factory.mktemp("front")
    return main(_with(out=out), quiet=True), out


def test_front_falls_and_holds_its_limits(small):
    front, _ = small
    points = sorted((p for p in front.points), key=lambda p: p.other)
    assert np.count_nonzero(front.on_front) >= 3
    assert all(p.sound for p, good in zip(front.points, front.on_front, strict=True) if good)
    assert front.succeeded
    kept = [p for p, good in zip(front.points, front.on_front, strict=True) if good]
    force = [p.force for p in sorted(kept, key=lambda p: p.other)]
    assert np.all(np.diff(force) < 0)
    for point in points:
        for limit in front.tradeoff.limits:
            margins = limit.margin_of(point.found.lanes[limit.name])
            # The reserve covers the optimiser's own tolerance of 1e-4.
            assert np.min(margins) >= _SMALL.reserve - 2e-4
        unit = front.tradeoff.measure("fast", front.tradeoff.start).other
        assert point.other <= point.bound + 2e-4 * unit


def test_every_bound_is_served_by_one_program(small):
    front, _ = small
    assert front.tradeoff.program._each[0]._cache_size() == 1
    # At the optimiser's own fidelity the second look finds the same, compiled otherwise: the same
    # numbers to rounding where the search had no lane at a finer rung, else what `fast` may be off.
    plain = [not np.any(point.optimum.last.rungs) for point in front.points]
    assert any(plain)
    for point, same in zip(front.points, plain, strict=True):
        assert abs(point.verified.error) < (1e-9 if same else 0.01)
        assert point.force == pytest.approx(point.optimum.objective, rel=1e-9)


def test_constant_force_stop_is_never_beaten(small):
    front, _ = small
    force = np.array([p.force for p in front.points])
    assert np.all(front.least_force > 0)
    assert np.all(front.least_force < force)


def test_blow_of_an_impact_in_closed_form(small):
    front, _ = small
    # v_n = v sin alpha + R alpha', all of the mass: C_s is on the fence's normal there. The free
    # vibration of the swinging fence adds its own, below 1 % of it.
    (blow,) = blows(front.tradeoff, front.tradeoff.start)
    drive = fj.HarmonicDrive()
    rate = float(drive.motion(drive.time_at(0.30)).speed)
    assert blow.speed == pytest.approx(2.0 * np.sin(0.30) + 0.95 * rate, rel=0.01)
    # The normal is turned by the fence's bend, some milliradians.
    assert blow.mass == pytest.approx(15.0, rel=1e-3)
    assert Blow(2.0, 10.0).least_force(0.05) == pytest.approx(400.0)


def test_constant_force_stop_in_a_normal_impact():
    # One coordinate: the work over the travel is the whole energy, so that no fence can be better.
    @jax.jit
    @jax.vmap
    def run(thickness):
        fence = fj.Fence(thickness=thickness)
        scene = fj.scenes.normal_impact(fence=fence, speed=2.0, duration=0.08)
        only = ("peak_force", "tip_deflection", "deepest")
        result = fj.simulate(scene, fidelity=fj.Fidelity.fast(), history=False, only=only)
        return result.peak_force, result.tip_deflection + result.deepest

    force, travel = run(jnp.linspace(0.03, 0.09, 5))
    assert np.all(np.asarray(force) >= 0.5 * 15.0 * 2.0**2 / np.asarray(travel))


def test_fence_mass_in_closed_form():
    # rho z h_1 (l_s + 2/3 l_p) for constant strength, (l_s + l_p) for a plain strip, the trapezoids
    # between stations, and the middles of steps.
    middles = np.sqrt(1 - (np.arange(7) + 0.5) / 7)
    for taper, share in (
        (fj.ConstantStrength(), 2 / 3), (fj.Uniform(), 1.0),
        (fj.ProfileTaper([1.0, 0.9, 0.4, 0.3]), (0.5 + 0.9 + 0.4 + 0.15) / 3),
        (fj.SteppedTaper(fj.ConstantStrength(), 7), np.mean(middles)),
    ):  # fmt: skip
        fence = fj.Fence(taper=taper)
        exact = 1130.0 * 0.132 * 0.045 * (0.45 + share * 0.75)
        scene = fj.scenes.oblique_impact(fence=fence)
        assert float(objectives.FENCE_MASS(None, scene)) == pytest.approx(exact, rel=1e-12)
    assert float(objectives.CYCLE_TIME(None, scene)) == pytest.approx(1.36)


def test_resumed_job_ends_where_the_whole_one_did(small, tmp_path):
    front, out = small
    lines = (out / "evaluations.jsonl").read_text().splitlines(keepends=True)
    half = len(lines) // 2
    (tmp_path / "evaluations.jsonl").write_text("".join(lines[:half]) + lines[half][:40])
    again = main(_with(out=tmp_path, plots=False), quiet=True)
    assert again.evaluations == front.evaluations
    for one, other in zip(front.points, again.points, strict=True):
        # One and the same program: what is computed anew comes out the same.
        np.testing.assert_allclose(one.values, other.values, rtol=1e-9)
    assert json.loads((tmp_path / "front.json").read_text())["recalled"] == half - 1
    with pytest.raises(ValueError, match="written with other settings"):
        main(_with(out=tmp_path, tip_limit=0.05), quiet=True)


def test_files(small):
    front, out = small
    content = json.loads((out / "front.json").read_text())
    assert content["complete"] is True
    assert len(content["points"]) == len(front.points)
    for row in content["points"]:
        assert set(row["design"]) == {"thickness", "length_ratio"}
        assert row["constant_force_bound"] < row["peak_force"]
        assert sum(row["statuses"].values()) == 1
    for name in ("front", "designs"):
        assert shows_data(out / f"{name}.png")
    page = report_pages.read(out / "report.html")
    assert page.pictures == 3
    assert "A design from the front" in page.headings
    assert configure(report_pages.arguments(out / "report.html", "pareto")) == front.config
    assert (out / "fence.dxf").exists()


def test_no_feasible_design_is_reported(small, tmp_path, capsys):
    found = main(_with(out=tmp_path, tip_limit=1e-4, plots=False, budget=25))
    assert not found.succeeded
    assert "no feasible design found" in capsys.readouterr().out


def test_flags():
    assert configure([]) == ParetoConfig()
    config = configure(["--against", "cycle_time", "--free", "thickness=20mm:80mm"])
    assert config.kind == "sorts"
    thickness = config.space.variables[config.space.names.index("thickness")]
    assert (thickness.lower, thickness.upper) == (0.02, 0.08)
    assert "cycle_time" in config.space.names
    assert configure(["--quick"]).fidelity == "fast"
    with pytest.raises(ValueError, match="`points`"):
        ParetoConfig(points=2)
    with pytest.raises(ValueError, match="`against` must be one of"):
        ParetoConfig(against="beauty")
