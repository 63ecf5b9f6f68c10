"""Elasticities, unit rules, bounds from derivatives and Sobol' indices, against closed forms."""

import json

import numpy as np
import pytest
import report_pages
from pictures import numbers_first, shows_data

import fencejax as fj
from fencejax.parts import dimension
from fencejax.scenes import numbers as scene_numbers
from fencejax.study import Response, sensitivity
from optimize.sensitivity import job, main
from optimize.sensitivity.configuration import SensitivityConfig, configure

# Ishigami and Homma (1990): f = sin x1 + a sin^2 x2 + b x3^4 sin x1, x uniform in [-pi, pi].
_A, _B = 7.0, 0.1


def ishigami(u):
    """Value (K, 1) and slopes in u (K, 1, 3)."""
    x = np.pi * (2 * u - 1)
    x1, x2, x3 = x.T
    value = np.sin(x1) + _A * np.sin(x2) ** 2 + _B * x3**4 * np.sin(x1)
    slopes = [
        np.cos(x1) * (1 + _B * x3**4),
        2 * _A * np.sin(x2) * np.cos(x2),
        4 * _B * x3**3 * np.sin(x1),
    ]
    return value[:, None], 2 * np.pi * np.stack(slopes, axis=1)[:, None, :]


def ishigami_exact():
    """Variance, first-order and total indices in closed form."""
    v1 = 0.5 * (1 + _B * np.pi**4 / 5) ** 2
    v2 = _A**2 / 8
    v13 = _B**2 * np.pi**8 * (1 / 18 - 1 / 50)
    variance = v1 + v2 + v13
    return variance, np.array([v1, v2, 0]) / variance, np.array([v1 + v13, v2, v13]) / variance


@pytest.fixture(scope="module")
def ishigami_sample():
    design = sensitivity.design(3, 2048, seed=1)
    first, slopes = ishigami(design.first)
    second, _ = ishigami(design.second)
    mixed = np.stack([ishigami(points)[0] for points in design.mixed])
    return design, first, second, mixed, slopes


def test_design_mixes_columns():
    design = sensitivity.design(3, 8, seed=0)
    for i in range(3):
        others = [j for j in range(3) if j != i]
        np.testing.assert_array_equal(design.mixed[i][:, i], design.second[:, i])
        np.testing.assert_array_equal(design.mixed[i][:, others], design.first[:, others])
    assert len(np.unique(np.concatenate([design.first, design.second]))) == 48


def test_indices_of_ishigami(ishigami_sample):
    _, first, second, mixed, _ = ishigami_sample
    indices = sensitivity.sobol_indices(first, second, mixed, resamples=100)
    _, alone, total = ishigami_exact()
    # Means of numbers whose spread is about the variance: three errors of a sample of 2048 drawn at
    # random are 3 / sqrt(2048); the sequence is better.
    assert indices.first.value[0] == pytest.approx(alone, abs=0.066)
    assert indices.total.value[0] == pytest.approx(total, abs=0.066)
    # Intervals drawn as if at random are wider than the sequence's error.
    for estimate, exact in ((indices.first, alone), (indices.total, total)):
        assert np.all(estimate.low[0] <= exact)
        assert np.all(exact <= estimate.high[0])
    # They narrow with the confidence asked for.
    narrow = sensitivity.sobol_indices(first, second, mixed, resamples=100, confidence=0.5)
    assert np.all(narrow.total.high - narrow.total.low < indices.total.high - indices.total.low)


def test_bound_of_ishigami(ishigami_sample):
    _, first, _, _, slopes = ishigami_sample
    found = sensitivity.derivative_measures(first, slopes)
    variance, _, total = ishigami_exact()
    # Means over [-pi, pi]: cos^2 = 1/2, (sin 2x)^2 = 1/2, x^4 = pi^4/5, x^6 = pi^6/7, x^8 = pi^8/9.
    p = np.pi
    exact = (2 * p) ** 2 * np.array([
        0.5 * (1 + 2 * _B * p**4 / 5 + _B**2 * p**8 / 9),
        0.5 * _A**2,
        0.5 * 16 * _B**2 * p**6 / 7,
    ])  # fmt: skip
    # By the sequence's error again, of numbers whose spread is as large as they are.
    assert found.measure.value[0] == pytest.approx(exact, rel=0.02)
    assert found.bound.value[0] == pytest.approx(exact / (p**2 * variance), rel=0.04)
    assert np.all(found.bound.value[0] > total)


