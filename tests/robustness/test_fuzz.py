"""Random scenes by hypothesis: finite or flagged, and the symmetries of mechanics.

The seeds are fixed (`derandomize`), and every property runs one compiled program. `offline_fuzz.py`
runs the first one over 100,000 scenes.
"""

import functools
import io

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from robustness.extreme_scenes import USUAL, WIDE, draw, impact
from robustness.offline_fuzz import (
    HALVES,
    LANES,
    TRUTH,
    VARIED,
    beyond,
    check,
    errors,
    program,
    truth,
)
from robustness.truth_record import Case, Truth, recorded

import fencejax as fj

SEEDS = st.integers(0, 2**31 - 1)


def fixed(examples):
    return settings(
        max_examples=examples, derandomize=True, deadline=None, database=None,
        suppress_health_check=list(HealthCheck),
    )


@fixed(10)
@given(SEEDS, st.sampled_from([WIDE, USUAL]))
def test_finite_or_flagged(seed, ranges):
    """10 draws of 128 lanes: 1,280 scenes. Value and gradient are finite under a good status, and
    the ledger gains nothing."""
    numbers = draw(seed, LANES, ranges)
    check(numbers, jax.device_get(program()(numbers)))


DRAWS = {"usual": (0,), "wide": (2, 5)}


def drawn(half, k):
    """128 random scenes."""
    return draw([7, k], LANES, HALVES[half])


def truths():
    """What the record of truths has of the draws."""
    return {
        f"{half} {k}": Case(drawn(half, k), VARIED, TRUTH, functools.partial(_computed, half, k))
        for half, draws in DRAWS.items()
        for k in draws
    }


def _computed(half, k):
    return Truth(*jax.device_get(truth()(drawn(half, k))))


@pytest.mark.parametrize("half", HALVES)
def test_a_good_status_keeps_its_promise(half):
    """128 real scenes, and 256 corners, most of them refused or said, beside those that the offline
    run compares, in value and in gradient."""
    compared = 0
    for k in DRAWS[half]:
        numbers = drawn(half, k)
        outcome = jax.device_get(program()(numbers))
        true = recorded(f"{half} {k}", numbers, VARIED, TRUTH)
        value, gradient, same, lanes = errors(outcome, true)
        compared += len(lanes)
        broken = beyond("fast", value, np.where(same, gradient, 0.0))
        assert not broken.any(), (lanes[broken], value[broken], gradient[broken])
    assert compared >= {"usual": 75, "wide": 10}[half]


def test_a_derivative_that_is_not_finite_is_said():
    """One lane in 100 by fixed steps, far too long for the fence, runs away: its values are finite
    still, its derivatives need not be. Which lane that is goes with round-off, and so with the
    processor."""
    run, reported = program("fast", step_tolerance=None), 0
    for k in (51, 60, 68, 87):
        status, found, slopes, _ = jax.device_get(run(draw([20260101, k], LANES, WIDE)))
        lost = (status == fj.Status.NON_FINITE) & np.isfinite(found).all(axis=1)
        assert np.all(slopes[lost] == 0)
        assert np.isfinite(slopes).all()
        reported += np.sum(lost)
    assert reported > 0


# --- Symmetries, with the cheapest program ------------------------------------------------------

PLAIN = fj.Fidelity.fast(
    modes=1, geometry="small", static_correction=False, step_tolerance=None
)
FIELDS = ("peak_force", "tip_deflection", "impulse", "furthest_y")


@functools.cache
def runner(fidelity=PLAIN, duration=0.06, build=impact):
    @jax.jit
    @jax.vmap
    def run(x):
        result = fj.simulate(build(x, duration), fidelity=fidelity, only=FIELDS)
        return jnp.stack([getattr(result, name) for name in FIELDS]), result.status

    return run


def agree(one, other, factors=None, tolerance=1e-6):
    """The same answers. Newton's method stops at 5e-7 of the forces, wherever it comes from; where
    friction reverses a difference of round-off may grow a little more."""
    (a, status), (b, other_status) = jax.device_get((one, other))
    factors = np.ones(len(FIELDS)) if factors is None else factors
    good = (status <= fj.Status.LEFT_OVER_TIP) & (other_status <= fj.Status.LEFT_OVER_TIP)
    assert np.mean(good) > 0.5
    # A status is a threshold: round-off may carry a lane across.
    assert np.mean(status != other_status) < 0.05
    size = np.abs(a[good]) + 1e-9
    off = np.abs(a[good] * factors - b[good]) / (size * factors)
    assert np.mean(off > tolerance) < 0.02
    assert np.max(off) < 1e-3


