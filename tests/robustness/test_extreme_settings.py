"""The limits of every setting: elements, modes, tapers, the smoothing of friction, horizons, steps
and single precision. Each is a program of its own; the scenes are as small as they can be."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from robustness.extreme_scenes import ORDINARY, impact
from runs import one_by_one

import fencejax as fj

PROMISE = 0.008
"""Of the peak force at `coarse`."""


def struck(fidelity, scene=None, **fields):
    scene = fj.scenes.normal_impact(duration=0.05) if scene is None else scene
    return fj.simulate(scene, fidelity=fidelity, history=False, **fields)


# --- Elements and modes -------------------------------------------------------------------------


@functools.cache
def all_modes():
    return float(struck(fj.Fidelity(modes=None, step=1e-4, step_tolerance=None)).peak_force)


@pytest.mark.parametrize(
    ("elements", "modes"),
    [(1, 1), (1, None), (2, 4), (20, 12), (100, 4), (100, None)],
)
def test_elements_and_modes(elements, modes):
    # A single mode, and one element, with the static correction: within 10 % of all 40.
    result = struck(fj.Fidelity(elements=elements, modes=modes))
    assert int(result.status) <= fj.Status.LEFT_OVER_TIP
    coarse = elements < 10 or modes == 1
    assert float(result.peak_force) == pytest.approx(all_modes(), rel=0.1 if coarse else 0.0025)


@pytest.mark.parametrize("elements", [1, 20, 500])
def test_no_modes_is_the_wall(elements):
    """Without modes the fence is rigid, and at rest it is the wall: 3293.85 N to 1e-4."""
    result = struck(fj.Fidelity(elements=elements, modes=0, step=1e-4, step_tolerance=None))
    assert int(result.status) == fj.Status.SUCCESSFUL
    assert float(result.peak_force) == pytest.approx(3293.85, rel=1e-4)
    assert float(result.tip_deflection) == 0.0


# --- Tapers -------------------------------------------------------------------------------------


class Waisted(fj.AbstractTaper):
    """A user's own: thick at both ends, traced in nothing."""

    def __call__(self, position, tip_distance):
        return 0.6 + 0.4 * (position - tip_distance) ** 2


TAPERS = {
    "sharper than a wedge": lambda: fj.PowerTaper(0.99),
    "to 1 % at the tip": lambda: fj.ProfileTaper([1.0, 0.8, 0.01]),
    "a user's own": Waisted,
}
PLACES = jnp.array([0.6, 1.0, 1.19])


def tapered(fidelity, taper):
    """A program: root's thickness -> peak forces at the places, and statuses."""

    def run(thickness):
        def one(place):
            scene = fj.scenes.normal_impact(
                fence=fj.Fence(thickness=thickness, taper=TAPERS[taper]()), distance=place,
                parcel=fj.Parcel(2.0, stiffness=1e9), duration=0.08,
            )
            result = fj.simulate(scene, fidelity=fidelity, only=("peak_force",))
            return result.peak_force, result.status

        return one_by_one(one)(PLACES)

    return run


@pytest.mark.parametrize("taper", TAPERS)
def test_tapers(taper):
    """At `coarse`, against 12 modes of 40 elements and steps of 25 us."""
    fine = fj.Fidelity(modes=12, step=2.5e-5, step_tolerance=None, elements=40)
    h, true = 0.045, jax.jit(tapered(fine, taper))
    peak, true_status = jax.device_get(true(h))
    assert np.all(true_status <= fj.Status.LEFT_OVER_TIP)
    slope = (true(h + 1e-6)[0] - true(h - 1e-6)[0]) / 2e-6
    rung = tapered(fj.Fidelity.coarse(), taper)
    coarse = jax.jit(jax.jacfwd(lambda h: _twice(rung(h)), has_aux=True))
    found_slope, (found, status) = jax.device_get(coarse(h))
    good = status <= fj.Status.LEFT_OVER_TIP
    # Beside a tip as sharp as these three modes may be too few, and said to be.
    assert np.sum(~good) <= (taper in ("sharper than a wedge", "to 1 % at the tip"))
    np.testing.assert_allclose(found[good], peak[good], rtol=PROMISE)
    np.testing.assert_allclose(found_slope[good], slope[good], rtol=0.02)


def _twice(outcome):
    return outcome[0], outcome


