"""The stages of a sort at the limits of their arguments: along the fence, between border and fence,
and the normal impact. As `test_extreme_sorts`; here contacts end at the fence's tip, and the status
says so.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from robustness.extreme_scenes import stack
from robustness.extreme_sorts import ROWS, lane, rung, truth
from runs import one_by_one

import fencejax as fj

PROMISE = {"coarse": 0.0055, "standard": 0.003}
"""Of the peak force; the fidelities promise 2.5 % of any scene with a good status."""
STUCK = {("flush", "belt-friction-5", "standard"): 0.012, ("flush", "undamped", "coarse"): 0.009}
"""The parcel turns about a place at which it sticks to the belt; a fence that rings all along."""
GIVEN = {
    "flush": {
        "ordinary", "one-link", "steel", "undamped", "mass-1g", "mass-100g", "mass-100kg",
        "size-10cm", "size-1m", "centre-at-an-edge", "centre-low", "stiffness-1e6", "no-damping",
        "no-friction", "static-is-kinetic", "belt-still", "drive-fast", "hinge", "near-the-tip",
        "drive-at-its-start",
    },
    "border": {
        "ordinary", "thickness-0.1m", "thickness-0.3m", "one-link", "tip-2cm", "steel", "foam",
        "undamped", "overdamped", "mass-100g", "mass-1kg", "size-1m", "centre-at-an-edge",
        "centre-low", "no-damping", "no-friction", "friction-5", "static-is-kinetic",
        "belt-still", "drive-fast", "hinge", "jam",
    },
}
# Two modes, steps of 1 ms or friction smoothed over 1 mm/s are not enough for them, and the status
# says so; or, undamped, the errors that blow after blow makes in the gradient, summed in size.
WARNED = {
    ("flush", "undamped"), ("flush", "mass-100kg"),
    ("flush", "one-link"), ("flush", "steel"), ("flush", "drive-fast"), ("flush", "centre-low"),
    ("flush", "stiffness-1e6"), ("flush", "ordinary"), ("flush", "static-is-kinetic"),
    ("flush", "drive-at-its-start"), ("border", "size-1m"), ("border", "hinge"),
    ("border", "drive-fast"), ("border", "overdamped"), ("border", "mass-100g"),
    ("border", "friction-5"), ("border", "jam"),
}
SAID = {
    ("flush", "friction-5"): fj.Status.PEAK_AT_TIP,
    ("flush", "ordinary"): fj.Status.LEFT_OVER_TIP,
    ("flush", "hinge"): fj.Status.IN_CONTACT_AT_END,
    ("flush", "thickness-5mm"): fj.Status.MODES_TOO_FEW,
    ("flush", "size-1cm"): fj.Status.DEEP_PENETRATION,
    ("border", "rubber"): fj.Status.LARGE_DEFLECTION,
    ("border", "mass-1t"): fj.Status.LARGE_DEFLECTION,
    ("border", "near-the-tip"): fj.Status.PEAK_AT_TIP,
    ("border", "one-link"): fj.Status.SUCCESSFUL,
}
CASES = [(kind, name) for kind in GIVEN for name in ROWS[kind]]


@pytest.mark.parametrize("fidelity", PROMISE)
@pytest.mark.parametrize(("kind", "name"), CASES)
def test_right_or_said(kind, name, fidelity):
    at = lane(kind, name)
    status, values = (each[at] for each in rung(kind, fidelity)[:2])
    if name in GIVEN[kind] and (fidelity != "coarse" or (kind, name) not in WARNED):
        assert status <= fj.Status.LEFT_OVER_TIP
    if fidelity == "standard" and (kind, name) in SAID:
        assert status == SAID[kind, name]
    if status > fj.Status.LEFT_OVER_TIP:
        return
    assert np.all(np.isfinite(values))
    true_status, true = truth(kind).status[at], truth(kind).peak[at]
    assert true_status <= fj.Status.LEFT_OVER_TIP
    promise = STUCK.get((kind, name, fidelity), PROMISE[fidelity])
    assert abs(values[0] - true) <= promise * true


# --- Gradients ----------------------------------------------------------------------------------


GIVEN_AT_COARSE = [(k, n) for k in GIVEN for n in sorted(GIVEN[k]) if (k, n) not in WARNED]


@pytest.mark.parametrize(("kind", "name"), GIVEN_AT_COARSE)
def test_gradients_are_within_the_promise(kind, name):
    """At `coarse`, of the peak force, relative to its norm."""
    at = lane(kind, name)
    slopes, true = rung(kind, "coarse")[2][at], truth(kind).slopes[at]
    assert np.all(np.isfinite(slopes))
    assert np.linalg.norm(slopes - true) <= 0.10 * np.linalg.norm(true)


# --- The normal impact --------------------------------------------------------------------------

STRUCK = dict(speed=2.426, place=0.8, mass=15.0, stiffness=1.72e9, damping=3.3e5, thickness=0.045)
BLOWS = {
    "ordinary": {},
    "speed-1e-6": {"speed": 1e-6},
    "speed-0.01": {"speed": 0.01},
    "speed-10": {"speed": 10.0},
    "speed-50": {"speed": 50.0},
    "receding": {"speed": -1.0},
    "still": {"speed": 0.0},
    "mass-1g": {"mass": 1e-3},
    "mass-1t": {"mass": 1e3},
    "hinge": {"place": 0.0},
    "at-the-joint": {"place": 0.375},
    "beside-the-joint": {"place": 0.3751},
    "at-a-node": {"place": 0.375 + 0.625 * 0.5},
    "at-the-tip": {"place": 1.0},
    "stiffness-1e3": {"stiffness": 1e3},
    "stiffness-1e12": {"stiffness": 1e12},
    "no-damping": {"damping": 0.0},
    "damping-1e9": {"damping": 1e9},
    "thickness-0.3m": {"thickness": 0.3},
    "thickness-1mm": {"thickness": 1e-3},
}
RIGHT = {
    "ordinary", "at-the-joint", "beside-the-joint", "at-a-node", "no-damping", "thickness-0.3m"
}
STRUCK_VARIED = ("speed", "mass", "stiffness", "thickness")


@functools.cache
def blows(name):
    """Status, peak force and x df/dx, (lanes,), (lanes,) and (lanes, varied)."""
    fine = fj.Fidelity(modes=None, step=2e-5, step_tolerance=None)
    fidelity = fine if name == "truth" else getattr(fj.Fidelity, name)()

    def peak(varied, x):
        x = x | varied
        scene = fj.scenes.normal_impact(
            fence=fj.Fence(thickness=x["thickness"]), distance=1.2 * x["place"], speed=x["speed"],
            parcel=fj.Parcel(x["mass"], stiffness=x["stiffness"], damping=x["damping"]),
            duration=0.1,
        )
        result = fj.simulate(scene, fidelity=fidelity, only=("peak_force",))
        return result.peak_force, (result.status, result.peak_force)

    @jax.jit
    @one_by_one
    def run(x):
        varied = {k: x[k] for k in STRUCK_VARIED}
        slopes, (status, force) = jax.jacfwd(peak, has_aux=True)(varied, x)
        return status, force, jnp.stack([slopes[k] * x[k] for k in STRUCK_VARIED], axis=-1)

    return jax.device_get(run(stack([STRUCK | changes for changes in BLOWS.values()])))


@pytest.mark.parametrize("fidelity", ["coarse", "standard"])
@pytest.mark.parametrize("name", BLOWS)
def test_normal_impacts(name, fidelity):
    at = list(BLOWS).index(name)
    (status, force, slopes), (_, true, true_slopes) = (
        [each[at] for each in blows(k)] for k in (fidelity, "truth")
    )
    if name in RIGHT:
        assert status <= fj.Status.LEFT_OVER_TIP
    if name in ("receding", "still"):
        assert status == fj.Status.NEVER_TOUCHED
        assert force == 0.0
    if status > fj.Status.LEFT_OVER_TIP:
        return
    assert np.all(np.isfinite(slopes))
    assert abs(force - true) <= PROMISE[fidelity] * true
    assert np.linalg.norm(slopes - true_slopes) <= 0.10 * np.linalg.norm(true_slopes)