@pytest.mark.parametrize("coefficients", [(1.0, 2.0, -3.0), (0.0, 1.0, 0.5)])
def test_straight_line(coefficients):
    # V = sum c^2 / 12, S_i = S_Ti = c_i^2 / sum c^2, and the bound is 12 / pi^2 times that.
    c = np.array(coefficients)
    design = sensitivity.design(3, 1024, seed=3)
    first, second = (points @ c[:, None] for points in (design.first, design.second))
    mixed = design.mixed @ c[:, None]
    slopes = np.tile(c, (1024, 1))[:, None, :]
    share = c**2 / np.sum(c**2)
    indices = sensitivity.sobol_indices(first, second, mixed)
    bound = sensitivity.derivative_measures(first, slopes).bound
    # At random, the relative error of E[(u - u')^2] from 1024 points is 0.037, and the absolute one
    # of E[Q(B) (Q(A_B) - Q(A))] / V about 1 / sqrt(1024): three of these.
    assert indices.first.value[0] == pytest.approx(share, abs=0.094)
    assert indices.total.value[0] == pytest.approx(share, rel=0.11)
    assert bound.value[0] == pytest.approx(12 / np.pi**2 * share, rel=2e-3)


def test_bound_is_tight_for_half_a_period():
    # cos(pi u) is the function at which Wirtinger's inequality is an equality.
    u = sensitivity.design(1, 4096).first
    values, slopes = np.cos(np.pi * u), (-np.pi * np.sin(np.pi * u))[:, :, None]
    bound = sensitivity.derivative_measures(values, slopes).bound.value[0, 0]
    assert bound == pytest.approx(1.0, abs=2e-3)


def test_output_that_does_not_vary():
    design = sensitivity.design(2, 16)
    flat, mixed = np.full((16, 1), 3.0), np.full((2, 16, 1), 3.0)
    indices = sensitivity.sobol_indices(flat, flat, mixed)
    measures = sensitivity.derivative_measures(flat, np.zeros((16, 1, 2)))
    assert np.all(indices.total.value == 0)
    assert np.all(measures.bound.value == 0)
    assert design.first.shape == (16, 2)


def test_lanes_that_are_not_finite_are_refused():
    values = np.ones((8, 2))
    values[3, 1] = np.nan
    with pytest.raises(ValueError, match="1 of its lanes"):
        sensitivity.derivative_measures(values, np.ones((8, 2, 1)))
    with pytest.raises(ValueError, match="`mixed` must be finite"):
        sensitivity.sobol_indices(np.ones((8, 2)), np.ones((8, 2)), values[None])


@pytest.mark.parametrize("count", [1, 12])
def test_designs_are_of_powers_of_two(count):
    with pytest.raises(ValueError, match="count"):
        sensitivity.design(2, count)


def test_elasticities_of_a_power_law():
    # Q = p1^2 / p2: 2 and -1 everywhere; an input at 0 has none, an output of 0 no elasticity.
    p = np.array([[3.0, 4.0], [1.0, 0.5]])
    values = (p[:, 0] ** 2 / p[:, 1])[:, None]
    slopes = np.stack([2 * p[:, 0] / p[:, 1], -((p[:, 0] / p[:, 1]) ** 2)], axis=1)[:, None]
    found = sensitivity.elasticities(values, slopes, p)
    assert found[:, 0] == pytest.approx(np.tile([2.0, -1.0], (2, 1)))
    assert sensitivity.elasticities([1.0], [[5.0]], [0.0]) == pytest.approx(0.0)
    assert np.isnan(sensitivity.elasticities([0.0], [[5.0]], [1.0])).all()


def test_unit_rules_of_closed_forms():
    # Energy 1/2 m v^2 [J] and the deflection F l^3 / (3 E I) of a cantilever [m].
    rules = sensitivity.unit_rules
    assert rules([[1.0, 2.0]], ["kg", "m/s"], ["J"]) == pytest.approx(np.zeros((1, 3)))
    units = ["N", "m", "Pa", "m^4"]
    assert rules([[1.0, 3.0, -1.0, -1.0]], units, ["m"]) == pytest.approx(np.zeros((1, 3)))
    # A wrong exponent shows in the right rule.
    assert rules([[1.0, 1.0]], ["kg", "m/s"], ["J"])[0] == pytest.approx([0.0, -1.0, 1.0])
    with pytest.raises(ValueError, match="elasticity"):
        rules([[1.0]], ["kg", "m"], ["J"])


@pytest.mark.parametrize(
    ("text", "exponents"),
    [
        ("1", (0, 0, 0)),
        ("N/m^4", (1, -3, -2)),
        ("N s kg^-0.4 m^-3", (0.6, -2, -1)),
        ("kg/m^3", (1, -3, 0)),
        ("rad/s^2", (0, 0, -2)),
        ("N m", (1, 2, -2)),
    ],
)
def test_dimensions(text, exponents):
    assert dimension(text) == pytest.approx(exponents)


def test_unknown_units_are_refused():
    for text in ("lbf", "m^x", ""):
        if text:
            with pytest.raises(ValueError, match="unit"):
                dimension(text)


