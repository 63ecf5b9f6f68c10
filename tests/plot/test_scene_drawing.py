"""Pictures of a scene: everything is drawn at its place in the simulation."""

import dataclasses
import types

import jax
import numpy as np
import pytest
import runs

import fencejax as fj
from fencejax.model import FlexibleLink, Vibration
from fencejax.plot import FORCES, outline, reference_force

IMPACT = runs.SCENES["oblique_impact"]()
SORT = runs.SCENES["whole_sort"]()


@pytest.fixture(scope="module")
def impact():
    return runs.fixed("oblique_impact")


@pytest.fixture(scope="module")
def sort():
    return runs.fixed("whole_sort")


def with_history(result, history):
    return dataclasses.replace(result, history=history)


def from_line(points, angle):
    """Distance of points (F, 2) from the rigid link's line, to the side of the parcel."""
    return -np.sin(angle) * points[:, 0] + np.cos(angle) * points[:, 1]


def test_tip_is_bent_by_the_tip_deflection(impact):
    history = impact.history
    shape = outline(IMPACT, impact, history.time)
    tip = from_line(shape.fence[:, :, -1], history.drive.angle)
    # The same sums in another order, and one of the static compliance as a sum over 36 modes.
    np.testing.assert_allclose(tip, -history.tip_deflection, rtol=0, atol=1e-9)
    # Samples are 0.25 ms apart; between them the maximum is a parabola's.
    np.testing.assert_allclose(np.max(np.abs(tip)), impact.tip_deflection, rtol=1e-4)


def test_modes_left_out_bend_the_drawn_fence_too(impact):
    history = impact.history._replace(carried=())
    modal = outline(IMPACT, with_history(impact, history), history.time)
    tip = from_line(modal.fence[:, :, -1], history.drive.angle)
    assert np.max(np.abs(tip + history.tip_deflection)) > 1e-6


def test_arrows_point_where_the_contact_pushes():
    # Nothing but the fence acts on the parcel: it is accelerated along the arrow. Two modes and
    # 60 kg: the modes left out turn the fence by 0.16. They carry the load with its lag where it is
    # now, and not where it was: 2 zeta / omega_1 = 3 ms at 2 m/s, a hundredth of the link.
    scene = fj.scenes.oblique_impact(
        parcel=fj.Parcel(60.0), fence_friction=None, belt=None, velocity=(2.0, 0.0, 0.0),
        duration=0.05,
    )
    fidelity = fj.Fidelity.standard(modes=2)
    result = fj.simulate(scene, fidelity=fidelity)
    shape = outline(scene, result, result.history.time, fidelity=fidelity)
    arrow = shape.forces["fence"]
    x, y = np.asarray(result.history.acceleration[:2])
    pressed = np.asarray(result.history.fence_force) > 100
    across = (arrow.force_x[:, 0] * y - arrow.force_y[:, 0] * x)[pressed]
    turned = across / (np.hypot(arrow.force_x[:, 0], arrow.force_y[:, 0]) * np.hypot(x, y))[pressed]
    assert np.max(np.abs(turned)) < 0.01


def test_rigid_link_is_straight_and_the_length_is_kept(impact):
    history = impact.history
    shape = outline(IMPACT, impact, history.time)
    np.testing.assert_allclose(from_line(shape.fence[:, :, 1], history.drive.angle), 0, atol=1e-15)
    sizes = np.hypot(*np.moveaxis(np.diff(shape.fence, axis=2), 1, 0))
    np.testing.assert_allclose(sizes[:, 0], 0.45, rtol=1e-12)
    np.testing.assert_allclose(sizes.sum(axis=1), 1.2, rtol=1e-12)
    # Behind the line by h_1 at the hinge, and no thickness at the tip.
    gap = np.hypot(*np.moveaxis(shape.fence - shape.back, 1, 0))
    np.testing.assert_allclose(gap[:, 0], 0.045, rtol=1e-12)
    np.testing.assert_allclose(gap[:, -1], 0, atol=1e-15)


@pytest.mark.parametrize("modes", [0, 40])
def test_no_mode_and_all_modes(impact, modes):
    # No mode: a straight fence. All: one block of 40, and nothing left out.
    history = impact.history
    frames = len(history.time)
    amplitude = 1e-3 * np.random.default_rng(0).normal(size=(frames, 40)) / (1 + np.arange(40)) ** 4
    blocks = (amplitude,) if modes else ()
    changed = history._replace(vibration=Vibration(blocks, blocks), carried=())
    shape = outline(IMPACT, with_history(impact, changed), history.time)
    tip = from_line(shape.fence[:, :, -1], history.drive.angle)
    expected = np.zeros(frames)
    if modes:
        link = FlexibleLink(IMPACT.fence, fj.Fidelity(modes=None))
        expected = amplitude @ np.asarray(link.deflection[0])[-1]
    np.testing.assert_allclose(tip, expected, atol=1e-15, rtol=1e-12)


