"""The numbers of a scene by name, with their units, and functions to read and replace them.

Every numeric leaf of a scene is a number, with its path: `"fence.material.youngs_modulus"`,
`"fence.taper.exponent"`, `"drive.control_angles[3]"`. Most also have a name
(`fencejax.scenes.names`): `"youngs_modulus"`, `"mass"`, `"belt_speed"`, `"fence_kinetic_friction"`,
`"distance"` (where the parcel touches). Any end of a path serves where it is unambiguous. Two names
are derived numbers: `"reach"` is l_s + l_p at a constant l_s / l_p, `"length_ratio"` is l_s / l_p
at a constant reach.

Design variables, sweeps, sensitivities, identification and the choice of a fidelity all name
numbers in this way, and read and replace them by `read` and `replace`. A whole scene is not needed:
an object with a fence and a drive under these names is enough.

>>> scene = fj.scene_numbers.replace(fj.scenes.oblique_impact(), ["reach"], [1.1])
>>> f"{scene.fence.rigid_length:.4f} m + {scene.fence.flexible_length:.4f} m"
'0.4125 m + 0.6875 m'
"""

import functools
from collections.abc import Sequence
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from .. import _check
from .._check import Bounds
from . import names as scene_names
from .names import BY_PATH, DERIVED as DERIVED, PATHS, Number, element
from .scene import NormalScene, Scene

AnyScene = NormalScene | Scene
_Parts = TypeVar("_Parts")

_LENGTHS = ("fence.rigid_length", "fence.flexible_length")


def _paths(scene) -> list[tuple[str, tuple[int, ...]]]:
    """Path and shape of every leaf."""
    leaves, _ = jax.tree_util.tree_flatten_with_path(scene)
    return [(jax.tree_util.keystr(path).lstrip("."), np.shape(leaf)) for path, leaf in leaves]


def names(scene) -> tuple[str, ...]:
    """The paths of all numbers of a scene, in the order of `values`.

    >>> fj.scene_numbers.names(fj.scenes.rigid_wall())[-3:]
    ('parcel.stiffness', 'parcel.damping', 'speed')
    """
    found = []
    for path, shape in _paths(scene):
        if len(shape) > 1:
            raise ValueError(
                f"Argument `scene` must hold one scene, but `{path}` has the shape {shape}."
            )
        found += [path] if not shape else [f"{path}[{k}]" for k in range(shape[0])]
    return tuple(found)


def unit(name: str) -> str:
    """The unit [SI] of a number of the table, by its path or by one of the names of `DERIVED`.

    Raises `ValueError` for a path that the table does not hold: see `number`.

    >>> fj.scene_numbers.unit("fence.material.density")
    'kg/m^3'
    """
    return scene_names.at(name).unit


def _inner(part, name: str):
    """A field of a part, or an element of a field that holds several parts."""
    field, place = element(name)
    inner = getattr(part, field)
    return inner if place is None else inner[place]


def number(scene, name: str) -> Number:
    """The number with a name in a scene: its path, unit and bounds, and default bounds if it has
    any. For a number that is not in the table, unit and bounds are those in the `bounds` of its
    part's class; without these it is a ratio [1].

    Raises `ValueError` where there is no such number, or more than one.

    >>> fj.scene_numbers.number(fj.scenes.oblique_impact(), "density").path
    'fence.material.density'
    """
    path = resolve(scene, name)
    whole = element(path)[0]
    found = BY_PATH.get(path, BY_PATH.get(whole))
    if path in DERIVED and found is not None:
        return found
    owner, _, field = whole.rpartition(".")
    part = functools.reduce(_inner, owner.split("."), scene) if owner else scene
    bounds = getattr(type(part), "bounds", {}).get(field)
    if found is None:
        return Number(path, Bounds() if bounds is None else bounds)
    return found if bounds is None else found._replace(bounds=bounds)


