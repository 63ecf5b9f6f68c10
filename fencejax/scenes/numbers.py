"""The numbers of a scene by name: what there is, in which unit, and how to read and replace it.

Every number has its path, `"fence.material.youngs_modulus"`, and most have a name beside it
(`fencejax.scene_names`), the one that design variables and sweeps use: `"youngs_modulus"`,
`"mass"`, `"belt_speed"`, `"fence_kinetic_friction"`, `"distance"` (where the parcel touches). Any
end of a path does where it is clear. An element of a vector is `"control_angles[3]"`. Two names
stand for what a designer thinks in: `"reach"` is l_s + l_p at a constant l_s / l_p,
`"length_ratio"` is l_s / l_p at a constant reach.
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from . import names as scene_names
from .names import ABOVE, DERIVED as DERIVED, LEAST, PATHS, element
from .scene import NormalScene, Scene

AnyScene = NormalScene | Scene

_LENGTHS = ("fence.rigid_length", "fence.flexible_length")


def _paths(scene: AnyScene) -> list[tuple[str, tuple[int, ...]]]:
    """Path and shape of every leaf."""
    leaves, _ = jax.tree_util.tree_flatten_with_path(scene)
    return [(jax.tree_util.keystr(path).lstrip("."), np.shape(leaf)) for path, leaf in leaves]


def names(scene: AnyScene) -> tuple[str, ...]:
    """The paths of all numbers of a scene, in the order of `values`."""
    found = []
    for path, shape in _paths(scene):
        if len(shape) > 1:
            raise ValueError(
                f"Argument `scene` must hold one scene, but `{path}` has the shape {shape}."
            )
        found += [path] if not shape else [f"{path}[{k}]" for k in range(shape[0])]
    return tuple(found)


def unit(name: str) -> str:
    """The unit [SI] of a number, by its path or by one of the names of `DERIVED`.

    Raises `ValueError` for a path that no scene has.
    """
    return scene_names.at(name).unit


def resolve(scene: AnyScene, name: str) -> str:
    """The path (or name of `DERIVED`) that `name` stands for in a scene.

    Raises `ValueError` where there is none, or more than one.
    """
    known = names(scene)
    if name in known:
        return name
    if name in DERIVED and all(path in known for path in _LENGTHS):
        return name
    if name in PATHS:
        found = [path for path in PATHS[name] if path in known]
    else:
        found = [path for path in known if path.endswith(f".{name}")]
    if len(found) == 1:
        return found[0]
    choices = found or [*known, *(n for n in DERIVED if _LENGTHS[0] in known)]
    what = "name one number of the scene" if not found else "tell apart numbers of the scene"
    raise ValueError(f"Argument `name` must {what}, one of {choices}, but is {name!r}.")


def short(scene: AnyScene, path: str) -> str:
    """The name of a number that `resolve` takes for it, or its path if it has none."""
    for name, candidates in PATHS.items():
        if path in candidates:
            return name
    end = path.rpartition(".")[2]
    if path in DERIVED or end == path or end in PATHS:
        return path
    return end if [p for p in names(scene) if p.endswith(f".{end}")] == [path] else path


def values(scene: AnyScene) -> Array:
    """All numbers of a scene [SI], of shape (N,)."""
    return jnp.concatenate([jnp.ravel(jnp.asarray(leaf)) for leaf in jax.tree.leaves(scene)])


def with_values(scene: AnyScene, numbers: ArrayLike) -> AnyScene:
    """The scene with all its numbers replaced, from shape (N,). Nothing is checked."""
    numbers = jnp.asarray(numbers)
    leaves, structure = jax.tree.flatten(scene)
    new, at = [], 0
    for leaf in leaves:
        size = int(np.size(leaf))
        new.append(numbers[at : at + size].reshape(np.shape(leaf)))
        at += size
    return jax.tree.unflatten(structure, new)


def read(scene: AnyScene, chosen: Sequence[str]) -> list[Array]:
    """The numbers of some names [SI]."""
    leaves = dict(zip([path for path, _ in _paths(scene)], jax.tree.leaves(scene), strict=True))

    def number(path):
        if path in leaves:
            return leaves[path]
        name, place = element(path)
        return leaves[name][place]

    found = []
    for name in chosen:
        path = resolve(scene, name)
        if path in DERIVED:
            rigid, flexible = (number(end) for end in _LENGTHS)
            found.append(rigid + flexible if path == "reach" else rigid / flexible)
        else:
            found.append(number(path))
    return found


def replace(scene: AnyScene, chosen: Sequence[str], given: Sequence[ArrayLike] | Array) -> AnyScene:
    """The scene with the numbers of some names [SI] replaced by those given.

    Differentiable, and free of checks: see `check`.
    """
    paths = [path for path, _ in _paths(scene)]
    leaves, structure = jax.tree.flatten(scene)
    derived = {}
    for k, name in enumerate(chosen):
        path = resolve(scene, name)
        if path in DERIVED:
            derived[path] = jnp.asarray(given[k], dtype=float)
        elif path in paths:
            leaves[paths.index(path)] = jnp.asarray(given[k], dtype=float)
        else:
            owner, place = element(path)
            index = paths.index(owner)
            leaves[index] = jnp.asarray(leaves[index]).at[place].set(given[k])
    if derived:
        rigid, flexible = (leaves[paths.index(end)] for end in _LENGTHS)
        reach = derived.get("reach", rigid + flexible)
        ratio = derived.get("length_ratio", rigid / flexible)
        flexible = reach / (1 + ratio)
        for end, value in zip(_LENGTHS, (flexible * ratio, flexible), strict=True):
            leaves[paths.index(end)] = value
    return jax.tree.unflatten(structure, leaves)


def check(scene: AnyScene, name: str, value: float) -> None:
    """Raise `ValueError` where a number of the scene cannot have the value [SI], or where a
    distance lies beyond the scene's own fence."""
    path = resolve(scene, name)
    number = scene_names.at(path)
    word = None
    if not np.isfinite(value):
        word = "finite"
    elif number.sign == ABOVE and value <= 0 or number.sign == LEAST and value < 0:
        word = number.sign
    elif path in ("start.place", "distance") and scene.fence is not None:
        reach = float(scene.fence.reach)
        word = f"at most {reach:g}, where the fence ends" if value > reach else None
    if word is not None:
        raise ValueError(
            f"Argument `{name}` must be {word} [{number.unit}], but is {value:g}."
        )


