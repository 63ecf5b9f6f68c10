"""Quantities of a scene as functions of its numbers, with their slopes, many lanes at a time."""

import functools
import os
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike

from .. import _check
from ..design import OBJECTIVES, Quantity, fields, measures
from ..fidelity import Fidelity
from ..lanes import each_lane
from ..results import counted, refined
from ..scenes import AnyScene, numbers as scene_numbers
from ..simulate import simulate
from .chunks import CountProgress, in_chunks


class Batch(NamedTuple):
    """Lanes of a `Response`: `values` of shape (P, m), `slopes` of shape (P, m, N) or `None`, and,
    of shape (P,), a `Status` for each lane and the rung of `Fidelity.ladder` it was computed at."""

    values: np.ndarray
    slopes: np.ndarray | None
    status: np.ndarray
    rung: np.ndarray

    def counts(self) -> dict[str, int]:
        """How many lanes ended with each status."""
        return counted(self.status)


# Four studies, with three rungs each.
@functools.lru_cache(maxsize=12)
def _programs(structure, shapes, quantities: tuple[Quantity, ...], fidelity: Fidelity):
    """Lanes of a scene's numbers to values and statuses, without and with slopes."""
    like = jax.tree.unflatten(structure, [np.zeros(shape) for shape in shapes])

    def outcome(numbers):
        scene = scene_numbers.with_values(like, numbers)
        only, own = fields(quantities), measures(quantities)
        result = simulate(scene, fidelity=fidelity, history=False, only=only, measures=own)
        return jnp.stack([quantity(result, scene) for quantity in quantities]), result.status

    def sloped(numbers):
        slopes, (values, status) = jax.jacfwd(
            lambda n: (outcome(n)[0], outcome(n)), has_aux=True
        )(numbers)
        return values, slopes, status

    return (
        jax.jit(functools.partial(each_lane, outcome)),
        jax.jit(functools.partial(each_lane, sloped)),
    )


def quantities_of(scene: AnyScene, outputs: Sequence[str | Quantity]) -> tuple[Quantity, ...]:
    """Quantities by their names (see `fencejax.OBJECTIVES`) or as they are.

    Raises `ValueError` for an unknown or repeated name, and where the scene lacks a part that one
    needs.
    """
    if isinstance(outputs, (str, Quantity)) or not outputs:
        raise ValueError(
            "Argument `outputs` must be a sequence of at least one name or Quantity, but is "
            f'{outputs!r}. Write, for example, ["peak_force"].'
        )
    chosen = []
    for output in outputs:
        if not isinstance(output, Quantity):
            _check.choice("outputs", output, tuple(OBJECTIVES))
            output = OBJECTIVES[output]
        if not output.applies_to(scene):
            raise ValueError(
                f"Argument `outputs` must be quantities that the scene has the parts for, but "
                f"`{output.name}` needs {output.needs}."
            )
        chosen.append(output)
    if len({quantity.name for quantity in chosen}) < len(chosen):
        raise ValueError(
            f"Argument `outputs` must not repeat a name, but holds {[q.name for q in chosen]}."
        )
    return tuple(chosen)


class Response:
    """m quantities Q(p) of a scene as functions of all its N numbers p [SI], and dQ/dp.

    Lanes are rows of the scene's numbers in the order of `fencejax.scene_numbers.names`;
    `fencejax.scene_numbers.vary` makes rows with some numbers changed. Every thread, one a core,
    computes `chunk` lanes at a time, which bounds the memory. Each of the two programs is compiled
    once for all scenes of the same structure.

    >>> scene = fj.scenes.rigid_wall()
    >>> lanes = fj.scene_numbers.vary(scene, ["speed"], [[1.0], [2.0]])
    >>> fj.Response(scene, ["peak_force"]).values(lanes).values.round()
    array([[ 832.],
           [2440.]])
    """

    def __init__(
        self,
        scene: AnyScene,
        outputs: Sequence[str | Quantity],
        fidelity: Fidelity | None = None,
        *,
        chunk: int = 16,
        workers: int | None = None,
        refine: bool = True,
    ):
        """**Arguments:**

        - `scene`: one scene, concrete.
        - `outputs`: names of `fencejax.OBJECTIVES`, or quantities.
        - `fidelity`: default `Fidelity.standard()`.
        - `chunk`: lanes computed at a time by a thread.
        - `workers`: threads; by default one a core.
        - `refine`: whether lanes in numerical doubt (`Status.numerical`) are computed again at the
          next rungs of `Fidelity.ladder`.

        Raises `ValueError` for an unknown name or an impossible count.
        """
        self.scene = scene
        self.quantities = quantities_of(scene, outputs)
        self.names = scene_numbers.names(scene)
        self.fidelity = Fidelity.standard() if fidelity is None else fidelity
        self.chunk = _check.count("chunk", chunk, least=1)
        workers = (os.cpu_count() or 1) if workers is None else workers
        self.workers = _check.count("workers", workers, least=1)
        self._ladder = self.fidelity.ladder() if refine else (self.fidelity,)
        leaves, self._structure = jax.tree.flatten(scene)
        self._shapes = tuple(np.shape(leaf) for leaf in leaves)

    def _run(self, sloped: bool, lanes: ArrayLike, progress: CountProgress | None) -> Batch:
        lanes = np.asarray(lanes, dtype=float)
        if lanes.ndim != 2 or lanes.shape[1] != len(self.names) or not len(lanes):
            raise ValueError(
                f"Argument `lanes` must have the shape (P, {len(self.names)}) with P at least 1, "
                f"but has {lanes.shape}. Write scene_numbers.vary(scene, names, rows)."
            )

        def compute(rung: int, part):
            programs = _programs(
                self._structure, self._shapes, self.quantities, self._ladder[rung]
            )
            reported = None if rung else progress
            *numbers, status = in_chunks(
                programs[sloped], part, self.chunk, workers=self.workers, progress=reported
            )
            return tuple(numbers), status

        found = refined(compute, lanes, len(self._ladder), grouped=False)
        values, slopes = found.numbers if sloped else (*found.numbers, None)
        return Batch(values, slopes, found.statuses, found.rungs)

    def values(self, lanes: ArrayLike, *, progress: CountProgress | None = None) -> Batch:
        """Q of lanes of shape (P, N). `progress(done, total)` is called after every chunk."""
        return self._run(False, lanes, progress)

    def slopes(self, lanes: ArrayLike, *, progress: CountProgress | None = None) -> Batch:
        """Q and dQ/dp of lanes of shape (P, N)."""
        return self._run(True, lanes, progress)

    def slopes_in(
        self, chosen: Sequence[str], rows: ArrayLike, *, progress: CountProgress | None = None
    ) -> Batch:
        """Q and its slopes in some named numbers alone, of shape (P, m, n), where these are `rows`
        [SI], of shape (P, n), and all others are the scene's."""
        lanes = scene_numbers.vary(self.scene, chosen, rows)
        batch = self.slopes(lanes, progress=progress)
        assert batch.slopes is not None
        return batch._replace(
            slopes=scene_numbers.slopes_in(self.scene, chosen, lanes, batch.slopes)
        )
