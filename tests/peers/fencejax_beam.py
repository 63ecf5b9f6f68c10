"""This package on the same race: `fencejax.scenes.normal_impact` with a stepped taper.

The fence's root is clamped where its rigid link ends: l_s = 0. Damping B = beta K is the damping
ratio zeta = beta omega_1 / 2 of the first mode.

Settings: the step and the number of modes, each the coarsest that meets the accuracy; modes left
out yield statically. The step's error is of second order and regular, so at 5e-7 two runs, at the
step and at half of it, are extrapolated (Richardson). For the gradient there, the peak is refined
from the history by the polynomial that the other codes get: what the running peak leaves out
between two steps is small in the value, and irregular in its gradient.
"""

from importlib.metadata import version

import jax
import jax.numpy as jnp
import numpy as np

import fencejax as fj

from . import race

SETTINGS = {
    race.ENGINEERING.name: fj.Fidelity(modes=4, step=5e-4, step_tolerance=None),
    race.TIGHT.name: fj.Fidelity(modes=12, step=2.5e-4, step_tolerance=None),
}


def scene(parameters, eigenvalue):
    """The race's scene; `eigenvalue`: the first of the dimensionless ones."""
    thickness, modulus, density, beta, length = parameters
    omega = thickness / length**2 * jnp.sqrt(eigenvalue * modulus / (12 * density))
    fence = fj.Fence(
        rigid_length=0.0,
        flexible_length=length,
        width=race.WIDTH,
        thickness=thickness,
        material=fj.Material(modulus, density, beta * omega / 2),
        taper=fj.SteppedTaper(fj.ConstantStrength(), race.ELEMENTS),
    )
    return fj.scenes.normal_impact(
        fence=fence,
        distance=race.CONTACT * length,
        speed=race.SPEED,
        parcel=fj.Parcel(mass=race.MASS),
        duration=race.DURATION,
    )


def make(accuracy, modes=None):
    """fencejax at `accuracy`; `modes` in place of the tuned number."""
    fidelity = SETTINGS[accuracy.name]
    if modes is not None:
        fidelity = fidelity.replace(modes=modes)
    kind = _extrapolated if accuracy == race.TIGHT else _plain
    value, value_and_gradient = kind(fidelity, float(race.unit_modes(1).eigenvalues[0]))
    return race.Peer("fencejax", version("fencejax"), value, value_and_gradient)


def _plain(fidelity, eigenvalue):
    """The library's own peak of one run."""

    def both(parameters):
        result = fj.simulate(scene(parameters, eigenvalue), fidelity=fidelity, history=False)
        return result.peak_force, result.peak_time

    run = jax.jit(both)
    differentiate = jax.jit(jax.value_and_grad(both, has_aux=True))

    def value(parameters):
        peak, time = run(jnp.asarray(parameters))
        return float(peak), float(time)

    def value_and_gradient(parameters):
        (peak, _), gradient = differentiate(jnp.asarray(parameters))
        return float(peak), np.asarray(gradient)

    return value, value_and_gradient


def _extrapolated(fidelity, eigenvalue):
    """Two runs extrapolated: their running peaks, and the gradients of their refined ones."""
    pair = (fidelity, fidelity.replace(step=fidelity.step / 2))

    def peaks_and_times(parameters):
        part = scene(parameters, eigenvalue)
        results = [fj.simulate(part, fidelity=one, history=False) for one in pair]
        return jnp.stack([jnp.stack([found.peak_force, found.peak_time]) for found in results])

    def twice(parameters):
        part = scene(parameters, eigenvalue)
        forces = [fj.simulate(part, fidelity=one).history.fence_force for one in pair]
        return forces, forces

    run = jax.jit(peaks_and_times)
    differentiate = jax.jit(jax.jacfwd(twice, has_aux=True))

    def value(parameters):
        coarse, fine = np.asarray(run(jnp.asarray(parameters)))
        peak, time = (4 * fine - coarse) / 3
        return float(peak), float(time)

    def value_and_gradient(parameters):
        slopes, forces = differentiate(jnp.asarray(parameters))
        peaks, gradients = [], []
        for slope, force in zip(slopes, forces, strict=True):
            time = np.linspace(0.0, race.DURATION, force.size)
            peak, at = race.refined_peak(time, np.asarray(force))
            first, weights = race.interpolation(time, at)
            peaks.append(peak)
            gradients.append(weights @ np.asarray(slope)[first : first + 9])
        return (4 * peaks[1] - peaks[0]) / 3, (4 * gradients[1] - gradients[0]) / 3

    return value, value_and_gradient
