"""Impacts over parcel mass and place of the first contact, as in Figs. 9 and 10."""

import time
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import fencejax as fj
from fencejax.results import NUMERICAL, counted, refined
from fencejax.study import in_chunks

from .case import Case

DURATION = 0.25
"""Length of each impact [s]: longer than the longest contact."""


class Maps(NamedTuple):
    """Impacts on a grid; `masses` [kg] of shape (M,), `distances` R [m] of shape (R,), the rest of
    shape (fences, M, R)."""

    masses: np.ndarray
    distances: np.ndarray
    force: np.ndarray
    """N_max [N]."""
    stiff: np.ndarray
    """N_stiff,max [N]."""
    tip: np.ndarray
    """Largest tip deflection [m]."""
    status: np.ndarray
    """A `fencejax.Status`."""

    @property
    def ratio(self) -> np.ndarray:
        """N_stiff,max / N_max [1]."""
        return self.stiff / self.force

    @property
    def sound(self) -> np.ndarray:
        """Where the corner stays on the fence and the beam's deflections are small. Numbers in
        doubt are those of the finest fidelity and count as sound."""
        return (self.status < fj.Status.LEFT_OVER_TIP) | np.isin(self.status, sorted(NUMERICAL))

    def counts(self) -> dict[str, int]:
        """Number of lanes by the name of their status."""
        return counted(self.status)


class _Outcome(NamedTuple):
    force: jax.Array
    stiff: jax.Array
    tip: jax.Array
    status: jax.Array


@eqx.filter_jit
def _impacts(cases: Case, fidelity: fj.Fidelity) -> _Outcome:
    def one(case: Case) -> _Outcome:
        impact, needed = case.impact(DURATION, fidelity), ("peak_force", "tip_deflection")
        result = fj.simulate(impact, fidelity=fidelity, only=needed)
        wall = fj.simulate(case.wall(), fidelity=fidelity, only="peak_force")
        worst = jnp.maximum(result.status, wall.status)
        return _Outcome(result.peak_force, wall.peak_force, result.tip_deflection, worst)

    return fj.each_lane(one, cases)


def _grid(fences: Case, masses: np.ndarray, distances: np.ndarray) -> Case:
    """Lanes (fence, mass, distance) of two fences, flattened."""
    count = fences.distance.shape[0]
    shape = (count, masses.size, distances.size)

    def spread(leaf):
        leaf = np.asarray(leaf)
        wide = leaf.reshape(count, 1, 1, *leaf.shape[1:])
        return np.broadcast_to(wide, (*shape, *leaf.shape[1:])).reshape(-1, *leaf.shape[1:])

    lanes = jax.tree.map(spread, fences)
    mass = np.broadcast_to(masses[:, None], shape).reshape(-1)
    distance = np.broadcast_to(distances, shape).reshape(-1)
    return eqx.tree_at(lambda c: (c.parcel.mass, c.distance), lanes, (mass, distance))


def sweep(
    fences: list[Case],
    masses,
    distances,
    fidelity: fj.Fidelity,
    *,
    chunk: int,
    progress: Callable[[int, int, float], None] | None = None,
) -> list[Maps]:
    """Maps of every batch of `fences` (its lanes: the fences) over the same grid.

    One compiled program computes all lanes of all batches, `chunk` at a time, and those in doubt
    are computed again at the next finer fidelity. `progress` is called after each chunk with the
    number of lanes done, of all lanes, and the seconds left.
    """
    masses, distances = np.asarray(masses, dtype=float), np.asarray(distances, dtype=float)
    parts = [_grid(batch, masses, distances) for batch in fences]
    lanes = jax.tree.map(lambda *leaves: np.concatenate(leaves), *parts)
    begin = None

    def report(done, total):
        # The first chunk includes compilation and does not count for the speed.
        nonlocal begin
        begin = time.perf_counter() if begin is None else begin
        rate = (time.perf_counter() - begin) / max(1, done - chunk)
        if progress is not None:
            progress(done, total, rate * (total - done))

    ladder = fidelity.ladder()

    def compute(rung: int, some: Case) -> tuple[_Outcome, np.ndarray]:
        size = min(chunk, some.distance.shape[0])
        tell = report if rung == 0 else None
        found = in_chunks(lambda part: _impacts(part, ladder[rung]), some, size, progress=tell)
        return found, found.status

    whole = refined(compute, lanes, len(ladder)).numbers
    maps, at = [], 0
    for batch in fences:
        shape = (batch.distance.shape[0], masses.size, distances.size)
        size = int(np.prod(shape))
        numbers = [leaf[at : at + size].reshape(shape) for leaf in whole]
        maps.append(Maps(masses, distances, *numbers))
        at += size
    return maps
