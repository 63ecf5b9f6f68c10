"""The fence: a rigid link hinged to the border, followed by a flexible one."""

from collections.abc import Callable
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from .. import _check
from .._check import Bounds
from ..printing import Part
from .material import Material
from .pad import Pad
from .rest_shape import RestShape
from .second_order import SecondOrderLoads
from .shaft import Shaft
from .shear import Shear
from .tapers import AbstractTaper, ConstantStrength


class Fence(Part):
    """A rigid link of length l_s and a flexible link of length l_p, both of width z.

    The thickness of the flexible link is h(x) = h_1 g(x / l_p); the rigid link is h_1 thick
    throughout, which matters for the drive torque alone. The defaults are the two-link fence of
    Piatkowski (2010).

    >>> sheet = fj.materials.pet()
    >>> fj.Fence(thickness=0.04, material=sheet.material)
    Fence(
      rigid_length=450 mm,
      flexible_length=750 mm,
      width=132 mm,
      thickness=40 mm,
      material=Material(
        youngs_modulus=3.1 GPa,
        density=1390 kg/m^3,
        damping_ratio=0.006,
        fatigue_exponent=12.02,
      ),
      taper=ConstantStrength(),
    )
    """

    rigid_length: Array
    flexible_length: Array
    width: Array
    thickness: Array
    material: Material
    taper: AbstractTaper
    pad: Pad | None
    shaft: Shaft | None
    rest_shape: RestShape | None
    edge_radius: Array | None
    shear: Shear | None
    second_order: SecondOrderLoads | None

    bounds: ClassVar[dict[str, Bounds]] = {
        "rigid_length": Bounds("m", least=0, size=1.0),
        "flexible_length": Bounds("m", above=0, size=1.0),
        "width": Bounds("m", above=0, size=0.1),
        "thickness": Bounds("m", above=0, size=0.05),
        "edge_radius": Bounds("m", least=0, size=0.01),
    }

    def __init__(
        self,
        rigid_length: ArrayLike = 0.45,
        flexible_length: ArrayLike = 0.75,
        width: ArrayLike = 0.132,
        thickness: ArrayLike = 0.045,
        material: Material | None = None,
        taper: AbstractTaper | None = None,
        pad: Pad | None = None,
        shaft: Shaft | None = None,
        rest_shape: RestShape | None = None,
        edge_radius: ArrayLike | None = None,
        shear: Shear | None = None,
        second_order: SecondOrderLoads | None = None,
    ):
        """**Arguments:**

        - `rigid_length`: l_s [m], at least 0 (0: the one-link fence).
        - `flexible_length`: l_p [m], above 0.
        - `width`: z [m], above 0.
        - `thickness`: h_1 [m] of the flexible link at its root, above 0.
        - `material`: default `Material()`.
        - `taper`: the profile of the thickness, default `ConstantStrength()`.
        - `pad`: an elastic cover between parcel and fence; by default none.
        - `shaft`: a flexible shaft between motor and hinge; by default the connection is rigid.
        - `rest_shape`: the curve of the flexible link at rest, at most
          `RestShape.steepest` steep; by default it is straight.
        - `edge_radius`: r [m] of the tip's edge, at least 0: an arc about the point r behind the
          end of the face, where the tip carries a contact on the parcel's side
          (`fencejax.model.tip`); by default the tip is sharp. It has no mass of its own.
        - `shear`: the compliance of the flexible link in shear; by default there is none.
        - `second_order`: the second-order loads that act; by default none, as in the paper.
        """
        _check.fields(
            self, rigid_length=rigid_length, flexible_length=flexible_length, width=width,
            thickness=thickness,
        )  # fmt: skip
        material = Material() if material is None else material
        taper = ConstantStrength() if taper is None else taper
        example = "material=fj.materials.named('POM').material"
        self.material = _check.part("material", material, Material, example)
        self.taper = _check.part("taper", taper, AbstractTaper, "taper=fj.Uniform()")
        self.edge_radius = None
        if edge_radius is not None:
            self.edge_radius = _check.field(self, "edge_radius", edge_radius)
        self.shaft = None
        if shaft is not None:
            self.shaft = _check.part("shaft", shaft, Shaft, "shaft=fj.Shaft(stiffness=1e5)")
        self.shear = None
        if shear is not None:
            self.shear = _check.part("shear", shear, Shear, "shear=fj.Shear()")
        self.second_order = None
        if second_order is not None:
            example = "second_order=fj.SecondOrderLoads()"
            self.second_order = _check.part(
                "second_order", second_order, SecondOrderLoads, example
            )
        self.pad = None if pad is None else _check.part("pad", pad, Pad, "pad=fj.Pad(0.01)")
        self.rest_shape = None
        if rest_shape is not None:
            example = "rest_shape=fj.RestShape(tip=0.05)"
            self.rest_shape = _check.part("rest_shape", rest_shape, RestShape, example)
            steep = self.rest_shape.steepness(self.flexible_length)
            remedy = "Write fj.RestShape with a smaller tip and middle, or a longer link."
            _check.scalar(
                "rest_shape.steepness", steep, most=RestShape.steepest, unit="rad", remedy=remedy
            )

    @classmethod
    def one_link(cls, **changes) -> "Fence":
        """The paper's one-link fence: l_s = 0, l_p = 1.2 m, h_1 = 0.073 m."""
        numbers = dict(rigid_length=0.0, flexible_length=1.2, thickness=0.073)
        return cls(**{**numbers, **changes})

    @property
    def reach(self) -> Array:
        """R_z = l_s + l_p [m], from the hinge to the tip."""
        return self.rigid_length + self.flexible_length

    def rise(self, place: ArrayLike) -> Array:
        """Distance of the face at rest ahead of the rigid link's line [m], at an arc coordinate
        [m]."""
        if self.rest_shape is None:
            return jnp.zeros_like(self.rigid_length + place)
        share = (place - self.rigid_length) / self.flexible_length
        return self.rest_shape.at(share, self.flexible_length).deflection

    def height(self, place: ArrayLike, angle: ArrayLike) -> Array:
        """Distance of the face at rest from the border's line through the hinge [m], at an arc
        coordinate [m], with the rigid link at an `angle` [rad] to that line."""
        return jnp.asarray(place) * jnp.sin(angle) + self.rise(place) * jnp.cos(angle)

    def _mean(self, weight: Callable[[Array], Array]) -> Array:
        """Mean over the flexible link of g times a `weight` of x / l_p [1], by Gauss-Legendre
        quadrature.

        In u, tip_distance = u^2, piece by piece between the taper's breaks: exact for uniform,
        constant-strength, stepped and piecewise linear links.
        """
        node, weights = np.polynomial.legendre.leggauss(24)
        edges = np.sqrt(1.0 - np.array([0.0, *self.taper.breaks, 1.0]))
        half = 0.5 * (edges[:-1, None] - edges[1:, None])
        root = edges[1:, None] + half * (1 + node)
        precision = self.thickness.dtype
        relative = jnp.asarray(self.taper(1 - root**2, root**2)).astype(precision)
        relative = relative * weight(jnp.asarray(1 - root**2, dtype=precision))
        return jnp.sum(relative * jnp.asarray(2 * half * weights * root, dtype=precision))

    @property
    def mass(self) -> Array:
        """rho z h_1 (l_s + l_p mean of g) [kg]."""
        section = self.material.density * self.width * self.thickness
        mean = self._mean(jnp.ones_like)
        return section * (self.rigid_length + self.flexible_length * mean)

    @property
    def inertia(self) -> Array:
        """rho z h_1 (l_s^3 / 3 + l_p mean of g (l_s + x)^2) [kg m^2], of the straight fence about
        its hinge."""
        section = self.material.density * self.width * self.thickness
        mean = self._mean(lambda x: (self.rigid_length + self.flexible_length * x) ** 2)
        return section * (self.rigid_length**3 / 3 + self.flexible_length * mean)

    @property
    def mass_scale(self) -> Array:
        """rho z h_1 l_p [kg]: the mass of a flexible link of uniform thickness h_1."""
        return self.material.density * self.width * self.thickness * self.flexible_length

    @property
    def stiffness_scale(self) -> Array:
        """E I_1 / l_p^3 [N/m], with I_1 = z h_1^3 / 12 the second moment at the root."""
        second_moment = self.width * self.thickness**3 / 12
        return self.material.youngs_modulus * second_moment / self.flexible_length**3
