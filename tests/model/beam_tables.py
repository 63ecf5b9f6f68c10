"""Tables of the beam compiled and in NumPy, and their differences by round-off."""

import jax
import jax.numpy as jnp
import numpy as np

from fencejax.model import beam

EPS = np.finfo(float).eps

compiled_tables = jax.jit(
    lambda taper, elements, modes: beam.build_tables(taper, elements, modes, jnp),
    static_argnums=(1, 2),
)


def numpy_tables(profile, elements, modes):
    """Tables of g = profile(x / l_p, 1 - x / l_p), in NumPy."""
    return beam.build_tables(profile, elements, modes, np)


def assert_near(ours, theirs, allowed, name=""):
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=allowed, err_msg=name)


def round_off(tables, index=0, factor=10):
    """Round-off of an eigenvalue by Cholesky and eigh: eps times the largest eigenvalue."""
    every = np.asarray(tables.eigenvalues)
    return factor * EPS * every[-1] / every[index]
