"""Small sweeps for many tests, and the comparison of two tables."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

import fencejax as fj
from fencejax.study import IMPOSSIBLE, Lane, SceneFamily, Sweep, sampling
from optimize.sweep.configuration import SweepConfig

# 60 impacts in chunks of 16 lanes, two groups each. The fence's reach of 1 m is less than the
# farthest place of touch.
SMALL = SweepConfig(
    vary=("mass=1:20:5", "reach=1:1.3:3:linear", "distance=0.6:1.2:4"),
    duration=0.08,
    fidelity="fast",
    chunk=16,
    group=8,
    tolerated=0.3,
    plots=False,
)


def small(out, **changes):
    return dataclasses.replace(SMALL, out=out, **changes)


def tiny():
    """16 impacts by the smallest program there is with a fence that bends."""
    samples = sampling.sobol(["mass", "distance"], 16)
    family = SceneFamily(
        "oblique_impact", samples.names, belt=None, fence_friction=None, duration=0.1
    )
    fidelity = fj.Fidelity.fast(modes=1, static_correction=False, geometry="small", elements=4)
    return Sweep(family, samples, ("peak_force", "impulse"), fidelity=fidelity)


class PlainLane(Lane):
    """A formula and a slow loop instead of a simulation, for tests of what keeps the
    numbers, whatever they are."""

    def __call__(self, values):
        mass, distance = values
        turned = jax.lax.fori_loop(0, 20_000, lambda _, x: jnp.sin(x) + mass, distance)
        force = jnp.where(mass > 9.0, jnp.nan, mass * distance + 0 * turned)
        status = jnp.where(mass > 9.0, jnp.asarray(IMPOSSIBLE, jnp.int32), jnp.int32(0))
        return {"peak_force": force, "tip_deflection": turned, "status": status}


class PlainSweep(Sweep):
    @property
    def lane(self):
        return PlainLane(self.family, self.outputs, None, self.fidelity, refine=self.refine)


def plain(most=10.0):
    """100 lanes over two variables: with chunks of 8, the last of the 13 is not full."""
    mass = sampling.variable("mass", 1.0, most, scaling="linear")
    samples = sampling.grid([mass, sampling.variable("distance", 0.6, 1.0)], 10)
    return PlainSweep(SceneFamily("oblique_impact", samples.names, duration=0.05), samples)


PLAIN = dict(chunk=8, group=4)
CHUNKS = 13


def assert_same(one, other):
    """Tables equal bit by bit."""
    for column in ("variables", "outputs", "gradient"):
        a, b = getattr(one, column), getattr(other, column)
        assert list(a) == list(b)
        for name in a:
            np.testing.assert_array_equal(a[name], b[name], err_msg=name)
    np.testing.assert_array_equal(one.status, other.status)
    assert one.units == other.units
    assert one.shape == other.shape