@pytest.fixture(scope="module")
def wall():
    return Response(fj.scenes.rigid_wall(), ["peak_force", "impulse", "contact_time"], chunk=4)


def test_rules_of_the_rigid_wall(wall):
    # Everything that carries a unit is a number of the scene, but for the step and the duration.
    lanes = scene_numbers.vary(
        wall.scene, ["mass", "speed"], [[15.0, 2.426], [3.0, 1.0], [30.0, 4.0]]
    )
    batch = wall.slopes(lanes)
    found = sensitivity.elasticities(batch.values, batch.slopes, lanes)
    units = [scene_numbers.number(wall.scene, name).unit for name in wall.names]
    rules = sensitivity.unit_rules(found, units, ["N", "N s", "s"])
    # Mass and length to the tolerance of the implicit steps, 1e-9.
    assert np.max(np.abs(rules[..., :2])) < 1e-7
    # The rule of time leaves over the elasticity in the step, twice the error of the second order:
    # in a blow of some 60 steps about 2 (pi / 60)^2 or less.
    assert np.max(np.abs(rules[:, :2, 2])) < 5.5e-3
    assert np.all(rules[..., 2] != 0)
    # Of length alone: mass, stiffness and damping are all that is left to make a force of.
    index = [wall.names.index(f"parcel.{n}") for n in ("length", "breadth", "center_x")]
    assert np.all(found[..., index] == 0)


def test_rigid_wall_by_its_two_numbers(wall):
    # The three rules leave one free function of the one ratio without a unit, in which the mass
    # cancels: N = k_p^0.2 m^0.8 v^1.6 F(b_p v^0.2 / k_p^0.6).
    lanes = scene_numbers.values(wall.scene)[None]
    batch = wall.slopes(lanes)
    found = sensitivity.elasticities(batch.values, batch.slopes, lanes)
    e = dict(zip(wall.names, found[0, 0], strict=True))
    # To the error of the step, as above.
    assert e["parcel.mass"] == pytest.approx(0.8, abs=2e-3)
    assert e["speed"] == pytest.approx(1.6 + 0.2 * e["parcel.damping"], abs=2e-3)
    assert e["parcel.stiffness"] == pytest.approx(0.2 - 0.6 * e["parcel.damping"], abs=2e-3)


def test_lanes_do_not_know_their_chunk(wall):
    rows = np.linspace(1.0, 3.0, 9)[:, None]
    lanes = scene_numbers.vary(wall.scene, ["speed"], rows)
    seen = []
    many = wall.values(lanes, progress=lambda done, total: seen.append((done, total)))
    one = np.concatenate([wall.values(lane[None]).values for lane in lanes])
    # Batches of other sizes are other kernels: round-off, and no other steps, of which one more or
    # less would count for 1e-5.
    np.testing.assert_allclose(many.values, one, rtol=1e-9)
    assert seen == [(4, 9), (8, 9), (9, 9)]
    assert sum(many.counts().values()) == 9
    # Slopes are those of the values: central differences of the second order.
    step = 1e-5
    up, down = (
        wall.values(scene_numbers.vary(wall.scene, ["speed"], rows + d)) for d in (step, -step)
    )
    slopes = wall.slopes_in(["speed"], rows).slopes[..., 0]
    np.testing.assert_allclose((up.values - down.values) / (2 * step), slopes, rtol=1e-6)


def test_lanes_in_doubt_are_computed_finer(wall):
    """A hard blow of some 15 ms is not resolved by steps of 4 ms; slower and softer ones are."""
    long = fj.Fidelity.standard(step=4e-3, step_tolerance=None)
    rows = [[0.5, 1.72e9], [2.5, 1.72e9], [1.0, 1e6]]
    lanes = scene_numbers.vary(wall.scene, ["speed", "parcel.stiffness"], rows)
    plain, fine = (
        Response(wall.scene, ["peak_force"], long, chunk=4, refine=refine).slopes(lanes)
        for refine in (False, True)
    )
    doubtful = np.array([fj.Status(int(status)).numerical for status in plain.status])
    assert doubtful.tolist() == [False, True, False]
    np.testing.assert_array_equal(fine.rung > 0, doubtful)
    assert np.all(plain.rung == 0)
    for k, rung in enumerate(fine.rung):
        alone = Response(wall.scene, ["peak_force"], long.ladder()[rung], chunk=4, refine=False)
        np.testing.assert_allclose(fine.slopes[k], alone.slopes(lanes).slopes[k], rtol=1e-9)


@pytest.mark.parametrize(
    ("outputs", "text"),
    [
        ([], "at least one"),
        (["nonsense"], "outputs"),
        (["peak_force", "peak_force"], "repeat"),
        (["crossing"], "parts"),
    ],
)
def test_outputs_that_cannot_be(outputs, text):
    with pytest.raises(ValueError, match=text):
        Response(fj.scenes.rigid_wall(), outputs)


