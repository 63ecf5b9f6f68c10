"""A recording with noise, made from known numbers."""

import jax
import jax.numpy as jnp
import numpy as np

import fencejax as fj
from fencejax.results import interpolate
from fencejax.scenes import AnyScene, numbers as scene_numbers
from fencejax.study import Recording

TRUTH = {
    "youngs_modulus": 2.6e9,
    "damping_ratio": 0.08,
    "stiffness": 1.3e9,
    "damping": 4.2e5,
    "fence_kinetic_friction": 0.28,
}
"""The numbers that the demonstration hides [SI]: those of another fence and another parcel."""
DURATION = 0.13
"""Duration of the demonstration's impact [s]."""
DELAY = 0.0213
"""Start of the impact on the recording's clock [s]."""


def record(
    scene: AnyScene, fidelity: fj.Fidelity, noise: float, rows: int, seed: int
) -> Recording:
    """Force and tip deflection of a scene with the numbers of `TRUTH`, at `rows` times over it,
    with normal noise of `noise` times each signal's largest value."""
    hidden = scene_numbers.replace(scene, tuple(TRUTH), list(TRUTH.values()))
    history = fj.simulate(hidden, fidelity=fidelity, only=("history",)).history
    assert history is not None
    time = np.linspace(0.0, scene.duration, rows + 1)[1:]
    generator = np.random.default_rng(seed)
    signals = {}
    for name, knots in (
        ("force", history.fence_force), ("tip_deflection", history.tip_deflection),
    ):  # fmt: skip
        clean = np.asarray(jax.device_get(interpolate(jnp.asarray(time), history.time, knots)))
        scale = noise * float(np.max(np.abs(clean)))
        signals[name] = clean + scale * generator.normal(size=rows)
    return Recording(time + DELAY, signals)
