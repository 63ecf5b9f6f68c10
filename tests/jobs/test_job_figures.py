"""The figures of jobs: the limits that apply, and readable titles."""

import types

import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.plot import Trace
from optimize.co_design import configuration as co_design, figures
from optimize.co_design.problem import Joint
from optimize.common import report
from optimize.peak_force import impacts as batch, job as peak_force
from optimize.peak_force.configuration import configure
from optimize.stability_map import picture
from optimize.stability_map.scenes import AXES

_HUB = ["--sorter", "parcel_hub", "--set", "period=1.6 s"]


def caught(monkeypatch, module):
    """The figures whose axes a module saves, as it saves them."""
    drawn = []
    monkeypatch.setattr(module, "save", lambda axes, path: drawn.append(axes.get_figure(root=True)))
    return drawn


def heights(axes):
    """Where dashed lines lie."""
    lines = [line for line in axes.lines if line.get_linestyle() == "--"]
    return sorted({abs(float(np.ravel(line.get_ydata())[0])) for line in lines})


def test_a_limit_that_is_not_in_force_has_no_value():
    limits = (fj.Limit(fj.OBJECTIVES["tip_deflection"], 0.06), fj.LIMITS["crossing"])
    assert report.most(limits, "tip_deflection") == 0.06
    assert report.most(limits, "peak_torque") is None
    # At least, and not at most.
    assert report.most(limits, "crossing") is None


def simulated(scene, **_):
    """A history, in place of a simulation."""
    time = jnp.linspace(0.0, scene.duration, 5)
    history = types.SimpleNamespace(
        time=time, fence_force=time, tip_deflection=1e-2 * time, torque=time
    )
    return types.SimpleNamespace(history=history)


@pytest.mark.parametrize(
    ("more", "tip", "torque"),
    [
        (["limits.tip_deflection=55 mm"], [55.0], [400.0]),
        # The job's own hold where the file switches its limits off.
        (["limits.tip_deflection=false", "limits.torque=false"], [80.0], [1000.0]),
    ],
)
def test_figures_of_a_sorter_have_its_own_limits_and_period(
    monkeypatch, tmp_path, more, tip, torque
):
    joint = Joint(co_design.configure([*_HUB, *more]))
    values = np.asarray(joint.space.values_of(joint.space.fence, joint.space.drive))
    drawn = caught(monkeypatch, figures)
    monkeypatch.setattr(figures.fj, "simulate", simulated)
    figures.motion(joint, values, values, tmp_path)
    figures.sorts(joint, values, values, 0, tmp_path)
    motion, sorts = drawn
    assert motion.axes[0].lines[0].get_xdata()[-1] == 1.6
    force, deflection, moment = sorts.axes
    assert heights(force) == []
    assert heights(deflection) == pytest.approx(tip)
    assert heights(moment) == pytest.approx(torque)


def test_the_tips_figure_has_the_limit_that_the_search_had(monkeypatch, tmp_path):
    config = configure([*_HUB, "limits.tip_deflection=55 mm", "--out", str(tmp_path)])
    given = []
    monkeypatch.setattr(peak_force.report, "draw", lambda *drawn: given.append(drawn[4]))
    lanes = batch.Impacts(config.distances[:1], config.masses[:1], 0.3, 0.2)
    found = {"peak_force": np.ones(1), "tip_deflection": np.ones(1)}
    outcome = types.SimpleNamespace(measured={"found": found}, stiff=np.ones(1), optimum=None)
    signals = Trace(*(np.zeros((3, 1, 2)) for _ in range(3)))
    bars = {when: {"peak_force": {}, "tip_deflection": {}} for when in ("before", "after")}
    peak_force._draw(config, outcome, lanes, signals, bars)
    assert given == [0.055]


def test_the_rigid_obstacle_is_struck_by_the_machines_parcel():
    # Four times the stiffness and twice the damping: the same restitution, in half the time.
    changed = ["parcels.stiffness=6.88e9", "parcels.damping=6.6e5"]
    machine = configure(["--sorter", "parcel_hub", "--set", *changed]).machine
    lanes = batch.Impacts((0.9,), (5.0,), 0.3, 0.2, machine)
    drive = fj.HarmonicDrive()
    force = batch.stiff_forces(lanes, drive, 2.5)
    speed = 2.5 * np.sin(0.3) + 0.9 * float(drive.motion(drive.time_at(0.3)).speed)
    parcel = fj.Parcel(5.0, stiffness=6.88e9, damping=6.6e5)
    alone = fj.simulate(fj.scenes.rigid_wall(speed=speed, parcel=parcel), only=("peak_force",))
    np.testing.assert_allclose(force, [alone.peak_force], rtol=1e-9)


def test_axes_of_the_stability_map_have_titles_for_a_reader(monkeypatch, tmp_path):
    drawn, make = [], picture.style.figure
    monkeypatch.setattr(picture.style, "figure", lambda *a: drawn.append(make(*a)) or drawn[-1])
    points = {name: np.geomspace(low, high, 3) for name, (low, high, _) in AXES.items()}
    kinds = {"fast": (np.zeros(3 * len(AXES), int), None)}
    picture.draw_axes(tmp_path / "axes.png", points, kinds)
    titles = [axes.get_title(loc="left") for axes in drawn[0].axes if axes.get_title(loc="left")]
    assert len(titles) == len(AXES)
    assert {
        "flexible length / reach [1]", "R / reach [1]", "fence's kinetic friction [1]",
        "breadth / length [1]", "approach speed [m/s]",
    } <= set(titles)  # fmt: skip