def resolve(scene, name: str) -> str:
    """The path (or name of `DERIVED`) that `name` stands for in a scene.

    Raises `ValueError` where there is none, or more than one.

    >>> fj.scene_numbers.resolve(fj.scenes.oblique_impact(), "density")
    'fence.material.density'
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


def elements(scene, name: str) -> tuple[str, ...]:
    """The names of a vector's elements if `name` is that of a vector, otherwise `name` alone.

    Raises `ValueError` where a scene has neither.

    >>> scene = fj.scenes.whole_sort(drive=fj.SplineDrive([0.3, 0.6, 0.3]))
    >>> fj.scene_numbers.elements(scene, "control_angles")
    ('control_angles[0]', 'control_angles[1]', 'control_angles[2]')
    """
    paths = dict(_paths(scene))
    for path in PATHS.get(name, tuple(p for p in paths if p == name or p.endswith(f".{name}"))):
        if paths.get(path):
            return tuple(f"{name}[{k}]" for k in range(paths[path][0]))
    resolve(scene, name)
    return (name,)


def has(scene, name: str) -> bool:
    """Whether a name stands for a number of a scene.

    >>> fj.scene_numbers.has(fj.scenes.rigid_wall(), "thickness")
    False
    """
    try:
        resolve(scene, name)
    except ValueError:
        return False
    return True


def short(scene, path: str) -> str:
    """The name of a number that `resolve` takes for it, or its path if it has none.

    >>> fj.scene_numbers.short(fj.scenes.oblique_impact(), "fence.material.density")
    'density'
    """
    for name, candidates in PATHS.items():
        if path in candidates:
            return name
    end = path.rpartition(".")[2]
    if path in DERIVED or end == path or end in PATHS:
        return path
    return end if [p for p in names(scene) if p.endswith(f".{end}")] == [path] else path


def values(scene) -> Array:
    """All numbers of a scene [SI], of shape (N,).

    >>> fj.scene_numbers.values(fj.scenes.rigid_wall()).shape
    (8,)
    """
    return jnp.concatenate([jnp.ravel(jnp.asarray(leaf)) for leaf in jax.tree.leaves(scene)])


def with_values(scene: _Parts, numbers: ArrayLike) -> _Parts:
    """The scene with all its numbers replaced, from shape (N,). Nothing is checked.

    >>> scene = fj.scenes.rigid_wall()
    >>> twice = fj.scene_numbers.with_values(scene, 2.0 * fj.scene_numbers.values(scene))
    >>> float(scene.parcel.mass), float(twice.parcel.mass)
    (15.0, 30.0)
    """
    numbers = jnp.asarray(numbers)
    leaves, structure = jax.tree.flatten(scene)
    new, at = [], 0
    for leaf in leaves:
        size = int(np.size(leaf))
        new.append(numbers[at : at + size].reshape(np.shape(leaf)))
        at += size
    return jax.tree.unflatten(structure, new)


def read(scene, chosen: Sequence[str]) -> list[Array]:
    """The numbers of some names [SI].

    >>> reach, mass = fj.scene_numbers.read(fj.scenes.oblique_impact(), ["reach", "mass"])
    >>> f"{reach:.2f} m, {mass:.1f} kg"
    '1.20 m, 15.0 kg'
    """
    leaves = dict(zip([path for path, _ in _paths(scene)], jax.tree.leaves(scene), strict=True))

    def one(path):
        if path == "reach":
            return one(_LENGTHS[0]) + one(_LENGTHS[1])
        if path == "length_ratio":
            return one(_LENGTHS[0]) / one(_LENGTHS[1])
        name, place = (path, None) if path in leaves else element(path)
        return leaves[name] if place is None else leaves[name][place]

    return [one(resolve(scene, name)) for name in chosen]


def replace(
    scene: _Parts, chosen: Sequence[str], given: Sequence[ArrayLike] | Array
) -> _Parts:
    """The scene with the numbers of some names [SI] replaced by those given.

    Differentiable, and free of checks: see `check`.

    >>> scene = fj.scene_numbers.replace(fj.scenes.oblique_impact(), ["thickness"], [0.05])
    >>> print(scene.fence)
    Fence(
      rigid_length=450 mm,
      flexible_length=750 mm,
      width=132 mm,
      thickness=50 mm,
      material=Material(youngs_modulus=3 GPa, density=1130 kg/m^3, damping_ratio=0.05),
      taper=ConstantStrength(),
    )
    """
    paths = [path for path, _ in _paths(scene)]
    leaves, structure = jax.tree.flatten(scene)
    derived = {}
    for name, value in zip(chosen, given, strict=True):
        path = resolve(scene, name)
        if path in DERIVED:
            derived[path] = jnp.asarray(value, dtype=jnp.result_type(*leaves))
        elif path in paths:
            index = paths.index(path)
            leaves[index] = jnp.asarray(value, dtype=jnp.result_type(leaves[index]))
        else:
            owner, place = element(path)
            index = paths.index(owner)
            leaves[index] = jnp.asarray(leaves[index]).at[place].set(value)
    if derived:
        rigid, flexible = (leaves[paths.index(end)] for end in _LENGTHS)
        reach = derived.get("reach", rigid + flexible)
        ratio = derived.get("length_ratio", rigid / flexible)
        flexible = reach / (1 + ratio)
        for end, value in zip(_LENGTHS, (flexible * ratio, flexible), strict=True):
            leaves[paths.index(end)] = value
    return jax.tree.unflatten(structure, leaves)


def check(scene, name: str, value: float) -> None:
    """Raise `ValueError` where a number of the scene cannot have the value [SI], or where a
    distance lies beyond the scene's own fence.

    >>> fj.scene_numbers.check(fj.scenes.oblique_impact(), "distance", 1.1)
    """
    found = number(scene, name)
    _check.scalar(name, value, **found.bounds._asdict())
    if found.path in ("start.place", "distance") and scene.fence is not None:
        reach = float(scene.fence.reach)
        if value > reach:
            raise ValueError(
                f"Argument `{name}` must be at most {reach:g}, where the fence ends "
                f"[{found.unit}], but is {value:g}."
            )


def together(scene, chosen: Sequence[str]) -> tuple[str, ...]:
    """The paths of some names.

    Raises `ValueError` where two of them set the same number.

    >>> fj.scene_numbers.together(fj.scenes.oblique_impact(), ["mass", "reach"])
    ('parcel.mass', 'reach')
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


