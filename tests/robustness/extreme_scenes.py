"""Scenes from the ordinary to the absurd, as numbers of one compiled program."""

import functools

import jax
import numpy as np

import fencejax as fj
from optimize.stability_map.scenes import ORDINARY, impact as impact

# As smooth in friction as differences of 2e-4 between two values can see.
TRUTH = fj.Fidelity.reference(
    step=5e-5, geometry="arc", modes=8, slip_speed=2e-5, static_speed=1e-3
)

# Of programs that run longer than they compile at the suite's least effort.
RUNS_LONG = functools.partial(jax.jit, compiler_options={"xla_backend_optimization_level": 2})

# Log-uniform, from end to end of what a sweep may ask for.
WIDE = dict(
    thickness=(1e-3, 0.3), reach=(0.1, 5.0), flexible=(0.02, 1.0), width=(0.02, 1.0),
    modulus=(1e6, 2.1e11), density=(50, 8000), damping_ratio=(1e-3, 2.0), mass=(1e-3, 1e3),
    length=(1e-2, 2.0), aspect=(0.01, 1.0), stiffness=(1e3, 1e14), damping=(1e-3, 1e9),
    belt=(0.01, 20.0), belt_kinetic=(1e-3, 5.0), belt_static=(1e-3, 5.0), kinetic=(1e-3, 5.0),
    static=(1e-3, 5.0), top_speed=(0.01, 3.5), place=(0.05, 1.0), angle=(0.02, 0.999),
    approach=(1e-6, 50.0),
)
# What designs may really be.
USUAL = dict(
    thickness=(0.02, 0.1), reach=(0.8, 1.6), flexible=(0.5, 1.0), width=(0.05, 0.3),
    modulus=(1e9, 7e10), density=(500, 3000), damping_ratio=(0.01, 0.3), mass=(0.3, 60),
    length=(0.1, 0.8), aspect=(0.3, 1.0), stiffness=(1e7, 1e11), damping=(1e3, 1e7),
    belt=(0.5, 4.0), belt_kinetic=(0.1, 1.0), belt_static=(0.1, 1.0), kinetic=(0.05, 1.0),
    static=(0.05, 1.0), top_speed=(0.5, 2.5), place=(0.3, 0.95), angle=(0.1, 0.8),
    approach=(0.1, 5.0),
)


def draw(seed, lanes, ranges=WIDE):
    """Numbers of random scenes, log-uniform within `ranges`, (lanes,) each; the centre of gravity
    anywhere in the parcel."""
    rng = np.random.default_rng(seed)
    numbers = {k: np.full(lanes, v) for k, v in ORDINARY.items()}
    for name, (low, high) in ranges.items():
        numbers[name] = np.exp(rng.uniform(np.log(low), np.log(high), lanes))
    for name in ("across", "along"):
        numbers[name] = rng.uniform(-0.5, 0.5, lanes)
    numbers["ride"] = numbers["belt"]
    return numbers


def riding(x, varied):
    """The numbers with some of them changed. The parcel's speed goes with the belt's: at rest on
    it, dry friction has a kink in the one without the other."""
    return x | varied | {"ride": x["ride"] + varied.get("belt", x["belt"]) - x["belt"]}


def stack(rows):
    """Rows of numbers as one array a number."""
    return {k: np.array([float(row[k]) for row in rows]) for k in rows[0]}