def test_parcel_has_its_size_and_its_place(sort):
    shape = outline(SORT, sort, sort.history.time)
    sides = np.hypot(*np.moveaxis(np.diff(shape.parcel, axis=2), 1, 0))
    np.testing.assert_allclose(sides, np.tile([0.4, 0.3, 0.4, 0.3], (len(sides), 1)), rtol=1e-12)
    np.testing.assert_allclose(shape.parcel[:, :, :4].mean(axis=2), shape.center, atol=1e-15)
    # At the start: front at x = 0.1 m, wall at the border; corner 1 is the leading lower one.
    np.testing.assert_allclose(shape.parcel[0, :, 0], [0.1, 0.0], atol=1e-15)
    np.testing.assert_allclose(shape.parcel[0, :, 2], [-0.3, 0.3], atol=1e-15)


def test_first_touch_is_on_the_drawn_fence(impact):
    # At the start corner 1 is at the arc coordinate 1.0 m, with D = 0.
    shape = outline(IMPACT, impact, 0.0)
    corner, line = shape.parcel[0, :, 0], shape.fence[0]
    reached = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=1)))])
    foot = [np.interp(1.0, reached, part) for part in line]
    # Chords of 37.5 mm instead of the curve: at most l^2 / 8 times the curvature, below 1e-2 / m.
    np.testing.assert_allclose(foot, corner, atol=0.0375**2 / 8 * 1e-2)


def test_arrows_add_up_to_mass_times_acceleration(sort):
    history = sort.history
    shape = outline(SORT, sort, history.time)
    assert set(shape.forces) == set(FORCES) - {"surfaces", "surfaces_friction"}
    total = np.stack([
        sum(np.sum(getattr(one, part), axis=1) for one in shape.forces.values())
        for part in ("force_x", "force_y")
    ])  # fmt: skip
    inertia = 15.0 * np.stack([history.acceleration.x, history.acceleration.y])
    np.testing.assert_allclose(total, inertia, atol=1e-9 * float(sort.peak_force))


def test_over_the_tip_the_arrow_stands_at_the_tip(sort):
    # Where corner 1 has run over the tip by more than the smoothing, the line of the force meets
    # the parcel's side straight above the tip, which is inside by the gap.
    shape = outline(SORT, sort, sort.history.time)
    tip, force = shape.fence[:, :, -1], shape.forces["fence"]
    beyond = np.hypot(*(shape.parcel[:, :, 0] - tip).T) > 0.03
    beyond &= (sort.history.fence[0].normal > 0.5) & (shape.time > 0.6)
    assert np.sum(beyond) > 10
    away = np.hypot(force.x[:, 0] - tip[:, 0], force.y[:, 0] - tip[:, 1])
    # The fence drawn keeps its length, the simulated one that of the undeflected line: some 10 um.
    np.testing.assert_allclose(away[beyond], sort.history.fence[0].gap[beyond], atol=1e-4)


def test_arrows_are_as_long_as_the_forces(impact):
    scale = 3e-4
    axes = fj.plot.draw_scene(IMPACT, impact, impact.peak_time, force_scale=scale)
    (quiver,) = [part for part in axes.collections if hasattr(part, "U")]
    drawn = np.hypot(quiver.U, quiver.V)
    assert (quiver.scale, quiver.angles, quiver.scale_units) == (1.0, "xy", "xy")
    # Between two samples, 0.25 ms apart, the force is a parabola with its top here.
    np.testing.assert_allclose(drawn, scale * impact.peak_force, rtol=1e-4)
    corner = outline(IMPACT, impact, impact.peak_time).parcel[0, :, 0]
    np.testing.assert_allclose(quiver.get_offsets()[0], corner, rtol=1e-12)
    # Without a scale the largest force is 0.3 m long.
    axes = fj.plot.draw_scene(IMPACT, impact, impact.peak_time)
    (quiver,) = [part for part in axes.collections if hasattr(part, "U")]
    np.testing.assert_allclose(np.hypot(quiver.U, quiver.V), 0.3, rtol=1e-4)


@pytest.mark.parametrize("scale", [1e-5, 3e-4, 0.1, 7.0])
def test_reference_force_is_round_and_fits(scale):
    force = reference_force(scale)
    assert 0.08 - 1e-12 <= scale * force <= 0.2 + 1e-12
    assert float(f"{force:.0e}") == pytest.approx(force)
    assert f"{force:.0e}"[0] in "125"


