"""Probabilities of breaking a limit: closed forms, quadratures, and a million samples."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate, optimize, stats

import fencejax as fj


def test_a_plane_limit_is_exact():
    # 5 + 3 u + 4 v < 0 where a standard normal number is below -1. To the optimiser's tolerance.
    found = fj.failure_probability(
        lambda x: x["a"] + x["b"], {"a": lambda u: 2 + 3 * u, "b": lambda u: 3 + 4 * u}
    )
    assert found.index == pytest.approx(1.0, abs=1e-5)
    assert found.probability == pytest.approx(stats.norm.sf(1.0), rel=1e-4)
    assert found.importance == pytest.approx({"a": 0.36, "b": 0.64}, abs=1e-4)
    assert found.point == pytest.approx({"a": 2 - 9 / 5, "b": 3 - 16 / 5}, abs=1e-4)
    assert "reliability index 1.000" in str(found)


def test_the_likelier_half_fails():
    found = fj.failure_probability(lambda x: x["a"], {"a": lambda u: u - 0.5})
    assert found.index == pytest.approx(-0.5, abs=1e-6)
    assert found.probability == pytest.approx(stats.norm.cdf(0.5), rel=1e-5)


@pytest.mark.parametrize("bend", [-0.1, 0.1, 0.5])
def test_a_curved_limit_is_nearly_exact(bend):
    # Broken where w > beta + bend v^2 / 2. The formula's next term is of the order of 1 / beta^2;
    # the plane is off by up to a factor of two.
    beta = 3.5
    found = fj.failure_probability(
        lambda x: beta + bend * x["v"] ** 2 / 2 - x["w"], {"v": lambda u: u, "w": lambda u: u}
    )

    def density(v):
        return stats.norm.pdf(v) * stats.norm.sf(beta + bend * v**2 / 2)

    exact = integrate.quad(density, -10, 10)[0]
    np.testing.assert_allclose(found.curvatures, [bend], atol=1e-6)
    assert found.probability == pytest.approx(exact, rel=1 / beta**2 / 2)
    assert abs(found.probability / exact - 1) < 0.25 * abs(found.first_order / exact - 1)


def wall(x):
    """Newtons between a limit and the peak force of an elastic impact on a rigid wall."""
    parcel = fj.Parcel(mass=x["mass"], damping=0.0)
    scene = fj.scenes.rigid_wall(parcel=parcel, speed=x["speed"])
    fidelity = fj.Fidelity.standard(step=1e-4)
    return 1e4 - fj.simulate(scene, fidelity=fidelity, only=("peak_force",)).peak_force


def test_lognormal_impacts():
    # The peak is k^0.2 (m v^2)^0.8 2.5^0.8: with lognormal numbers its logarithm is normal.
    found = fj.failure_probability(
        wall, {"mass": lambda u: 8 * jnp.exp(0.3 * u), "speed": lambda u: jnp.exp(0.1 * u)}
    )
    median = np.log(1.72e9**0.2 * (2.5 * 8.0) ** 0.8)
    deviation = np.hypot(0.8 * 0.3, 1.6 * 0.1)
    exact = stats.norm.sf((np.log(1e4) - median) / deviation)
    # The peak force is within 1e-4 at this step, and moves the index by so much over the deviation.
    assert found.probability == pytest.approx(exact, rel=1e-2)
    assert found.importance["mass"] == pytest.approx((0.24 / deviation) ** 2, abs=1e-3)


@pytest.mark.parametrize("limit", [2500.0, 3000.0, 4000.0, 6000.0])
def test_the_search_ends_where_round_off_begins(limit):
    """A limit that the margin reaches to its last digits, on which a line search would go on."""
    found = fj.failure_probability(
        lambda x: limit - 120 * x["mass"] ** 0.8 * x["speed"] ** 1.2,
        {"mass": lambda u: 15 * jnp.exp(0.2 * u), "speed": lambda u: 2 + 0.2 * u},
    )

    def distance(v):
        """Of the point of the limit at a speed of 2 + 0.2 v."""
        return np.hypot(v, np.log((limit / 120 / (2 + 0.2 * v) ** 1.2) ** 1.25 / 15) / 0.2)

    exact = optimize.minimize_scalar(distance, (-2.0, 2.0), tol=1e-10).fun
    assert abs(found.index) == pytest.approx(exact, abs=1e-6)
    assert found.evaluations < 20


def test_single_precision():
    with jax.enable_x64(False):
        found = fj.failure_probability(
            lambda p: p["limit"] - p["mass"],
            {"mass": lambda u: 8.0 * jnp.exp(0.4 * u), "limit": lambda u: 25.0 + 2.0 * u},
        )
    # Points within the square root of round-off, 3e-4 of the margin at the medians.
    assert found.index == pytest.approx(2.791, abs=2e-3)


@pytest.mark.parametrize(
    ("margin", "scatter", "message"),
    [
        (lambda x: 1.0, {}, "at least one"),
        (lambda x: 1.0 + 0 * x["a"], {"a": lambda u: u}, "must depend"),
        (lambda x: jnp.log(-1.0 - x["a"] ** 2), {"a": lambda u: u}, "finite"),
        (lambda x: 1.0 + jax.nn.softplus(x["a"]), {"a": lambda u: u}, "No point|budget"),
        (
            lambda x: 9.0 - x["a"] ** 2 - x["b"] ** 2 + 1e-3 * x["a"],
            {"a": lambda u: u, "b": lambda u: u},
            "bends round",
        ),
    ],
)
def test_undefined_probabilities_are_refused(margin, scatter, message):
    with pytest.raises(ValueError, match=message):
        fj.failure_probability(margin, scatter)


@pytest.mark.bench
def test_against_a_million_samples(bench_directory):
    """An oblique impact with four scattered numbers, at some 1e-4."""
    scatter = {
        "mass": lambda u: 8.0 * jnp.exp(0.35 * u),
        "distance": lambda u: 0.95 + 0.05 * u,
        "modulus": lambda u: 2.6e9 * jnp.exp(0.1 * u),
        "top_speed": lambda u: 1.5 * jnp.exp(0.05 * u),
    }

    def margin(x, limit):
        scene = fj.scenes.oblique_impact(
            fence=fj.Fence(material=fj.Material(x["modulus"], 1130.0, 0.035)),
            parcel=fj.Parcel(mass=x["mass"]),
            drive=fj.HarmonicDrive(top_speed=x["top_speed"]),
            distance=x["distance"],
            duration=0.13,
        )
        return limit - fj.simulate(scene, only=("peak_force",)).peak_force

    names = tuple(scatter)

    @jax.jit
    def margins(u):
        def one(row):
            return margin({n: scatter[n](row[k]) for k, n in enumerate(names)}, 0.0)

        return -jax.vmap(one)(u)

    draws = np.random.default_rng(0).standard_normal((1_000_000, len(names)))
    peaks = np.concatenate([np.asarray(margins(block)) for block in draws.reshape(1000, 1000, -1)])
    limit = float(np.quantile(peaks, 1 - 1e-4))
    found = fj.failure_probability(lambda x: margin(x, limit), scatter)
    (bench_directory / "failure_probability.md").write_text(
        f"limit {limit:.1f} N, broken by 100 of a million samples\n\n```\n{found}\n```\n"
        f"{found.evaluations} evaluations with gradients and one Hessian\n"
    )
    print(found, found.evaluations)
    # The samples' own deviation is a tenth.
    assert found.probability == pytest.approx(1e-4, rel=0.2)
