"""The estimated error of the peak force's gradient, compared with the true one."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from robustness import found_sorts
from robustness.searched_scenes import KINDS, changed

import fencejax as fj

# Of a wall's elastic impact the peak goes with m^0.8 k^0.2 v^1.6.
POWERS = np.array([0.8, 0.2, 1.6])


@functools.cache
def elasticities(fidelity):
    """The elasticities of an elastic impact's peak force on a wall, in mass, stiffness and speed;
    the estimated error of the gradient, and the status."""

    @jax.jit
    def run(x):
        def peak(x):
            mass, stiffness, speed = x
            parcel = fj.Parcel(mass=mass, stiffness=stiffness, damping=0.0)
            scene = fj.scenes.rigid_wall(parcel=parcel, speed=speed)
            result = fj.simulate(scene, fidelity=fidelity, only="peak_force")
            return jnp.log(result.peak_force), result

        slopes, result = jax.jacfwd(peak, has_aux=True)(x)
        return slopes * x, result.gradient_error, result.status

    return jax.device_get(run(jnp.array([10.0, 1.72e9, 1.0])))


@pytest.mark.parametrize("step", [2e-3, 1e-3, 5e-4, 2.5e-4])
def test_follows_the_true_error(step):
    # The peak is at a quarter of the contact's "period": what the steps miss until then comes in
    # with all signs alike, of which about a sixth is seen in the force. The estimate takes it as
    # seen in full, and goes with the square of the step as the error does.
    slopes, error, status = elasticities(fj.Fidelity.standard(step=step, step_tolerance=None))
    true = np.linalg.norm(slopes - POWERS) / np.linalg.norm(POWERS)
    assert true < error < 8 * true
    assert status == fj.Status.SUCCESSFUL


def test_is_infinite_where_nothing_is_differentiated():
    assert np.isinf(fj.simulate(fj.scenes.rigid_wall()).gradient_error)


def test_is_not_estimated_in_reverse_mode():
    """Sizes of derivatives are not linear in them."""
    scene = fj.scenes.rigid_wall()
    fidelity = fj.Fidelity.coarse(gradient="reverse")
    assert fj.simulate(scene, fidelity=fidelity, only="peak_force").gradient_error is None


# A light fence, hardly damped, under a heavy parcel: it rings for tens of periods until the force
# is largest, and the phase of each depends on every number. Found by searching.
RINGS = {
    "fence": dict(
        rigid_length=0.15133, flexible_length=0.740457, width=0.0941063, thickness=0.0117175
    ),
    "material": (56088100000.0, 560.881, 0.00249512),
    "parcel": dict(
        mass=12.4809, length=0.502345, breadth=0.292076, stiffness=166301000000.0, damping=320.593
    ),
    "distance": 0.776762,
    "speed": 2.35889,
}


def test_a_value_may_be_good_and_its_gradient_not():
    """Then the status says so where the gradient is computed, and a finer rung removes it."""

    def peak(thickness, fidelity):
        parts = RINGS["fence"] | {"material": fj.Material(*RINGS["material"])}
        scene = fj.scenes.normal_impact(
            fence=fj.Fence(**parts | {"thickness": thickness}),
            parcel=fj.Parcel(**RINGS["parcel"]),
            distance=RINGS["distance"], speed=RINGS["speed"], duration=0.1,
        )  # fmt: skip
        result = fj.simulate(scene, fidelity=fidelity, only=("peak_force",))
        return result.peak_force, result

    standard, _, finest = fj.Fidelity.standard().ladder()
    at = jnp.array(RINGS["fence"]["thickness"])
    _, alone = peak(at, standard)
    assert alone.status <= fj.Status.LEFT_OVER_TIP
    slope, found = jax.jacfwd(lambda x: peak(x, standard), has_aux=True)(at)
    assert found.status == fj.Status.STEP_TOO_COARSE
    true, finer = jax.jacfwd(lambda x: peak(x, finest), has_aux=True)(at)
    assert finer.status <= fj.Status.LEFT_OVER_TIP
    # Of one number alone; that of the gradient's norm in eight is 23 %.
    np.testing.assert_allclose(alone.peak_force, finer.peak_force, rtol=5e-3)
    assert abs(slope / true - 1) > 0.1
    assert finer.gradient_error < found.gradient_error / 10


def test_a_kink_beside_the_peak_is_estimated():
    """Found by searching: the force is largest some 20 us after the tip has begun to take the
    contact over from the corner, where its derivatives have a kink. Of their true error at a
    tolerance of 2e-3, 1.6, at least a half is estimated; and it is gone at the finest rung."""
    numbers = found_sorts.FOUND["the tip takes over just before the peak"]["numbers"]
    names = ("belt", "reach")
    at = jnp.array([numbers[name] for name in names])

    def peak(varied, fidelity):
        scene = KINDS["sort"].scene(changed(numbers, dict(zip(names, varied, strict=True))))
        result = fj.simulate(scene, fidelity=fidelity, only="peak_force")
        return result.peak_force, (result.gradient_error, result.status)

    def found(fidelity):
        slopes, (estimate, status) = jax.jit(jax.jacfwd(peak, has_aux=True), static_argnums=1)(
            at, fidelity
        )
        return slopes * at, estimate, status

    *_, finest = fj.Fidelity.standard().ladder()
    slopes, estimate, status = found(fj.Fidelity.fast(step_tolerance=2e-3))
    true, finely, sound = found(finest)
    error = np.linalg.norm(slopes - true) / np.linalg.norm(true)
    assert error > 0.5
    assert estimate > 0.5 * error
    assert status == fj.Status.STEP_TOO_COARSE
    assert finely < 0.05
    assert sound <= fj.Status.LEFT_OVER_TIP


@pytest.mark.parametrize("rung", ["coarse", "standard"])
def test_a_force_that_the_tip_ends_has_a_large_estimated_error(rung):
    """Found by searching: a heavy parcel slides over the tip at 3.4 m/s. Its force grows until the
    tip takes the contact over, and is gone half a millisecond later. Slopes over the belt's speed
    are up to 180 and 50 times the force where the true one is some 4 times it, and the estimated
    error was 0.01 to 0.5."""
    fidelity = getattr(fj.Fidelity, rung)()
    course = found_sorts.course("the tip cuts the force off", -1e-3, 1e-3, 33, fidelity)
    slopes = course.slopes / course.forces
    assert np.max(slopes) > 20
    off = (slopes < 0) | (slopes > 8)
    assert np.all(course.estimated[off] > fidelity.gradient_tolerance)
    assert np.all(course.status[off] == fj.Status.STEP_TOO_COARSE)