def test_frames_are_found_by_time(impact):
    # Samples left out at random: where they are kept the picture is the same, between them it is
    # halfway.
    history = impact.history
    count = len(history.time)
    kept = np.sort(np.random.default_rng(0).choice(count, count // 3, replace=False))
    thin = jax.tree.map(lambda leaf: np.asarray(leaf)[kept], history)
    # The last sample twice, and an unused one, as a buffer may hold them.
    thin = jax.tree.map(lambda leaf: np.concatenate([leaf, leaf[-1:], leaf[-1:]]), thin)
    thin.time[-1] = np.inf
    every = outline(IMPACT, impact, history.time[kept])
    some = outline(IMPACT, with_history(impact, thin), history.time[kept])
    np.testing.assert_allclose(some.parcel, every.parcel, atol=1e-15)
    np.testing.assert_allclose(some.fence, every.fence, atol=1e-12)
    middle = 0.5 * (history.time[kept][3] + history.time[kept][4])
    between = outline(IMPACT, with_history(impact, thin), middle)
    np.testing.assert_allclose(
        between.center[0], 0.5 * (every.center[3] + every.center[4]), atol=1e-14
    )


def test_what_is_drawn(sort):
    axes = fj.plot.draw_scene(SORT, sort, (0.0, 0.2, 0.6), path=True, forces=FORCES)
    assert axes.get_xlabel() == "x along the belt, 2 m/s $\\rightarrow$ [m]"
    assert axes.get_ylabel() == "y across the belt [m]"
    assert axes.get_aspect() == 1.0
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert texts[:3] == ["0 ms", "200 ms", "600 ms"]
    # The path ends where the parcel is at the last of the times.
    (path,) = [line for line in axes.lines if str(line.get_label()).startswith("path")]
    end = outline(SORT, sort, 0.6).center[0]
    np.testing.assert_allclose([path.get_xdata()[-1], path.get_ydata()[-1]], end, atol=1e-12)
    # The belt is as wide as it is.
    assert any(patch.get_height() == 0.7 for patch in axes.patches if hasattr(patch, "get_height"))
    axes.figure.canvas.draw()


def test_scene_without_fence_and_belt():
    scene = fj.scenes.free_motion(belt=None)
    result = types.SimpleNamespace(history=runs.fixed("free_motion").history._replace(belt=None))
    axes = fj.plot.draw_scene(scene, result, 0.05)
    assert axes.get_xlabel() == "x along the belt [m]"
    assert not [part for part in axes.collections if hasattr(part, "U")]


def test_a_fence_that_nothing_can_touch_is_drawn():
    scene = fj.scenes.free_motion(fence=fj.Fence(), duration=0.02)
    drawn = outline(scene, fj.simulate(scene), [0.0, 0.01])
    assert drawn.fence is not None
    assert "fence" not in drawn.forces


def test_refusals(impact):
    with pytest.raises(ValueError, match=r"`times` must be within the history, 0 .* \[s\]"):
        fj.plot.draw_scene(IMPACT, impact, 0.3)
    with pytest.raises(ValueError, match="`forces` must be one of"):
        fj.plot.draw_scene(IMPACT, impact, 0.0, forces=("gravity",))
    with pytest.raises(ValueError, match="`force_scale` must be finite and above 0"):
        fj.plot.draw_scene(IMPACT, impact, 0.0, force_scale=0.0)
    with pytest.raises(ValueError, match="has 3 modes and the history 4"):
        fj.plot.draw_scene(IMPACT, impact, 0.0, fidelity=fj.Fidelity.coarse())
    with pytest.raises(ValueError, match="holds none"):
        fj.plot.draw_scene(IMPACT, with_history(impact, None))
    batch = jax.tree.map(lambda leaf: np.asarray(leaf)[None], impact.history)
    with pytest.raises(ValueError, match="holds a batch"):
        fj.plot.draw_scene(IMPACT, with_history(impact, batch))
    with pytest.raises(TypeError, match="NormalScene"):
        fj.plot.draw_scene(runs.SCENES["normal_impact"](), impact)


def test_the_force_of_a_deflector_stands_on_it():
    wall = fj.surfaces.Deflector(0.5, friction=None)
    scene = fj.scenes.passive_sort((wall,), border=None, duration=0.25)
    result = fj.simulate(scene, fidelity=fj.Fidelity.coarse())
    time = float(result.history.time[np.argmax(result.history.surfaces[0][0].normal)])
    shape = outline(scene, result, time)
    x, y, force_x, force_y = (part[0] for part in shape.forces["surfaces"])
    pressed = np.hypot(force_x, force_y) > 0
    assert pressed.any()
    # Along n = (-sin a, cos a), at corners that have gone in by millimetres.
    np.testing.assert_allclose(force_y[pressed] * np.tan(0.5), -force_x[pressed], rtol=1e-9)
    depth = np.sin(0.5) * x[pressed] - np.cos(0.5) * y[pressed]
    assert np.all((depth > 0) & (depth < 0.05))
    axes = fj.plot.draw_scene(scene, result, time)
    assert any(line.get_linewidth() == 2.0 and len(line.get_xdata()) == 2 for line in axes.lines)
