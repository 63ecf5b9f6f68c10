"""Batches of scenes of one structure, and the numbers in them that are differentiated."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.core import Tracer

from ..scenes import PATHS, AnyScene, NormalScene, Scene, numbers

Selector = str | Callable[[AnyScene], Any]
"""A name, a path like `"drive.top_speed"`, or a function from a scene to one of its arrays."""

_BY_DEFAULT = (
    "thickness", "flexible_length", "youngs_modulus", "density", "damping_ratio", "mass",
    "distance", "speed",
)  # fmt: skip


class Group(NamedTuple):
    """Stacked scenes of one structure, their number, and the variables of the derivatives."""

    scenes: AnyScene
    lanes: int
    chosen: tuple[Selector, ...]

    def read(self, scene: AnyScene) -> list[Any]:
        """The variables' values in one scene."""
        return [
            numbers.read(scene, [given])[0] if isinstance(given, str) else given(scene)
            for given in self.chosen
        ]

    def scaled(self, scene: AnyScene, scales: Sequence[Any]) -> AnyScene:
        """One scene with the variables multiplied by `scales`, of the shapes that `read`
        returns."""
        for given, scale in zip(self.chosen, scales, strict=True):
            if isinstance(given, str):
                value = numbers.read(scene, [given])[0]
                scene = numbers.replace(scene, [given], [value * scale])
            else:
                scene = eqx.tree_at(given, scene, given(scene) * scale)
        return scene


def _usual(scene: AnyScene) -> tuple[str, ...]:
    """Names of the default variables. The speed of a parcel is one, that of a drive is not."""
    usual = _BY_DEFAULT if isinstance(scene, NormalScene) else _BY_DEFAULT[:-1]
    return tuple(name for name in usual if numbers.has(scene, name))


def _chosen(scene: AnyScene, given: Sequence[Selector] | None) -> tuple[Selector, ...]:
    """The variables of scenes like this one, vectors element by element."""
    if given is None:
        return _usual(scene)
    found: list[Selector] = []
    for one in given:
        if not isinstance(one, str) and eqx.is_inexact_array(one(scene)):
            found.append(one)
            continue
        try:
            found += numbers.elements(scene, one if isinstance(one, str) else repr(one))
        except ValueError as error:
            raise ValueError(
                "Argument `with_respect_to` must name numbers of every scene, by one of "
                f"{list(PATHS)}, a path like 'drive.top_speed' or a function of the scene, but "
                f"{one!r} is no floating-point number of a {type(scene).__name__}."
            ) from error
    return tuple(found)


def grouped(given: Any, with_respect_to: Sequence[Selector] | None) -> list[Group]:
    """The scenes by structure, each structure as one batch.

    **Arguments:**

    - `given`: a scene, scenes stacked along a leading axis, or a sequence of these.
    - `with_respect_to`: the variables; by default the usual ones that the scenes have.

    Raises `TypeError` where `given` holds anything else or is traced, and `ValueError` where it is
    empty, its shapes do not fit, or a scene lacks one of the variables.
    """
    scenes = [given] if isinstance(given, (Scene, NormalScene)) else list(given)
    if not scenes:
        raise ValueError("Argument `scene_or_scenes` must hold at least one scene, but is empty.")
    alike: dict[Any, list[AnyScene]] = {}
    for scene in scenes:
        stacked = _stacked(scene)
        leaves, structure = jax.tree.flatten(stacked)
        kind = (structure, tuple((leaf.shape[1:], leaf.dtype) for leaf in leaves))
        alike.setdefault(kind, []).append(stacked)
    groups = []
    for batches in alike.values():
        whole = jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *batches)
        one = jax.tree.map(lambda leaf: leaf[0], whole)
        groups.append(Group(whole, whole.parcel.mass.shape[0], _chosen(one, with_respect_to)))
    return groups


def _stacked(scene: Any) -> AnyScene:
    """A checked scene with a leading axis on each of its numbers."""
    if not isinstance(scene, (Scene, NormalScene)):
        raise TypeError(
            "Argument `scene_or_scenes` must be a scene or a sequence of scenes, but holds a "
            f"{type(scene).__name__}."
        )
    if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(scene)):
        raise TypeError(
            "Argument `scene_or_scenes` must hold concrete numbers, but is traced: measure "
            "outside of a transformation."
        )
    if scene.parcel.mass.ndim == 0:
        scene = jax.tree.map(lambda leaf: leaf[None], scene)
    leaves = jax.tree.leaves(scene)
    if any(leaf.shape[:1] != leaves[0].shape[:1] for leaf in leaves):
        raise ValueError(
            "Argument `scene_or_scenes` must hold single scenes or scenes stacked along a "
            f"leading axis of all their numbers, but has shapes "
            f"{sorted({leaf.shape for leaf in leaves})}."
        )
    return scene


def names(groups: Sequence[Group], with_respect_to: Sequence[Selector] | None) -> tuple[str, ...]:
    """The variables' names; by default of those that any of the groups has."""
    if with_respect_to is None:
        return tuple(
            name for name in _BY_DEFAULT if any(name in group.chosen for group in groups)
        )
    return tuple(
        given if isinstance(given, str) else getattr(given, "__name__", repr(given))
        for given in with_respect_to
    )