@fixed(3)
@given(SEEDS)
def test_units_do_not_matter(seed):
    """Kilograms, metres and seconds of another size; the fidelity's own lengths, speeds and times
    with them."""
    numbers = draw(seed, 64, USUAL)
    M, L, T = 3.0, 2.0, 0.5
    speed = L / T
    scales = dict(
        thickness=L, reach=L, width=L, modulus=M / L / T**2, density=M / L**3, mass=M, length=L,
        stiffness=M / T**2 / L**3, damping=M**0.6 / T / L**2, belt=speed, gravity=L / T**2,
        top_speed=1 / T, approach=speed, ride=speed,
    )
    scaled = {k: v * scales.get(k, 1.0) for k, v in numbers.items()}

    other = PLAIN.replace(
        step=PLAIN.step * T, slip_speed=PLAIN.slip_speed * speed,
        static_speed=PLAIN.static_speed * speed, tip_fade=PLAIN.tip_fade * L,
    )
    factors = np.array([M * L / T**2, L, M * L / T, L])
    agree(runner()(numbers), runner(other, 0.06 * T, in_half_the_time)(scaled), factors, 1e-5)


def in_half_the_time(x, duration):
    cycle = 0.5 * fj.HarmonicDrive().cycle_time
    scene = impact(x, duration, drive=fj.HarmonicDrive(x["top_speed"], cycle))
    angle = x["angle"] * x["top_speed"] * cycle / jnp.pi
    return eqx.tree_at(lambda s: s.start.drive_angle, scene, angle)


def turned(x, duration):
    """The same parcel, described the other way round: corner 3 for corner 1."""
    other = {**x, "across": -x["across"], "along": -x["along"]}
    return impact(other, duration, corner=3)


@fixed(3)
@given(SEEDS)
def test_a_parcel_turned_round_is_the_same_parcel(seed):
    numbers = draw(seed, 64, USUAL)
    agree(runner()(numbers), runner(build=turned)(numbers))


def without_friction(x, duration):
    return impact(x, duration, fence_friction=None)


@fixed(3)
@given(SEEDS)
def test_no_friction_is_friction_of_nought(seed):
    numbers = draw(seed, 64, USUAL)
    frictionless = numbers | {"kinetic": np.zeros(64), "static": np.zeros(64)}
    agree(runner()(frictionless), runner(build=without_friction)(numbers))


def shifted(x, duration):
    return fj.scenes.free_motion(
        position=(x["reach"], x["reach"]), velocity=(x["approach"], -x["approach"], x["top_speed"]),
        parcel=fj.Parcel(x["mass"], x["length"], x["length"] * x["aspect"]),
        belt=fj.Belt(x["belt"]), duration=duration,
    )


@fixed(3)
@given(SEEDS, st.floats(-3.0, 3.0))
def test_free_motion_does_not_know_where_it_is(seed, by):
    numbers = draw(seed, 64, USUAL)

    @jax.jit
    @jax.vmap
    def run(x, shift):
        scene = shifted(x, 0.1)
        moved = eqx.tree_at(lambda s: s.start.motion.x, scene, scene.start.motion.x + shift)
        final = fj.simulate(moved, fidelity=PLAIN, only=("final",)).final
        return jnp.stack([final.x - shift, *final[1:]])

    a, b = run(numbers, np.zeros(64)), run(numbers, np.full(64, by))
    np.testing.assert_allclose(a, b, atol=1e-9)


def test_save_and_load():
    scene = fj.scenes.oblique_impact(duration=0.03)
    result = fj.simulate(scene, fidelity=PLAIN)
    for tree in (scene, result):
        kept = io.BytesIO()
        eqx.tree_serialise_leaves(kept, tree)
        kept.seek(0)
        again = eqx.tree_deserialise_leaves(kept, jax.tree.map(jnp.zeros_like, tree))
        for one, other in zip(jax.tree.leaves(tree), jax.tree.leaves(again), strict=True):
            np.testing.assert_array_equal(one, other)
    assert float(fj.simulate(scene, fidelity=PLAIN).peak_force) == float(result.peak_force)
