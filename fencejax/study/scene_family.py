"""Scenes of one kind in which any number can be named and changed."""

import dataclasses
import inspect
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike

from .. import _check, scenes
from .._identity import description
from ..design import DesignVariable
from ..parts import (
    AbstractDrive,
    AbstractFriction,
    Belt,
    Border,
    Fence,
    HarmonicDrive,
    Motor,
    Parcel,
    on_cover,
)
from ..scenes import (
    NUMBERS,
    PATHS,
    Default,
    Scene,
    consistent,
    names as scene_names,
    numbers as scene_numbers,
)

KINDS: Mapping[str, tuple[str, ...]] = {
    "oblique_impact": ("distance", "drive_angle", "parcel_angle"),
    "along_fence": ("distance", "drive_angle"),
    "border_and_fence": ("distance", "drive_angle"),
    "whole_sort": ("front", "offset", "angle"),
}
"""Kinds of scene, each with those arguments of its function that are numbers."""

VARIABLES: Mapping[str, DesignVariable] = {
    name: DesignVariable(**fields) for name, fields in scene_names.bounded(NUMBERS).items()
}
"""Variables with default bounds, unit and scaling: those of `fencejax.design.VARIABLES` and the
numbers of parcel, belt, border, friction and of the scenes themselves."""


class _Arguments(eqx.Module):
    """The start of a scene, under the names of its fields there; `None` for those it lacks."""

    place: Array | None
    drive_angle: Array | None
    parcel_angle: Array | None
    front: Array | None
    offset: Array | None
    angle: Array | None


# Arguments of a scene's function that are options, besides its corners.
_OPTIONS = "tip_contact", "surfaces"


class _Setting(eqx.Module):
    """The arguments of a scene's function, each number under its path in the scene: numbers are
    read and replaced by name here, and the function checks the result."""

    parcel: Parcel
    start: _Arguments
    belt: Belt | None
    fence: Fence
    drive: AbstractDrive
    fence_friction: AbstractFriction | None
    border: Border | None
    motor: Motor | None


