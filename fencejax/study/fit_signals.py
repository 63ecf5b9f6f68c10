"""Signals of a simulated scene at the times of a recording, with their derivatives."""

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Fidelity
from ..results import Sample, interpolate
from ..scenes import numbers as scene_numbers
from ..simulate import simulate


def _signal(history: Sample, name: str) -> Array:
    if name == "force":
        return history.fence_force
    if name == "tip_deflection":
        return history.tip_deflection
    return getattr(history.body, name)


def _read(time: Array, history: Sample, name: str) -> Array:
    """A signal at some times. Before the scene's start the force is 0, and motions are extrapolated
    backwards with their initial rate."""
    knots, values = history.time, _signal(history, name)
    found = interpolate(time, knots, values)
    if name == "force":
        return jnp.where(time < knots[0], 0.0, found)
    apart = knots[1] > knots[0]
    rate = jnp.where(apart, values[1] - values[0], 0.0) / jnp.where(apart, knots[1] - knots[0], 1.0)
    return found + rate * jnp.minimum(time - knots[0], 0.0)


def _model_of(structure, chosen: tuple[str, ...], signals: tuple[str, ...], fidelity: Fidelity):
    """Signals at given times and the status."""

    def model(parameters, offset, leaves, time):
        scene = scene_numbers.replace(jax.tree.unflatten(structure, leaves), chosen, parameters)
        result = simulate(scene, fidelity=fidelity, only=("history",))
        history = result.history
        assert history is not None
        shown = [_read(time + offset, history, name) for name in signals]
        return jnp.stack(shown), result.status

    return model


@functools.lru_cache(maxsize=16)
def program_of(structure, chosen: tuple[str, ...], signals: tuple[str, ...], fidelity: Fidelity):
    """Signals at given times with their derivatives in the parameters and in the offset."""

    model = _model_of(structure, chosen, signals, fidelity)

    def run(parameters, offset, leaves, time):
        def twice(p, o):
            values, status = model(p, o, leaves, time)
            return values, (values, status)

        slopes, (values, status) = jax.jacfwd(twice, argnums=(0, 1), has_aux=True)(
            list(parameters), offset
        )
        return values, jnp.stack([*slopes[0], slopes[1]], axis=-1), status

    return jax.jit(run)


@functools.lru_cache(maxsize=16)
def curvature_of(
    structure, chosen: tuple[str, ...], signals: tuple[str, ...], fidelity: Fidelity, shifted: bool
):
    """Second derivatives of half the weighted sum of squares in the parameters and, where
    `shifted`, in the time offset as the last one."""
    model = _model_of(structure, chosen, signals, fidelity)

    def cost(numbers, leaves, time, recorded, weight):
        parameters = [numbers[k] for k in range(len(chosen))]
        offset = numbers[len(chosen)] if shifted else jnp.zeros(())
        values, _ = model(parameters, offset, leaves, time)
        # Missing samples have the weight 0.
        left = jnp.where(weight > 0, weight * (values - jnp.nan_to_num(recorded)), 0.0)
        return 0.5 * jnp.sum(left**2)

    return jax.jit(jax.hessian(cost))
