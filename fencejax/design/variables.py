"""Design variables: named numbers with bounds, and the fence and drive that they define."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike

from .. import _check
from ..parts import AbstractDrive, Fence, HarmonicDrive
from ..printing import Readable, Table, shown
from ..scenes import names as scene_names, numbers

_SCALINGS = ("logarithmic", "linear")


@dataclasses.dataclass(frozen=True)
class DesignVariable:
    """One number that may be designed, between two bounds.

    With p the value and a, b the bounds, its share of the range is
    s = (p - a) / (b - a) (linear scaling) or s = ln(p / a) / ln(b / a) (logarithmic scaling).

    **Fields:**

    - `name`: of a number of the fence (with its material and taper) or of the drive, by name (see
      `VARIABLES`) or path, such as `"fence.taper.exponent"`; an element of a vector is
      `"control_angles[3]"`, and the vector's own name stands for all of its elements.
    - `lower`, `upper`: bounds, in `unit`; `lower` above 0 where the scaling is logarithmic.
    - `unit`: in the SI.
    - `scaling`: `"logarithmic"` or `"linear"`.

    Raises `ValueError` where the bounds do not enclose a range that the scaling can span.

    >>> thickness = fj.DesignVariable("thickness", 0.02, 0.08, "m")
    >>> round(float(thickness.value(0.5)), 4), round(float(thickness.share(0.04)), 4)
    (0.04, 0.5)
    """

    name: str
    lower: float
    upper: float
    unit: str = "1"
    scaling: str = "logarithmic"

    def __post_init__(self):
        _check.choice("scaling", self.scaling, _SCALINGS)
        remedy = f"Give bounds with lower < upper for `{self.name}`."
        for end in ("lower", "upper"):
            _check.number(f"{self.name}.{end}", getattr(self, end), unit=self.unit, remedy=remedy)
        if self.lower >= self.upper:
            raise ValueError(
                f"Argument `{self.name}.lower` must be below `upper` = {self.upper:g} "
                f"[{self.unit}], but is {self.lower:g}. {remedy}"
            )
        if self.scaling == "logarithmic":
            _check.number(
                f"{self.name}.lower",
                self.lower,
                above=0,
                unit=self.unit,
                remedy='Or write scaling="linear".',
            )

    def share(self, value: ArrayLike) -> Array:
        """The share of the range [1] at `value`."""
        if self.scaling == "linear":
            return (jnp.asarray(value) - self.lower) / (self.upper - self.lower)
        return jnp.log(jnp.asarray(value) / self.lower) / math.log(self.upper / self.lower)

    def value(self, share: ArrayLike) -> Array:
        """The value at a share of the range."""
        share = jnp.asarray(share)
        if self.scaling == "linear":
            return self.lower + (self.upper - self.lower) * share
        return self.lower * jnp.exp(math.log(self.upper / self.lower) * share)


VARIABLES: Mapping[str, DesignVariable] = {
    name: DesignVariable(**fields)
    for name, fields in scene_names.bounded(scene_names.FENCE + scene_names.DRIVE).items()
}
"""Variables with default bounds. `length_ratio` is l_s / l_p at a given reach l_s + l_p."""


def variable(
    name: str,
    lower: float | None = None,
    upper: float | None = None,
    unit: str | None = None,
    scaling: str | None = None,
) -> DesignVariable:
    """A variable by its name or path; arguments left out come from the table of
    `fencejax.scenes.names`. The scaling of a number without default bounds is linear.

    Raises `ValueError` where the table has no bounds for the name and one is missing.
    """
    known = scene_names.known(name)
    bounded = known is not None and known.lower is not None
    lower = known.lower if lower is None and known is not None else lower
    upper = known.upper if upper is None and known is not None else upper
    if lower is None or upper is None:
        raise ValueError(
            f"Argument `{name}` must be given bounds, for it has no default ones. Write "
            f"DesignVariable({name!r}, lower, upper, unit). With default bounds: "
            f"{', '.join(scene_names.bounded(scene_names.NUMBERS))}."
        )
    if unit is None:
        unit = "1" if known is None else known.unit
    if scaling is None:
        scaling = known.scaling if known is not None and bounded else "linear"
    return DesignVariable(name, lower, upper, unit, scaling)


class _Designed(eqx.Module):
    """The parts that a design changes by default, under their names in a scene."""

    fence: Fence
    drive: AbstractDrive


class DesignSpace(Readable):
    """An ordered choice of design variables over a base fence and drive.

    Values are vectors of shape (n,) in the order of `variables`, in SI units. An optimiser works
    with their shares of the ranges, in [0, 1] (see `DesignVariable`).

    >>> space = fj.DesignSpace([fj.DesignVariable("thickness", 0.02, 0.08, "m")])
    >>> fence, drive = space.apply(space.from_shares([0.5]))
    >>> round(float(fence.thickness), 4)
    0.04
    """

    def __init__(
        self,
        variables: Sequence[str | DesignVariable],
        fence: Fence | None = None,
        drive: AbstractDrive | None = None,
        *,
        parts: eqx.Module | None = None,
    ):
        """**Arguments:**

        - `variables`: names with the default bounds of `VARIABLES`, or `DesignVariable`s of any
          number of fence and drive (see `fencejax.scene_numbers`). The name of a vector stands
          for all of its elements.
        - `fence`, `drive`: the source of all other numbers; default `Fence()` and
          `HarmonicDrive()`.
        - `parts`: further parts whose numbers may vary: a module with the fields `fence` and
          `drive`, which are replaced by those given, and any others under their names in a scene,
          such as `belt`.

        Raises `ValueError` for an unknown or repeated name and where the base lies out of bounds.
        """
        self.fence = Fence() if fence is None else fence
        self.drive = HarmonicDrive() if drive is None else drive
        whole = _Designed(self.fence, self.drive) if parts is None else parts
        self._base: Any = self._with(whole, self.fence, self.drive)
        if isinstance(variables, (str, DesignVariable)) or not variables:
            raise ValueError(
                f"Argument `variables` must be a sequence of at least one name or DesignVariable, "
                f'but is {variables!r}. Write, for example, ["thickness", "length_ratio"].'
            )
        chosen = [element for given in variables for element in self._expand(given)]
        self.variables: tuple[DesignVariable, ...] = tuple(chosen)
        paths = [numbers.resolve(self._base, name) for name in self.names]
        if len(set(paths)) < len(paths):
            raise ValueError(
                f"Argument `variables` must not repeat a name, but holds {list(self.names)}."
            )
        numbers.together(self._base, self.names)
        self._in_bounds(self.base)

    @staticmethod
    def _with(parts: Any, fence: Fence, drive: AbstractDrive) -> Any:
        return dataclasses.replace(parts, fence=fence, drive=drive)

    @property
    def base(self) -> Array:
        """The variables' values [SI] in the base fence and drive, of shape (n,)."""
        return self.values_of(self.fence, self.drive)

    def _printed(self) -> Table:
        rows = []
        for variable in self.variables:
            ends = (shown(end, variable.unit) for end in (variable.lower, variable.upper))
            rows.append((variable.name, f"{' ... '.join(ends)}, {variable.scaling}"))
        return Table(f"{len(rows)} design variables", tuple(rows))

    def _expand(self, given: str | DesignVariable) -> list[DesignVariable]:
        """The scalar variables that a name or a variable stands for."""
        name = given if isinstance(given, str) else given.name
        try:
            scalars = numbers.elements(self._base, name)
        except ValueError as error:
            known = [numbers.short(self._base, path) for path in numbers.names(self._base)]
            raise ValueError(
                f"Argument `variables` must name numbers of the fence or of the "
                f"{type(self.drive).__name__}, {[*known, *numbers.DERIVED]}, but holds {name!r}."
            ) from error
        chosen = variable(given) if isinstance(given, str) else given
        return [dataclasses.replace(chosen, name=scalar) for scalar in scalars]

    @property
    def names(self) -> tuple[str, ...]:
        """The variables' names, in order."""
        return tuple(variable.name for variable in self.variables)

    def _in_bounds(self, values: Array) -> None:
        if isinstance(values, Tracer):
            return
        for variable, value in zip(self.variables, np.asarray(values), strict=True):
            rounding = 1e-12 * (variable.upper - variable.lower)
            _check.scalar(
                variable.name,
                float(value),
                least=variable.lower - rounding,
                most=variable.upper + rounding,
                unit=variable.unit,
                remedy=f"Widen the bounds: DesignVariable({variable.name!r}, lower, upper, "
                f"{variable.unit!r}, {variable.scaling!r}).",
            )

    def _vector(self, name: str, values: ArrayLike) -> Array:
        array = jnp.asarray(values, dtype=float)
        if array.shape != (len(self.variables),):
            raise ValueError(
                f"Argument `{name}` must have the shape ({len(self.variables)},), one number for "
                f"each of {list(self.names)}, but has {array.shape}."
            )
        return array

    def values_of(self, fence: Fence, drive: AbstractDrive) -> Array:
        """The variables' values [SI] in a given fence and drive, and otherwise in the base."""
        return jnp.stack(numbers.read(self._with(self._base, fence, drive), self.names))

    def to_shares(self, values: ArrayLike) -> Array:
        """Shares of the ranges [1] from values [SI], within [0, 1].

        Raises `ValueError` where a value lies out of its bounds.
        """
        array = self._vector("values", values)
        self._in_bounds(array)
        shares = [v.share(x) for v, x in zip(self.variables, array, strict=True)]
        return jnp.clip(jnp.stack(shares), 0.0, 1.0)

    def from_shares(self, shares: ArrayLike) -> Array:
        """Values [SI] from shares of the ranges [1]."""
        given = self._vector("shares", shares)
        return jnp.stack([v.value(s) for v, s in zip(self.variables, given, strict=True)])

    def apply(self, values: ArrayLike) -> tuple[Fence, AbstractDrive]:
        """The base fence and drive with the variables at `values` [SI]; those of other parts are
        left out. Bounds are not checked."""
        new = numbers.replace(self._base, self.names, self._vector("values", values))
        return new.fence, new.drive

    def named(self, values: ArrayLike) -> dict[str, float]:
        """Values as plain numbers by name [SI]."""
        return dict(zip(self.names, np.asarray(values, dtype=float).tolist(), strict=True))