class SceneFamily:
    """Scenes of one kind; some numbers vary by name, all others are those of the parts given.

    Any number of the scene can be named, by its path or its short name (see
    `fencejax.scene_numbers`), and those of the scene's function (`KINDS`). The parcel's inertia and
    its angle in an impact become numbers of their own where they are named.

    >>> family = fj.SceneFamily("oblique_impact", ["distance", "mass"])
    >>> float(family.scene(jnp.array([0.9, 8.0])).parcel.mass)
    8.0
    """

    def __init__(
        self,
        kind: str,
        names: str | Sequence[str],
        *,
        fixed: Mapping[str, float] | None = None,
        fence: Fence | None = None,
        drive: AbstractDrive | None = None,
        parcel: Parcel | None = None,
        belt: Belt | None | Default = "default",
        fence_friction: AbstractFriction | None | Default = "default",
        border: Border | None | Default = "default",
        motor: Motor | None = None,
        duration: float | None = None,
        options: Mapping[str, Any] | None = None,
    ):
        """**Arguments:**

        - `kind`: of `KINDS`.
        - `names`: of the numbers that vary, in the order of the vectors that `scene` takes, or one
          name.
        - `fixed`: other numbers by name [SI], instead of those of the parts.
        - `fence`, `drive`, `parcel`, `belt`, `fence_friction`, `border`: the parts, by default the
          paper's; the border acts in `border_and_fence` and `whole_sort` alone.
        - `motor`: of the drive, by default none: see `fencejax.scenes.Scene`.
        - `duration` [s], by default the scene's. It must be given where a whole sort's drive
          varies: the number of steps is the same for all.
        - `options`: other arguments of the scene's function: its corners, `tip_contact` and
          `surfaces`.

        Raises `ValueError` for an unknown kind, name or option, and for names given twice.
        """
        self.kind = _check.choice("kind", kind, tuple(KINDS))
        self.names = _check.several("names", names)
        self.fixed = {
            name: _check.number(f"fixed[{name!r}]", value)
            for name, value in ({} if fixed is None else fixed).items()
        }
        self.fence = Fence() if fence is None else fence
        self.drive = HarmonicDrive() if drive is None else drive
        self.parcel = Parcel() if parcel is None else parcel
        self.belt = Belt() if belt == "default" else belt
        self.friction = on_cover() if fence_friction == "default" else fence_friction
        self.border = (Border() if border == "default" else border) if self._bordered else None
        self.motor = motor
        self.options = dict({} if options is None else options)
        self._whole = self._setting(("inertia", "parcel_angle"))
        self._check_names()
        named = {scene_numbers.resolve(self._whole, n) for n in (*self.names, *self.fixed)}
        own = [n for n in ("inertia", "parcel_angle") if named & set(PATHS[n])]
        self._base = scene_numbers.replace(
            self._setting(own), tuple(self.fixed), list(self.fixed.values())
        )
        self.duration = self._duration(duration)

    @property
    def _bordered(self) -> bool:
        return self.kind in ("border_and_fence", "whole_sort")

    def _setting(self, optional: Sequence[str]) -> _Setting:
        """The parts and the function's own numbers, with those optional numbers that `optional`
        names."""
        given = inspect.signature(getattr(scenes, self.kind)).parameters
        defaults = {name: given[name].default for name in KINDS[self.kind]}
        if "parcel_angle" in defaults:
            defaults["parcel_angle"] = 0.0 if "parcel_angle" in optional else None
        own = {PATHS[name][0].rpartition(".")[2]: value for name, value in defaults.items()}
        fields = {field.name: own.get(field.name) for field in dataclasses.fields(_Arguments)}
        start = _Arguments(**{
            name: None if value is None else jnp.asarray(value, dtype=float)
            for name, value in fields.items()
        })  # fmt: skip
        parcel = self.parcel
        if "inertia" in optional:
            parcel = _with_inertia(parcel)
        return _Setting(
            parcel, start, self.belt, self.fence, self.drive, self.friction, self.border,
            self.motor,
        )  # fmt: skip

    @property
    def parts(self) -> Any:
        """The parts and the function's own numbers under their paths in a scene, without the
        `fixed` ones: `fencejax.scene_numbers` reads them like a scene, which need not be possible.

        >>> fj.scene_numbers.has(fj.SceneFamily("whole_sort", []).parts, "distance")
        False
        """
        return self._whole

    @property
    def known(self) -> list[str]:
        """Names of the numbers that these scenes have; a vector's elements one by one."""
        found = scene_numbers.names(self._whole)
        return [*(scene_numbers.short(self._whole, path) for path in found), *scene_names.DERIVED]

    def _check_names(self) -> None:
        for where, names in (("names", self.names), ("fixed", tuple(self.fixed))):
            for name in names:
                if not scene_numbers.has(self._whole, name):
                    raise ValueError(
                        f"Argument `{where}` must name numbers of the scene {self.kind!r}, but "
                        f"holds {name!r}. It has {', '.join(self.known)}."
                    )
        given = [scene_numbers.resolve(self._whole, n) for n in (*self.names, *self.fixed)]
        if len(set(given)) < len(given):
            raise ValueError(
                "Arguments `names` and `fixed` must not repeat a name, but hold "
                f"{[*self.names, *self.fixed]}."
            )
        for names in (self.names, tuple(self.fixed)):
            if names:
                scene_numbers.together(self._whole, names)
        function = inspect.signature(getattr(scenes, self.kind))
        allowed = [n for n in function.parameters if "corner" in n or n in _OPTIONS]
        for name in self.options:
            _check.choice("options", name, tuple(allowed))

    def _duration(self, duration: float | None) -> float:
        if duration is not None:
            return _check.number("duration", duration, above=0, unit="s")
        if self.kind != "whole_sort":
            return 0.25
        moved = [
            n for n in self.names if scene_numbers.resolve(self._whole, n).startswith("drive.")
        ]
        if moved:
            raise ValueError(
                f"Argument `duration` [s] must be given where {moved} of the drive vary, but is "
                "None. Write the longest cycle, for example duration=1.36: it sets the number of "
                "steps of all scenes."
            )
        return float(self._base.drive.cycle)

    def scene(self, values: ArrayLike) -> Scene:
        """The scene with the varied numbers at `values` [SI], a vector in the order of `names`.
        Traced values are not checked: see `possible`."""
        vector = jnp.asarray(values, dtype=float)
        if vector.shape != (len(self.names),):
            raise ValueError(
                f"Argument `values` must have the shape ({len(self.names)},), one number for each "
                f"of {list(self.names)}, but has {vector.shape}."
            )
        made = scene_numbers.replace(self._base, self.names, vector)
        if not any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(made)):
            for name in (*self.names, *self.fixed):
                scene_numbers.check(made, name, float(scene_numbers.read(made, [name])[0]))
            _check_together(made.parcel, made.drive, made.fence)
        arguments: dict[str, Any] = {
            name: getattr(made.start, PATHS[name][0].rpartition(".")[2])
            for name in KINDS[self.kind]
        }
        if self._bordered:
            arguments["border"] = made.border
        scene = getattr(scenes, self.kind)(
            fence=made.fence,
            drive=made.drive,
            parcel=made.parcel,
            belt=made.belt,
            fence_friction=made.fence_friction,
            duration=self.duration,
            **arguments,
            **self.options,
        )
        return scene if made.motor is None else dataclasses.replace(scene, motor=made.motor)

    def possible(self, scene: Scene) -> Array:
        """Whether a scene with traced numbers is possible: `fencejax.scenes.consistent` at the
        drive's time at the start."""
        return consistent(scene, scene.start.time(scene.drive, scene.fence))

    def check(self, variables: Sequence[DesignVariable]) -> None:
        """Refuse a bound at which no scene is possible.

        Each bound is tried with the other variables at their lower bounds, their upper bounds and
        in the middle; one of these must give a scene.

        Raises `ValueError` with the scene's own message otherwise.
        """
        lower = np.array([v.lower for v in variables])
        upper = np.array([v.upper for v in variables])
        for index, variable in enumerate(variables):
            for end in (variable.lower, variable.upper):
                refusal = None
                for others in (0.5 * (lower + upper), lower, upper):
                    values = others.copy()
                    values[index] = end
                    try:
                        scene = self.scene(values)
                        if bool(self.possible(scene)):
                            refusal = None
                            break
                        refusal = "no such scene can be"
                    except ValueError as error:
                        refusal = str(error)
                if refusal is not None:
                    raise ValueError(
                        f"Argument `{variable.name}` must be within the scene {self.kind!r}, but "
                        f"its bound {end:g} [{variable.unit}] is not, whatever the others are: "
                        f"{refusal}"
                    )