def together(scene: AnyScene, chosen: Sequence[str]) -> tuple[str, ...]:
    """The paths of some names.

    Raises `ValueError` where two of them set the same number.
    """
    paths = tuple(resolve(scene, name) for name in chosen)
    if not paths:
        raise ValueError(
            "Argument `names` must hold at least one name of a number of the scene, one of "
            f"{[*names(scene)]}, but is empty."
        )
    lengths = any(path in DERIVED for path in paths) and any(path in _LENGTHS for path in paths)
    if len(set(paths)) < len(paths) or lengths:
        raise ValueError(f"Argument `names` must not set a number twice, but holds {list(chosen)}.")
    return paths


def vary(scene: AnyScene, chosen: Sequence[str], given: ArrayLike) -> np.ndarray:
    """All numbers of the scene with some replaced lane by lane: (P, n) -> (P, N), on the host."""
    paths, known = together(scene, chosen), names(scene)
    given = np.asarray(given, dtype=float)
    lanes = np.repeat(np.asarray(values(scene))[None], len(given), axis=0)
    derived = {}
    for path, column in zip(paths, given.T, strict=True):
        if path in DERIVED:
            derived[path] = column
        else:
            lanes[:, known.index(path)] = column
    if derived:
        ends = [known.index(end) for end in _LENGTHS]
        rigid, flexible = lanes[:, ends].T
        reach = derived.get("reach", rigid + flexible)
        ratio = derived.get("length_ratio", rigid / flexible)
        lanes[:, ends[1]] = reach / (1 + ratio)
        lanes[:, ends[0]] = reach * ratio / (1 + ratio)
    return lanes


def named(scene: AnyScene, chosen: Sequence[str], lanes: ArrayLike) -> np.ndarray:
    """Numbers by some names in lanes of all numbers: (P, N) -> (P, n), on the host."""
    known, lanes = names(scene), np.asarray(lanes, dtype=float)
    columns = []
    for path in together(scene, chosen):
        if path in DERIVED:
            rigid, flexible = (lanes[:, known.index(end)] for end in _LENGTHS)
            columns.append(rigid + flexible if path == "reach" else rigid / flexible)
        else:
            columns.append(lanes[:, known.index(path)])
    return np.stack(columns, axis=1)


def slopes_in(
    scene: AnyScene, chosen: Sequence[str], lanes: ArrayLike, slopes: ArrayLike
) -> np.ndarray:
    """Slopes in some names from those in all numbers, (..., N) at `lanes` (P, N): the chain rule,
    which matters for the names of `DERIVED` alone. (P, m, N) -> (P, m, n), on the host."""
    known = names(scene)
    lanes, slopes = np.asarray(lanes, dtype=float), np.asarray(slopes, dtype=float)
    columns = []
    for path in together(scene, chosen):
        if path in DERIVED:
            by_rigid, by_flexible = (slopes[..., known.index(end)] for end in _LENGTHS)
            rigid, flexible = (lanes[:, known.index(end)][:, None] for end in _LENGTHS)
            reach = rigid + flexible
            if path == "reach":
                column = (rigid * by_rigid + flexible * by_flexible) / reach
            else:
                # l_p = reach / (1 + ratio), l_s = reach - l_p.
                column = (by_rigid - by_flexible) * flexible**2 / reach
            columns.append(column)
        else:
            columns.append(slopes[..., known.index(path)])
    return np.stack(columns, axis=-1)
