"""Random impacts and sorts, the same for the same seed, as one stacked scene."""

import jax
import jax.numpy as jnp
import numpy as np

import fencejax as fj


def _between(rng, low, high):
    """Log-uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _fence(rng):
    reach = rng.uniform(1.0, 1.4)
    flexible = reach / (1 + rng.uniform(0.0, 0.9))
    material = fj.Material(
        _between(rng, 2e9, 6e9), _between(rng, 900, 1600), _between(rng, 0.01, 0.1)
    )
    width, thickness = _between(rng, 0.08, 0.2), _between(rng, 0.035, 0.07)
    return fj.Fence(reach - flexible, flexible, width, thickness, material)


def _parcel(rng):
    return fj.Parcel(
        mass=_between(rng, 2, 25), length=rng.uniform(0.3, 0.5), breadth=rng.uniform(0.2, 0.4)
    )


def _impact(rng, duration):
    fence = _fence(rng)
    return fj.scenes.oblique_impact(
        fence=fence,
        distance=fence.reach * rng.uniform(0.5, 0.9),
        drive_angle=rng.uniform(0.15, 0.45),
        parcel=_parcel(rng),
        duration=duration,
    )


def _sort(rng, duration):
    return fj.scenes.whole_sort(
        fence=_fence(rng),
        front=rng.uniform(-0.3, 0.4),
        offset=rng.uniform(0.0, 0.25),
        angle=rng.uniform(-0.2, 0.2),
        parcel=_parcel(rng),
        duration=duration,
    )


def _stacked(make, seed, count, duration):
    rng = np.random.default_rng(seed)
    return stack([make(rng, duration) for _ in range(count)])


def stack(scenes):
    """Scenes of one structure as one, with a leading axis."""
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *scenes)


def impacts(seed, count, duration=0.15):
    """Oblique impacts, 2-25 kg, at 50-90 % of the reach."""
    return _stacked(_impact, seed, count, duration)


def sorts(seed, count, duration=1.36):
    """Whole sorts, 2-25 kg, from in front of the fence to beside it, turned by up to 0.2 rad."""
    return _stacked(_sort, seed, count, duration)