# --- The smoothing of friction ------------------------------------------------------------------


@functools.cache
def smoothed(slip_speed):
    """Peak force and status, of an ordinary impact and of one on a belt at walking pace."""
    fidelity = fj.Fidelity.coarse(
        slip_speed=slip_speed, static_speed=5 * slip_speed, modes=1, static_correction=False
    )

    @jax.jit
    @one_by_one
    def run(x):
        result = fj.simulate(impact(x), fidelity=fidelity, only=("peak_force",))
        return result.peak_force, result.status

    rows = [ORDINARY, ORDINARY | {"belt": 0.5, "ride": 0.5}]
    return jax.device_get(run({k: np.array([float(row[k]) for row in rows]) for k in ORDINARY}))


@pytest.mark.parametrize("slip_speed", [1e-6, 1e-3, 1e-2, 1.0])
def test_smoothing(slip_speed):
    """Within 0.6 %, half as much again as what `FRICTION_SMOOTHED` lets pass at the peak, or said.
    Friction so sharp that Newton's method does not settle at this step is said as well."""
    true, true_status = smoothed(1e-3)
    assert np.all(true_status <= fj.Status.LEFT_OVER_TIP)
    peak, status = smoothed(slip_speed)
    said = status > fj.Status.LEFT_OVER_TIP
    np.testing.assert_allclose(peak[~said], true[~said], rtol=0.006)
    assert not np.any(said) or slip_speed != 1e-3
    if slip_speed == 1.0:
        assert np.all(status == fj.Status.FRICTION_SMOOTHED)


# --- Horizons, steps and precision --------------------------------------------------------------


@pytest.mark.parametrize(
    ("duration", "step"),
    [
        (1e-7, 1e-7), (1e-6, 1.0), (0.02, 1e-6), (0.05, 5e-3), (0.05, 2e-2), (0.05, 1.0),
        (136.0, 5e-3),
    ],
)
def test_horizons_and_steps(duration, step):
    truth = 3293.85
    fidelity = fj.Fidelity(step=step, step_tolerance=None)
    result = fj.simulate(
        fj.scenes.rigid_wall(duration=duration), fidelity=fidelity, history=False
    )
    if result.status > fj.Status.LEFT_OVER_TIP:
        # The contact lasts 8 ms; a single step has no second difference.
        assert step > 5e-4 or duration <= step
        return
    assert step < 1e-3
    assert float(result.peak_force) == pytest.approx(truth, rel=1e-3) or duration < 1e-3


def test_gradient_in_single_precision():
    def slope(**settings):
        def peak(thickness):
            scene = fj.scenes.oblique_impact(fence=fj.Fence(thickness=thickness), duration=0.08)
            fidelity = fj.Fidelity.coarse(
                step_tolerance=None, slip_speed=1e-3, static_speed=5e-3, **settings
            )
            return fj.simulate(scene, fidelity=fidelity, only=("peak_force",)).peak_force

        return float(jax.jit(jax.grad(peak))(0.05))

    # Forces balanced to 2e-3, over the some ten steps to the peak; of the same fixed steps, as an
    # error control would take others in other rounding.
    assert slope(precision="float32") == pytest.approx(slope(), rel=2e-2)


@pytest.mark.parametrize("tolerance", [None, 5e-4])
def test_a_scene_in_single_precision_is_refined_as_far_as_that_resolves(tolerance):
    single = jax.tree.map(lambda x: x.astype(jnp.float32), fj.scenes.oblique_impact())
    fidelity = fj.Fidelity.standard(step_tolerance=tolerance)
    ladder = fidelity.ladder(single)
    assert 1 <= len(ladder) < len(fidelity.ladder())
    for each in ladder:
        # Refused before anything is traced.
        jax.eval_shape(lambda f=each: struck(f, single).peak_force)
    moved = fj.scene_numbers.replace(single, ["thickness", "length_ratio"], [0.05, 0.5])
    assert {leaf.dtype for leaf in jax.tree.leaves(moved)} == {jnp.dtype(jnp.float32)}


def test_single_precision_that_cannot_is_refused():
    scene = fj.scenes.oblique_impact()
    with pytest.raises(ValueError, match=r"`fidelity.step` must be at least 0.0001 in single"):
        fj.simulate(scene, fidelity=fj.Fidelity.reference(precision="float32"))
