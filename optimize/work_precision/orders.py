"""Observed order of convergence in the step: e(h) ~ h^p between neighbouring steps."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

import fencejax as fj

STEPS = (1e-3, 5e-4, 2.5e-4)
_FINE = 3.125e-5
SEGMENTS = {
    "normal impact, contact closed (0.02 s)": 0.02,
    "normal impact, through the contact (0.2 s)": 0.2,
    "fence ringing freely (0.2 s)": 0.2,
}
"""The segments, with their durations [s]."""


def observed(steps: Sequence[float], errors: Sequence[float]) -> np.ndarray:
    """p = ln(e_k / e_(k+1)) / ln(h_k / h_(k+1)) [1] between neighbouring steps [s], one fewer than
    there are steps; NaN where an error is not a positive number."""
    e, h = np.asarray(errors, float), np.asarray(steps, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.log(e[:-1] / e[1:]) / np.log(h[:-1] / h[1:])
    return np.where(np.isfinite(ratio), ratio, np.nan)


def _run(segment: str, fidelity: fj.Fidelity, factors):
    """Quantities at the end of a segment, in factors [1] on Young's modulus and density."""
    material = fj.Material(3.0e9 * factors[0], 1130.0 * factors[1])
    fence, duration = fj.Fence(material=material), SEGMENTS[segment]
    if segment.startswith("normal"):
        scene = fj.scenes.normal_impact(fence=fence, duration=duration)
        result = fj.simulate(scene, fidelity=fidelity, only=("impulse", "final"))
        return jnp.stack([result.impulse, result.final.y_rate])
    # A drive that starts with a jump in its acceleration, and rings the fence.
    scene = fj.scenes.free_motion(fence=fence, duration=duration, belt=None)
    result = fj.simulate(scene, fidelity=fidelity, only=("tip_deflection", "peak_stress"))
    return jnp.stack([result.tip_deflection, result.peak_stress])


def ladder(segment: str) -> dict[str, dict]:
    """Errors of value and gradient over the steps of a segment, and their observed orders.

    The error is the largest over the segment's quantities, relative; of the gradient, of the
    elasticities in E and rho relative to their norm.
    """
    found = {}
    for step in (*STEPS, _FINE):
        fidelity = fj.Fidelity(step=step, step_tolerance=None)

        def along(factors, fidelity=fidelity):
            values = _run(segment, fidelity, factors)
            return values, values

        slopes, values = jax.jit(jax.jacfwd(along, has_aux=True))(jnp.ones(2))
        found[step] = (np.asarray(values), np.asarray(slopes) / np.asarray(values)[:, None])
    values, slopes = found.pop(_FINE)
    size = np.maximum(np.linalg.norm(slopes, axis=1), 1e-12)
    errors = {"value": [], "gradient": []}
    for value, slope in found.values():
        errors["value"].append(float(np.max(np.abs(value / values - 1))))
        off = np.linalg.norm(slope - slopes, axis=1) / size
        errors["gradient"].append(float(np.max(off)))
    return {
        name: {"steps [s]": list(STEPS), "errors": row, "orders": observed(STEPS, row).tolist()}
        for name, row in errors.items()
    }