def test_lanes_of_another_shape_are_refused(wall):
    with pytest.raises(ValueError, match="lanes"):
        wall.values(np.ones((2, 3)))


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    out = tmp_path_factory.mktemp("sensitivity")
    config = configure([
        "--out", str(out), "--scene", "normal_impact", "--quick", "--outputs", "peak_force",
        "tip_deflection", "--ranges", "density=1000:1300",
    ])  # fmt: skip
    with numbers_first(job):
        return main(config, quiet=True), out


def test_study_of_the_normal_impact(study):
    outcome, out = study
    assert outcome.succeeded
    assert "Elasticities" in report_pages.read(out / "report.html").headings
    # All numbers with units are the scene's: mass and length to rounding, in both outputs.
    for found in outcome.points.values():
        assert np.max(np.abs(found.rules[..., :2])) < 1e-6
    assert np.max(np.abs(outcome.line.rules[..., :2])) < 1e-6
    # Thickness acts by E z h^3 and rho z h alone, as does the modulus by the first of them:
    # a stiffer fence hits harder and bends less.
    (near, far) = outcome.points.values()
    names = list(outcome.names)
    modulus = names.index("youngs_modulus")
    for found in (near, far):
        assert found.elasticity[0, 0, modulus] > 0 > found.elasticity[0, 1, modulus]
    # Bounds lie above the indices, and shares of a nearly additive answer add up to about 1.
    indices, bound = outcome.shares.indices, outcome.shares.measures.bound
    assert np.all(bound.high >= indices.total.low)
    assert np.sum(indices.total.value, axis=1) == pytest.approx(1.0, abs=0.35)
    # What counts most by its index is among the three that count most by their bound.
    for row in range(2):
        leading = np.argsort(-bound.value[row])[:3]
        assert int(np.argmax(indices.total.value[row])) in leading


def test_files_of_the_study(study):
    outcome, out = study
    content = json.loads((out / "result.json").read_text())
    assert content["succeeded"] is True
    assert set(content["shares"]["peak_force"]) == set(outcome.names)
    assert sum(content["statuses"].values()) == 64 * (len(outcome.names) + 2)
    samples = np.load(out / "samples.npz")
    assert samples["u_mixed"].shape == (len(outcome.names), 64, len(outcome.names))
    np.testing.assert_array_equal(samples["first"], outcome.samples.first)
    for name in ("elasticities", "along", "shares"):
        assert shows_data(out / f"{name}.png")


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"samples": 100}, "power of 2"),
        ({"gradients": 2048}, "at most `samples`"),
        ({"scene": "nonsense"}, "scene"),
        ({"confidence": 1.5}, "confidence"),
        ({"variables": ("gravity",)}, "gravity=lower:upper"),
        ({"ranges": ("mass=5",)}, "name=lower:upper"),
        ({"ranges": ("mass=-5:5",)}, "mass"),
        ({"set": ("distance=far",)}, "with or without a unit"),
        ({"set": ("distance=1.3",)}, "where the fence ends"),
        ({"along": "nonsense=0:1"}, "one of"),
        ({"outputs": ("nonsense",)}, "outputs"),
    ],
)
def test_configurations_that_cannot_be(changes, text):
    with pytest.raises(ValueError, match=text):
        SensitivityConfig(**changes).check()


# What every scene with a fence, and every one with a corner on it, varies by default.
OF_FENCE = {
    "thickness", "length_ratio", "youngs_modulus", "density", "damping_ratio", "mass", "stiffness",
    "damping", "belt_speed", "belt_kinetic_friction", "fence_kinetic_friction", "top_speed",
}  # fmt: skip
OF_CORNER = OF_FENCE | {"distance", "drive_angle"}
TOUCHING = ("distance=0.8 m", "distance=1 m"), ("distance", 0.5, 1.1)


@pytest.mark.parametrize(
    ("scene", "varied", "places", "line"),
    [
        ("whole_sort", OF_FENCE | {"offset"}, ("the scene as it is",), None),
        ("rigid_wall", {"mass", "stiffness", "damping", "speed"}, ("the scene as it is",), None),
        ("along_fence", OF_CORNER, *TOUCHING),
        ("border_and_fence", OF_CORNER, *TOUCHING),
    ],
)
def test_every_scene_has_defaults(scene, varied, places, line):
    config = SensitivityConfig(
        scene=scene, outputs=("peak_force",), duration=0.0 if scene == "whole_sort" else 0.1
    )
    config.check()
    made = config.base()
    assert {variable.name for variable in config.inputs(made)} == varied
    assert tuple(config.places(made)) == places
    assert config.line(made) == line
