"""Scenes of one kind in which any number can be named and changed."""

import dataclasses
import inspect
from collections.abc import Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from .. import _check, scenes
from ..design import DesignSpace, DesignVariable
from ..parts import (
    AbstractDrive,
    AbstractFriction,
    Belt,
    Border,
    Fence,
    Friction,
    HarmonicDrive,
    Parcel,
    SCurveDrive,
    TrapezoidDrive,
)
from ..scenes import (
    NUMBERS,
    AtTouch,
    BetweenBorderAndFence,
    Default,
    FlushOnFence,
    Number,
    Scene,
    names as scene_names,
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


def _fields(numbers: Sequence[Number], part: str = "") -> dict[str, str]:
    """The last field of the path by name, of the numbers of a part."""
    return {
        number.name: number.path.rpartition(".")[2]
        for number in numbers
        if number.name is not None and number.name.startswith(part)
    }


_FENCE_NAMES = tuple(scene_names.bounded(scene_names.FENCE))
_PARCEL, _BELT = _fields(scene_names.PARCEL), _fields(scene_names.BELT)
_COEFFICIENTS = {part: _fields(scene_names.FRICTION, part) for part in ("belt", "fence", "border")}
# A design space that takes every number: what may be is asked of the parts themselves.
_WIDE = 1e15


class SceneFamily:
    """Scenes of one kind; some numbers vary by name, all others are those of the parts given.

    Names are those of `VARIABLES`: the fence's numbers (with its material, `length_ratio` and
    `reach`), the drive's fields (an element of a vector is `"control_angles[3]"`), the parcel's
    fields, `belt_speed`, `belt_width`, `gravity`, `belt_...`, `fence_...` and
    `border_kinetic_friction`, `..._static_friction`, and the numbers of the scene's function
    (`KINDS`). A name that the scene has no part for is refused.
    """

    def __init__(
        self,
        kind: str,
        names: Sequence[str],
        *,
        fixed: Mapping[str, float] | None = None,
        fence: Fence | None = None,
        drive: AbstractDrive | None = None,
        parcel: Parcel | None = None,
        belt: Belt | None | Default = "default",
        fence_friction: AbstractFriction | None | Default = "default",
        border: Border | None | Default = "default",
        duration: float | None = None,
        options: Mapping[str, Any] | None = None,
    ):
        """**Arguments:**

        - `kind`: of `KINDS`.
        - `names`: of the numbers that vary, in the order of the vectors that `scene` takes.
        - `fixed`: other numbers by name [SI], instead of those of the parts.
        - `fence`, `drive`, `parcel`, `belt`, `fence_friction`, `border`: the parts, by default the
          paper's; the border acts in `border_and_fence` and `whole_sort` alone.
        - `duration` [s], by default the scene's. It must be given where a whole sort's drive
          varies: the number of steps is the same for all.
        - `options`: static arguments of the scene's function, such as `corner`.

        Raises `ValueError` for a kind, a name or an option that there is not, and for names given
        twice.
        """
        self.kind = _check.choice("kind", kind, tuple(KINDS))
        self.names = tuple(names)
        self.fixed = {
            name: _check.number(f"fixed[{name!r}]", value)
            for name, value in ({} if fixed is None else fixed).items()
        }
        self.fence = Fence() if fence is None else fence
        self.drive = HarmonicDrive() if drive is None else drive
        self.parcel = Parcel() if parcel is None else parcel
        self.belt = Belt() if belt == "default" else belt
        self.friction = Friction(0.35, 0.5) if fence_friction == "default" else fence_friction
        self.border = (Border() if border == "default" else border) if self._bordered else None
        self.options = dict({} if options is None else options)
        # Numbers of fence and drive go through a design space.
        self._drive_fields = tuple(
            field.name
            for field in dataclasses.fields(self.drive)
            if hasattr(getattr(self.drive, field.name), "ndim")
        )
        self._check_names()
        self.duration = self._duration(duration)

    @property
    def _bordered(self) -> bool:
        return self.kind in ("border_and_fence", "whole_sort")

    @property
    def known(self) -> list[str]:
        """Names of the numbers that these scenes have; a vector's elements one by one."""
        names: list[str] = [*_FENCE_NAMES]
        for field in self._drive_fields:
            leaf = getattr(self.drive, field)
            names += [field] if leaf.ndim == 0 else [f"{field}[{k}]" for k in range(leaf.size)]
        names += _PARCEL
        if self.belt is not None:
            names += [*_BELT, *_COEFFICIENTS["belt"]]
        for part, friction in self._frictions().items():
            if friction is not None:
                names += _COEFFICIENTS[part]
        return [*names, *KINDS[self.kind]]

    def _frictions(self) -> dict[str, AbstractFriction | None]:
        border = None if self.border is None else self.border.friction
        return {"fence": self.friction, "border": border}

    def _check_names(self) -> None:
        known = self.known
        for where, names in (("names", self.names), ("fixed", tuple(self.fixed))):
            for name in names:
                if name not in known:
                    raise ValueError(
                        f"Argument `{where}` must name numbers of the scene {self.kind!r}, but "
                        f"holds {name!r}. It has {', '.join(known)}."
                    )
        given = [*self.names, *self.fixed]
        if len(set(given)) < len(given):
            raise ValueError(
                f"Arguments `names` and `fixed` must not repeat a name, but hold {given}."
            )
        function = inspect.signature(getattr(scenes, self.kind))
        allowed = [name for name in function.parameters if "corner" in name]
        for name in self.options:
            _check.choice("options", name, tuple(allowed))

    def _duration(self, duration: float | None) -> float:
        if duration is not None:
            return _check.number("duration", duration, above=0, unit="s")
        if self.kind != "whole_sort":
            return 0.25
        moved = [n for n in self.names if n.partition("[")[0] in self._drive_fields]
        if moved:
            raise ValueError(
                f"Argument `duration` [s] must be given where {moved} of the drive vary, but is "
                "None. Write the longest cycle, for example duration=1.36: it sets the number of "
                "steps of all scenes."
            )
        _, drive = self._designed(self.fixed)
        return float(drive.cycle)

    def _designed(self, numbers: Mapping[str, Any]) -> tuple[Fence, AbstractDrive]:
        """Fence and drive with their numbers among `numbers`."""
        own = [n for n in numbers if n in _FENCE_NAMES or n.partition("[")[0] in self._drive_fields]
        if not own:
            return self.fence, self.drive
        wide = [DesignVariable(name, -_WIDE, _WIDE, scaling="linear") for name in own]
        space = DesignSpace(wide, self.fence, self.drive)
        return space.apply(jnp.stack([jnp.asarray(numbers[name], dtype=float) for name in own]))

    def scene(self, values: ArrayLike) -> Scene:
        """The scene with the varied numbers at `values` [SI], a vector in the order of `names`.
        Traced values are not checked: see `possible`."""
        vector = jnp.asarray(values, dtype=float)
        if vector.shape != (len(self.names),):
            raise ValueError(
                f"Argument `values` must have the shape ({len(self.names)},), one number for each "
                f"of {list(self.names)}, but has {vector.shape}."
            )
        numbers = self.fixed | dict(zip(self.names, vector, strict=True))
        fence, drive = self._designed(numbers)
        arguments: dict[str, Any] = {
            name: numbers[name] for name in KINDS[self.kind] if name in numbers
        }
        if self._bordered:
            arguments["border"] = self._with_friction("border", numbers)
        return getattr(scenes, self.kind)(
            fence=fence,
            drive=drive,
            parcel=self._parcel(numbers),
            belt=self._with_friction("belt", numbers),
            fence_friction=_rubbing(self.friction, "fence", numbers),
            duration=self.duration,
            **arguments,
            **self.options,
        )

    def _parcel(self, numbers: Mapping[str, Any]) -> Parcel:
        fields = {
            name: numbers.get(name, getattr(self.parcel, field)) for name, field in _PARCEL.items()
        }
        return Parcel(**fields, contact=self.parcel.contact)

    def _with_friction(self, part: str, numbers: Mapping[str, Any]):
        """Belt or border with their numbers among `numbers`."""
        base = getattr(self, part)
        if base is None:
            return None
        friction = _rubbing(base.friction, part, numbers)
        if part == "border":
            return Border(friction)
        fields = {field: numbers.get(name, getattr(base, field)) for name, field in _BELT.items()}
        return Belt(friction=friction, **fields)

    def possible(self, scene: Scene) -> Array:
        """Whether a scene can be: what the parts and the scene's function ask of several numbers
        at once, for traced numbers. The place of touch lies on the fence, the drive reaches its
        angle, the centre of gravity lies inside the parcel, the parcel spans from the border to
        the fence, and the drive's stroke is long enough for its speed."""
        parcel, start, drive = scene.parcel, scene.start, scene.drive
        holds = [
            2 * jnp.abs(parcel.center_x) <= parcel.length,
            2 * jnp.abs(parcel.center_y) <= parcel.breadth,
        ]
        if isinstance(start, (AtTouch, FlushOnFence, BetweenBorderAndFence)):
            assert scene.fence is not None
            assert drive is not None
            furthest = drive.angle(drive.turning_time)
            holds.append(start.place <= scene.fence.reach)
            holds.append(start.drive_angle <= furthest + 1e-9)
        if isinstance(start, BetweenBorderAndFence):
            ax, ay = parcel.corner(start.fence_corner)
            bx, by = parcel.corner(start.border_corner)
            rise = start.place * jnp.sin(start.drive_angle)
            holds.append(rise**2 <= (ax - bx) ** 2 + (ay - by) ** 2)
        if isinstance(drive, (TrapezoidDrive, SCurveDrive)):
            rise = drive.top_speed / drive.acceleration
            cruise = drive.end_angle / drive.top_speed
            ramp = drive.acceleration / drive.jerk if isinstance(drive, SCurveDrive) else 0.0
            holds += [rise >= ramp, cruise >= rise + ramp]
        return jnp.all(jnp.stack([jnp.asarray(h) for h in holds]))

    def check(self, variables: Sequence[DesignVariable]) -> None:
        """Refuse a bound at which there is no scene.

        Each bound is tried with the other variables at their lower bounds, their upper bounds and
        in the middle; one of these must give a scene.

        Raises `ValueError` with the scene's own message where none does.
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
                        assert scene.drive is not None
                        _made_anew(scene.drive)
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


def _rubbing(
    friction: AbstractFriction | None, part: str, numbers: Mapping[str, Any]
) -> AbstractFriction | None:
    """Friction with its coefficients among `numbers`."""
    if friction is None:
        return None
    fields = {field.name: getattr(friction, field.name) for field in dataclasses.fields(friction)}
    coefficients = _COEFFICIENTS[part].items()
    return type(friction)(
        **fields | {field: numbers[name] for name, field in coefficients if name in numbers}
    )


def _made_anew(drive: AbstractDrive) -> None:
    """Have the drive's constructor check its numbers, where these are its fields."""
    fields = {field.name: getattr(drive, field.name) for field in dataclasses.fields(drive)}
    if set(inspect.signature(type(drive)).parameters) == set(fields):
        type(drive)(**fields)
