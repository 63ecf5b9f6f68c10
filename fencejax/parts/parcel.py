"""The parcel: a rigid rectangle with compliant corners."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from .. import _check
from .._check import Bounds
from ..printing import Part
from .contact_laws import AbstractContactLaw, Kelvin

SIDES = {1: 2, 2: 3, 3: 4, 4: 1}
"""The other corner of the side behind each corner, clockwise."""


class Parcel(Part):
    """A rigid rectangle A x B, with A along x at phi = 0, that touches with its corners.

    Corners, seen from the centre of gravity C_s in the parcel's frame: 1 leading lower,
    2 trailing lower, 3 trailing upper, 4 leading upper.

    >>> fj.Parcel(mass=8.0, length=0.3, breadth=0.2)
    Parcel(
      mass=8 kg,
      length=300 mm,
      breadth=200 mm,
      center_x=0 m,
      center_y=0 m,
      stiffness=1.72e9 N/m^4,
      damping=330000 N s kg^-0.4 m^-3,
    )
    """

    mass: Array
    length: Array
    breadth: Array
    center_x: Array
    center_y: Array
    given_inertia: Array | None
    stiffness: Array | None
    damping: Array | None
    contact: AbstractContactLaw | None
    height: Array | None
    critical_load: Array | None
    critical_velocity_change: Array | None

    bounds: ClassVar[dict[str, Bounds]] = {
        "mass": Bounds("kg", above=0, size=10.0),
        "length": Bounds("m", above=0, size=0.4),
        "breadth": Bounds("m", above=0, size=0.4),
        "center_x": Bounds("m", size=0.4),
        "center_y": Bounds("m", size=0.4),
        "inertia": Bounds("kg m^2", above=0, size=0.3),
        "stiffness": Kelvin.bounds["stiffness"],
        "damping": Kelvin.bounds["damping"],
        "height": Bounds("m", above=0, size=0.3),
        "critical_load": Bounds(above=0, size=50.0),
        "critical_velocity_change": Bounds("m/s", above=0, size=1.0),
    }

    def __init__(
        self,
        mass: ArrayLike = 15.0,
        length: ArrayLike = 0.4,
        breadth: ArrayLike = 0.3,
        center_x: ArrayLike = 0.0,
        center_y: ArrayLike = 0.0,
        inertia: ArrayLike | None = None,
        stiffness: ArrayLike | None = None,
        damping: ArrayLike | None = None,
        contact: AbstractContactLaw | None = None,
        height: ArrayLike | None = None,
        critical_load: ArrayLike | None = None,
        critical_velocity_change: ArrayLike | None = None,
    ):
        """**Arguments:**

        - `mass`: m_p [kg], above 0.
        - `length`, `breadth`: A and B [m], above 0.
        - `center_x`, `center_y`: (x_p, y_p) [m], the centre of gravity from the geometric centre,
          inside the rectangle.
        - `inertia`: I_p about C_s [kg m^2]; by default m_p (A^2 + B^2) / 12, and it then follows
          the mass and the size.
        - `stiffness`: k_p [N/m^4], at least 0, by default 1.72e9. `damping`: b_p
          [N s kg^-0.4 m^-3], at least 0, by default 3.3e5. Both are those of the paper's contact
          law (2.2), and `None` in a parcel with another one.
        - `contact`: another contact law of the corners; by default `Kelvin(stiffness, damping)`.
        - `height` [m] above the belt, `critical_load` A_c [1], an acceleration in g, and
          `critical_velocity_change` dV_c [m/s], above 0: the limits of tipping and damage (see
          `fencejax.design.sorting.tipping`, `fencejax.design.shock.damage_boundary`). No motion
          depends on them; `None`: not known.

        Raises `ValueError` where a number is out of its bounds, or both a contact law and a number
        of the paper's law are given.
        """
        _check.fields(
            self, mass=mass, length=length, breadth=breadth, center_x=center_x, center_y=center_y,
        )  # fmt: skip
        inside = "The centre of gravity lies inside the rectangle."
        for name, offset, side in (
            ("center_x", self.center_x, self.length),
            ("center_y", self.center_y, self.breadth),
        ):
            offset, side = _check.on_host((offset, side))
            _check.scalar(f"|{name}| / half side", 2 * abs(offset) / side, most=1, remedy=inside)
        self.given_inertia = None if inertia is None else _check.field(self, "inertia", inertia)
        judged = dict(
            height=height, critical_load=critical_load,
            critical_velocity_change=critical_velocity_change,
        )  # fmt: skip
        for name, value in judged.items():
            setattr(self, name, None if value is None else _check.field(self, name, value))
        self.stiffness = self.damping = None
        if contact is not None:
            example = "contact=fj.contact_laws.Kelvin(1.72e9, 3.3e5)"
            contact = _check.part("contact", contact, AbstractContactLaw, example)
        self.contact = contact
        if contact is None:
            law = Kelvin()
            stiffness = law.stiffness if stiffness is None else stiffness
            damping = law.damping if damping is None else damping
            self.stiffness = _check.field(self, "stiffness", stiffness)
            self.damping = _check.field(self, "damping", damping)
            return
        for name, value in (("stiffness", stiffness), ("damping", damping)):
            if value is not None:
                raise ValueError(
                    f"Argument `{name}` must be None where `contact` is given, but is {value!r}: "
                    f"it is a number of the paper's contact law. Write "
                    f"contact=fj.contact_laws.Kelvin(stiffness, damping), or leave `contact` out."
                )

    @property
    def contact_law(self) -> AbstractContactLaw:
        """The contact law of the corners."""
        if self.contact is None:
            assert self.stiffness is not None
            assert self.damping is not None
            return Kelvin(self.stiffness, self.damping)
        return self.contact

    @property
    def inertia(self) -> Array:
        """I_p [kg m^2] about the centre of gravity."""
        if self.given_inertia is None:
            return self.mass * (self.length**2 + self.breadth**2) / 12
        return self.given_inertia

    def corner(self, number: int) -> tuple[Array, Array]:
        """Corner 1 ... 4 in the parcel's frame, from C_s [m]."""
        side = 0.5 if number in (1, 4) else -0.5
        height = 0.5 if number in (3, 4) else -0.5
        return side * self.length - self.center_x, height * self.breadth - self.center_y

    def side(self, number: int) -> Array:
        """Length [m] of the side from corner 1 ... 4 to the next one clockwise."""
        return self.length if number in (1, 3) else self.breadth

    @property
    def mean_distance(self) -> Array:
        """c [m], the mean distance of the rectangle's points from C_s, in closed form.

        The rectangle is cut into four at C_s. For a rectangle a x b seen from its corner, with
        d = sqrt(a^2 + b^2), the integral of the distance is
        a b d / 3 + (a^3 asinh(b / a) + b^3 asinh(a / b)) / 6.
        """
        total = 0.0
        for a in (self.length / 2 - self.center_x, self.length / 2 + self.center_x):
            for b in (self.breadth / 2 - self.center_y, self.breadth / 2 + self.center_y):
                total = total + _corner_integral(a, b)
        return total / (self.length * self.breadth)


def _corner_integral(a, b):
    """Integral of the distance from a corner over the rectangle a x b [m^3]; smooth where one of
    the sides is 0."""
    corner = (a == 0) & (b == 0)
    diagonal = jnp.sqrt(jnp.where(corner, 1.0, a**2 + b**2))
    return a * b * jnp.where(corner, 0.0, diagonal) / 3 + (_wing(a, b) + _wing(b, a)) / 6


def _wing(a, b):
    """a^3 asinh(b / |a|), 0 with its derivatives at a = 0."""
    flat = a == 0
    return a**3 * jnp.arcsinh(b / jnp.where(flat, 1.0, jnp.abs(a)))