def _with_inertia(parcel: Parcel) -> Parcel:
    """The parcel with its inertia as a number of its own."""
    return eqx.tree_at(
        lambda p: p.given_inertia, parcel, parcel.inertia, is_leaf=lambda x: x is None
    )


def _check_together(parcel: Parcel, drive: AbstractDrive, fence: Fence) -> None:
    """Have the constructors of parcel, drive and fence check numbers that must fit together; a
    drive's where these are its fields."""
    Fence(flexible_length=fence.flexible_length, rest_shape=fence.rest_shape)
    Parcel(parcel.mass, parcel.length, parcel.breadth, parcel.center_x, parcel.center_y)
    fields = {field.name: getattr(drive, field.name) for field in dataclasses.fields(drive)}
    if set(inspect.signature(type(drive)).parameters) == set(fields):
        type(drive)(**fields)


def described(family: SceneFamily) -> dict[str, Any]:
    """All that a family's scenes depend on, as plain numbers, names, lists and dictionaries."""
    base = family._base
    parts = {field.name: getattr(base, field.name) for field in dataclasses.fields(base)}
    return {
        "scene": family.kind,
        "duration": family.duration,
        "names": list(family.names),
        "fixed": family.fixed,
        "options": description(family.options),
        "parts": description(parts),
    }


def structure_of(family: SceneFamily) -> Any:
    """The structure of a family's parts, with everything in them but the numbers."""
    return jax.tree.structure(family._base)
