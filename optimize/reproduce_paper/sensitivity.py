"""Derivatives of the peak force over the place of the first contact, by automatic
differentiation."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

import fencejax as fj

from .case import Case

VARIABLES = {
    "thickness": ("thickness", "h_1"),
    "length_ratio": ("length ratio", r"l_s / l_p"),
    "youngs_modulus": ("Young's modulus", "E"),
    "density": ("density", r"\rho"),
    "damping_ratio": ("damping ratio", r"\zeta"),
}
"""The variables with words and symbols. The length ratio varies at constant reach R_z."""

_DURATION = 0.15


class Sensitivities(NamedTuple):
    """Over distances R [m], of shape (R,): `force`, N_max [N], of shape (fences, R), and `slope`,
    of shape (fences, R, variables): d ln N_max / d ln p [1] in the variables, but
    d ln N_max / d(l_s / l_p) [1] in the length ratio, which is 0 for the one-link fence."""

    distances: np.ndarray
    force: np.ndarray
    slope: np.ndarray
    status: np.ndarray


def peak_force(case: Case, values: Array, fidelity: fj.Fidelity) -> tuple[Array, Array]:
    """N_max [N] of a lane's impact with the variables at `values`, and its status."""
    moved = fj.scene_numbers.replace(case, tuple(VARIABLES), values)
    result = fj.simulate(moved.impact(_DURATION, fidelity), fidelity=fidelity, only="peak_force")
    return result.peak_force, result.status


@eqx.filter_jit
def _slopes(cases: Case, fidelity: fj.Fidelity):
    def one(case: Case):
        at = jnp.stack(fj.scene_numbers.read(case, tuple(VARIABLES)))
        (force, status), slope = jax.value_and_grad(
            lambda values: peak_force(case, values, fidelity), has_aux=True
        )(at)
        unit = jnp.stack([jnp.ones_like(a) if i == 1 else a for i, a in enumerate(at)])
        return force, status, slope * unit / force

    return fj.each_lane(one, cases)


def along(fences: Case, distances, fidelity: fj.Fidelity) -> Sensitivities:
    """Sensitivities of every fence of `fences` (its lanes) at every one of `distances` [m]."""
    distances = np.asarray(distances, dtype=float)
    count = fences.distance.shape[0]
    lanes = jax.tree.map(lambda leaf: np.repeat(leaf, distances.size, axis=0), fences)
    lanes = eqx.tree_at(lambda c: c.distance, lanes, np.tile(distances, count))
    force, status, slope = jax.device_get(_slopes(lanes, fidelity))
    shape = (count, distances.size)
    return Sensitivities(
        distances, force.reshape(shape), slope.reshape(*shape, -1), status.reshape(shape)
    )
