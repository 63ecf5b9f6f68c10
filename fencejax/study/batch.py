"""Simulating many scenes at once; those in numerical doubt are computed again."""

import dataclasses
import functools
from collections.abc import Sequence

import jax
import numpy as np
from jax.core import Tracer

from .. import _check
from ..fidelity import Fidelity
from ..lanes import each_lane
from ..results import Measure, Result, refined
from ..scenes import NormalScene, Scene
from ..simulate import simulate
from .lane_groups import CPU_GROUP, filled_up, in_groups


@functools.lru_cache(maxsize=32)
def _program(structure, fidelity: Fidelity, only: tuple[str, ...] | None, measures):
    """The vectorised map from scenes of one structure to their results, compiled."""
    del structure

    def one(scene):
        return simulate(scene, fidelity=fidelity, history=False, only=only, measures=measures)

    def computed(scenes, count):
        lanes = len(jax.tree.leaves(scenes)[0])
        if lanes <= CPU_GROUP or jax.default_backend() != "cpu":
            return each_lane(one, scenes)
        return in_groups(jax.vmap(one), scenes, CPU_GROUP, count, lambda scene: scene)

    return jax.jit(computed)


def simulate_many(
    scenes: NormalScene | Scene,
    *,
    fidelity: Fidelity | None = None,
    only: str | Sequence[str] | None = None,
    measures: Sequence[Measure] = (),
    refine: bool = True,
) -> Result:
    """Simulate a batch of scenes of one structure, each at the first fidelity that is fine enough.

        scenes = jax.vmap(lambda m: fj.scenes.oblique_impact(parcel=fj.Parcel(mass=m)))(masses)
        result = fj.simulate_many(scenes, only=("peak_force",))

    All lanes run at `fidelity`. Those in numerical doubt (`Status.numerical`) are gathered and run
    again at the next rung of `Fidelity.ladder`, up to the last one, whose numbers are used in any
    case. The result is on the host and has no derivative: for gradients use `jax.vmap` over
    `simulate`, or `fencejax.minimize`, which refines by itself.

    **Arguments:**

    - `scenes`: a scene whose leaves have the lanes first, all of them.
    - `fidelity`: default `Fidelity.standard()`.
    - `only`, `measures`: as in `simulate`; there is no history.
    - `refine`: with `False` every lane stays as it is.

    Returns a `Result` of NumPy arrays with the lanes first; `Result.rung` is the rung of each.

    Raises `ValueError` where the leaves do not have one first axis of one length, and `TypeError`
    inside a transformation.

    >>> scenes = jax.vmap(lambda v: fj.scenes.rigid_wall(speed=v))(jnp.array([1.0, 2.0]))
    >>> fj.simulate_many(scenes, only="peak_force").peak_force.round()
    array([ 832., 2440.])
    """
    fidelity = Fidelity.standard() if fidelity is None else fidelity
    if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(scenes)):
        raise TypeError(
            "Argument `scenes` must hold concrete numbers, but holds traced ones. Inside a "
            "transformation write jax.vmap(fj.simulate)(scenes), whose `status` tells doubt."
        )
    sizes = {np.shape(leaf)[:1] for leaf in jax.tree.leaves(scenes)}
    if len(sizes) != 1 or () in sizes:
        raise ValueError(
            "Argument `scenes` must have the lanes as the first axis of every leaf, but has the "
            f"first axes {sorted(sizes)}. Write jax.vmap(make_scene)(numbers)."
        )
    names = None if only is None else _check.several("only", only)
    if names is not None and "history" in names:
        raise ValueError(
            "Argument `only` must not hold 'history': lanes of different fidelities have different "
            "samples. Write fj.simulate(scene, refine=True) for one."
        )
    ladder = fidelity.ladder(scenes) if refine else (fidelity,)

    def compute(rung: int, lanes):
        program = _program(jax.tree.structure(lanes), ladder[rung], names, tuple(measures))
        count = len(jax.tree.leaves(lanes)[0])
        some = lanes if count <= CPU_GROUP else filled_up(lanes, CPU_GROUP)
        result = program(some, np.asarray(count, np.int32))
        result = jax.tree.map(lambda leaf: leaf[:count], result)
        return result, result.status

    found = refined(compute, scenes, len(ladder))
    return dataclasses.replace(found.numbers, status=found.statuses, rung=found.rungs)
