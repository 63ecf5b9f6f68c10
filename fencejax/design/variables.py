"""What a designer may change: named variables with bounds, and the fence and drive they give."""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike

from .. import _check
from ..parts import AbstractDrive, Fence, HarmonicDrive, Material
from ..scenes import element, names as scene_names

_SCALINGS = ("logarithmic", "linear")


@dataclasses.dataclass(frozen=True)
class DesignVariable:
    """One number that may be designed, between two bounds.

    With p the value and a, b the bounds, its share of the range is
    s = (p - a) / (b - a) (linear scaling) or s = ln(p / a) / ln(b / a) (logarithmic scaling).

    **Fields:**

    - `name`: of a fence's number (see `VARIABLES`) or of a drive's field; an element of a vector
      is `"control_angles[3]"`, and the vector's own name stands for all of its elements.
    - `lower`, `upper`: bounds, in `unit`; `lower` above 0 where the scaling is logarithmic.
    - `unit`: in the SI.
    - `scaling`: `"logarithmic"` or `"linear"`.

    Raises `ValueError` where the bounds do not enclose a range that the scaling can span.
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

_FENCE_NAMES = tuple(scene_names.bounded(scene_names.FENCE))


def _drive_fields(drive: AbstractDrive) -> dict[str, Array]:
    """The drive's floating-point fields by name."""
    fields = {field.name: getattr(drive, field.name) for field in dataclasses.fields(drive)}
    return {name: leaf for name, leaf in fields.items() if eqx.is_inexact_array(leaf)}


class DesignSpace:
    """An ordered choice of design variables over a base fence and drive.

    Values are vectors of shape (n,) in the order of `variables`, in SI units. An optimiser works
    with their shares of the ranges, in [0, 1] (see `DesignVariable`).
    """

    def __init__(
        self,
        variables: Sequence[str | DesignVariable],
        fence: Fence | None = None,
        drive: AbstractDrive | None = None,
    ):
        """**Arguments:**

        - `variables`: names with the default bounds of `VARIABLES`, or `DesignVariable`s. The
          name of a vector of the drive stands for all of its elements.
        - `fence`, `drive`: what everything else is taken from; default `Fence()` and
          `HarmonicDrive()`.

        Raises `ValueError` for an unknown or repeated name and where the base lies out of bounds.
        """
        self.fence = Fence() if fence is None else fence
        self.drive = HarmonicDrive() if drive is None else drive
        self._fields = _drive_fields(self.drive)
        if isinstance(variables, (str, DesignVariable)) or not variables:
            raise ValueError(
                f"Argument `variables` must be a sequence of at least one name or DesignVariable, "
                f'but is {variables!r}. Write, for example, ["thickness", "length_ratio"].'
            )
        chosen = [element for given in variables for element in self._expand(given)]
        self.variables: tuple[DesignVariable, ...] = tuple(chosen)
        if len(set(self.names)) < len(self.names):
            raise ValueError(
                f"Argument `variables` must not repeat a name, but holds {list(self.names)}."
            )
        self._in_bounds(self.values_of(self.fence, self.drive))

    def _expand(self, given: str | DesignVariable) -> list[DesignVariable]:
        """The scalar variables that a name or a variable stands for."""
        name = given if isinstance(given, str) else given.name
        field, index = element(name)
        size = self._fields[field].size if field in self._fields else 1
        scalar = field not in self._fields or self._fields[field].ndim == 0
        known = field in _FENCE_NAMES or field in self._fields
        if not known or (index is not None and (scalar or index >= size)):
            raise ValueError(
                f"Argument `variables` must name numbers of the fence {list(_FENCE_NAMES)} or of "
                f"the {type(self.drive).__name__} "
                f"{[f'{n}{list(a.shape) or str()}' for n, a in self._fields.items()]}, but holds "
                f"{name!r}."
            )
        if isinstance(given, str):
            if field not in VARIABLES:
                raise ValueError(
                    f"Argument `variables` must give bounds for {name!r}, which has no default "
                    f"ones. Write DesignVariable({name!r}, lower, upper, unit)."
                )
            given = dataclasses.replace(VARIABLES[field], name=name)
        if scalar or index is not None:
            return [given]
        return [dataclasses.replace(given, name=f"{name}[{k}]") for k in range(size)]

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
        """The variables' values [SI] in a given fence and drive."""
        numbers = {
            "thickness": fence.thickness,
            "length_ratio": fence.rigid_length / fence.flexible_length,
            "reach": fence.reach,
            "width": fence.width,
            "youngs_modulus": fence.material.youngs_modulus,
            "density": fence.material.density,
            "damping_ratio": fence.material.damping_ratio,
        }
        values = []
        for name in self.names:
            field, index = element(name)
            leaf = numbers[field] if field in numbers else getattr(drive, field)
            values.append(leaf if index is None else leaf[index])
        return jnp.stack(values)

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
        """The base fence and drive with the variables at `values` [SI]. Bounds are not checked."""
        named = dict(zip(self.names, self._vector("values", values), strict=True))
        base, drive = self.fence, self.drive
        ratio = named.get("length_ratio", base.rigid_length / base.flexible_length)
        reach = named.get("reach", base.reach)
        material = base.material
        rigid, flexible = base.rigid_length, base.flexible_length
        if "length_ratio" in named or "reach" in named:
            flexible = reach / (1 + ratio)
            rigid = flexible * ratio
        fence = Fence(
            rigid_length=rigid,
            flexible_length=flexible,
            width=named.get("width", base.width),
            thickness=named.get("thickness", base.thickness),
            material=Material(
                named.get("youngs_modulus", material.youngs_modulus),
                named.get("density", material.density),
                named.get("damping_ratio", material.damping_ratio),
            ),
            taper=base.taper,
        )
        for name, value in named.items():
            field, index = element(name)
            if field in self._fields:
                leaf = getattr(drive, field)
                new = value if index is None else leaf.at[index].set(value)
                drive = eqx.tree_at(lambda d, f=field: getattr(d, f), drive, new)
        return fence, drive

    def named(self, values: ArrayLike) -> dict[str, float]:
        """Values as plain numbers by name [SI]."""
        return dict(zip(self.names, np.asarray(values, dtype=float).tolist(), strict=True))