def vary(scene, chosen: Sequence[str], given: ArrayLike) -> np.ndarray:
    """All numbers of the scene with some replaced lane by lane: (P, n) -> (P, N), on the host.

    >>> fj.scene_numbers.vary(fj.scenes.rigid_wall(), ["speed"], [[1.0], [2.0]]).shape
    (2, 8)
    """
    chosen = together(scene, chosen)
    return np.asarray(
        jax.vmap(lambda row: values(replace(scene, chosen, row)))(jnp.asarray(given, dtype=float))
    )


def named(scene, chosen: Sequence[str], lanes: ArrayLike) -> np.ndarray:
    """Numbers by some names in lanes of all numbers: (P, N) -> (P, n), on the host.

    >>> scene = fj.scenes.rigid_wall()
    >>> lanes = fj.scene_numbers.vary(scene, ["speed"], [[1.0], [2.0]])
    >>> fj.scene_numbers.named(scene, ["speed", "mass"], lanes)
    array([[ 1., 15.],
           [ 2., 15.]])
    """
    chosen = together(scene, chosen)
    return np.asarray(
        jax.vmap(lambda lane: jnp.stack(read(with_values(scene, lane), chosen)))(
            jnp.asarray(lanes, dtype=float)
        )
    )


def slopes_in(
    scene, chosen: Sequence[str], lanes: ArrayLike, slopes: ArrayLike
) -> np.ndarray:
    """Slopes of m quantities in the n `chosen` names, (P, m, n), from those in all N numbers,
    `slopes` of shape (P, m, N) at `lanes` of shape (P, N): the chain rule, which matters for the
    names of `DERIVED` alone. On the host.

    >>> scene = fj.scenes.rigid_wall()
    >>> lane = fj.scene_numbers.values(scene)[None]
    >>> every = np.arange(lane.size)[None, None]
    >>> fj.scene_numbers.slopes_in(scene, ["mass", "speed"], lane, every)
    array([[[0., 7.]]])
    """
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
