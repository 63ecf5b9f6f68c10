"""A flexible link that is curved at rest: its line, and an impact against the independent
version."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from reference.impact import solve
from reference.impact_parts import Impact

import fencejax as fj

NUMBERS = {"tip": 0.09, "middle": 0.05}
HORIZON = 0.07
# The modes of the independent version, and no more.
FIDELITY = fj.Fidelity.standard(modes=3, static_correction=False)
INDEPENDENT = Impact(
    modes=3, horizon=HORIZON, load="cubic", mu_belt=(0.0, 0.0), mu_fence=(0.0, 0.0)
)


def scene(shape):
    return fj.scenes.oblique_impact(
        fence=fj.Fence(rest_shape=shape), belt=None, velocity=(2.0, 0.0, 0.0),
        fence_friction=None, duration=HORIZON,
    )  # fmt: skip


@jax.jit
def struck(numbers):
    """Slopes of the peak force in the shape's numbers, and the result."""

    def run(numbers):
        result = fj.simulate(
            scene(fj.RestShape(**numbers)), fidelity=FIDELITY,
            only=["peak_force", "tip_deflection", "peak_stress", "energy", "history"],
        )  # fmt: skip
        return result.peak_force, result

    return jax.grad(run, has_aux=True)(numbers)


def run(**numbers):
    return struck({k: jnp.asarray(v) for k, v in numbers.items()})


def independent(**numbers):
    numbers = {**NUMBERS, **numbers}
    return solve(replace(INDEPENDENT, rest=(numbers["middle"], numbers["tip"])), rtol=1e-7)


def test_line():
    # de Casteljau's construction, the slope, and the integrals of its square and cube.
    shape, length = fj.RestShape(**NUMBERS), 0.75
    share = jnp.linspace(0.0, 1.0, 401)
    line = jax.vmap(lambda s: shape.at(s, length))(share)
    points = [np.full(401, p) for p in (0.0, 0.0, NUMBERS["middle"], NUMBERS["tip"])]
    while len(points) > 1:
        points = [(1 - share) * a + share * b for a, b in zip(points, points[1:], strict=False)]
    np.testing.assert_allclose(line.deflection, points[0], atol=1e-15)
    slope = jax.vmap(jax.grad(lambda s: shape.at(s, length).deflection))(share) / length
    np.testing.assert_allclose(line.slope, slope, atol=1e-14)
    for power, value in ((2, line.short[-1]), (3, line.lower[-1])):
        area = length * np.trapezoid(slope**power, share) / (2 if power == 2 else 6)
        assert float(value) == pytest.approx(area, rel=1e-4)
    assert float(jnp.max(jnp.abs(slope))) <= float(shape.steepness(length))
    beyond = shape.at(1.1, length)
    assert float(beyond.deflection) == pytest.approx(
        NUMBERS["tip"] + 0.1 * length * float(slope[-1]), rel=1e-12
    )


def test_impact_against_the_independent_version():
    # Chords there and an arc of the third order here: 3e-4 of the peak at these slopes.
    slopes, result = run(**NUMBERS)
    found = independent()
    assert float(result.peak_force) == pytest.approx(found.peak_force, rel=1e-3)
    assert float(result.tip_deflection) == pytest.approx(found.tip_deflection, rel=1e-3)
    exchanged = sum(abs(float(term)) for term in jax.tree.leaves(result.energy))
    assert abs(float(result.energy.residual)) < 1e-4 * exchanged
    # The parcel's corner is on the drawn fence at the first contact, but for the drawing's chords,
    # l^2 / 8 times the curvature of 0.8 / m from the line, and its ordinates, which are w itself.
    curve = fj.RestShape(**NUMBERS)
    shape = fj.plot.outline(scene(curve), result, 0.0, fidelity=FIDELITY)
    within = 0.0375**2 / 8 * 0.8 + float(curve.at(0.55 / 0.75, 0.75).lower)
    corner, line = shape.parcel[0, :, 0], shape.fence[0]
    reached = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=1)))])
    foot = [np.interp(1.0, reached, part) for part in line]
    np.testing.assert_allclose(foot, corner, atol=within)
    for name, value in NUMBERS.items():
        low, high = (independent(**{name: value + step}).peak_force for step in (-1e-3, 1e-3))
        assert float(slopes[name]) == pytest.approx((high - low) / 2e-3, rel=1e-2), name


def test_a_straight_one_is_none():
    bare = fj.simulate(
        scene(None), fidelity=FIDELITY, only=["peak_force", "tip_deflection", "peak_stress"]
    )
    _, found = run(tip=0.0, middle=0.0)
    for name in ("peak_force", "tip_deflection", "peak_stress"):
        assert float(getattr(found, name)) == pytest.approx(float(getattr(bare, name)), rel=1e-9)


def test_it_is_cut_along_its_line(tmp_path):
    # The tip is at the end of the face's line; the area but for h / 2 over the radius; all angles
    # of the polygon but the corners' are small.
    fence = fj.Fence(rest_shape=fj.RestShape(**NUMBERS), taper=fj.Uniform())
    cut = fj.plot.write_dxf(tmp_path / "fence.dxf", fence)
    line = fence.rest_shape.at(1.0, fence.flexible_length)
    ends = np.hypot(cut.x - (1.2 - float(line.short)), cut.y - float(line.deflection - line.lower))
    assert np.min(ends) < 1e-12
    straight = fj.plot.fence_outline(fj.Fence(taper=fj.Uniform()))
    assert cut.area == pytest.approx(straight.area, rel=0.5 * 0.045 * 0.8)
    turns = np.abs(np.diff(np.unwrap(np.arctan2(np.diff(cut.y), np.diff(cut.x)))))
    assert np.sum(turns > 0.1) == 3
    sheet = fj.plot.fence_drawing(fence)
    written = {t.get_gid(): t.get_text() for t in sheet.texts if t.get_gid()}
    assert written["w[8]"] == "90"


def test_it_is_described_named_and_refused():
    sorter = fj.Sorter(fence={"rest_shape": {"tip": "50 mm"}, "edge_radius": "6 mm"})
    assert float(sorter.fence.rest_shape.tip) == pytest.approx(0.05)
    changed = sorter.replace(set={"fence.rest_shape.middle": "9 mm", "edge_radius": "4 mm"}).fence
    assert float(changed.rest_shape.middle) == pytest.approx(0.009)
    assert float(changed.edge_radius) == pytest.approx(0.004)
    sort = sorter.replace(free={"rest_tip": ("-50 mm", "80 mm")}).scene()
    assert fj.scene_numbers.resolve(sort, "rest_middle") == "fence.rest_shape.middle"
    assert fj.scene_numbers.number(sort, "rest_tip").unit == "m"
    curved = fj.Fence.one_link(rest_shape=fj.RestShape(tip=0.1))
    with pytest.raises(ValueError, match="corner 1 is .* beyond it"):
        fj.scenes.whole_sort(fence=curved, front=0.5)
    with pytest.raises(ValueError, match=r"`rest_shape.steepness` must be at most 0.5 \[rad\]"):
        fj.Fence(rest_shape=fj.RestShape(tip=0.2))
