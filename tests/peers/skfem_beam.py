"""scikit-fem: eigenfrequencies of a clamped link on its own Hermite elements and assembly."""

import numpy as np
import skfem
from scipy.linalg import eigh
from skfem.helpers import dd

VERSION = skfem.__version__


def frequencies(
    thickness, modulus, density, length, width, elements=20, profile=None, points=None, count=4
):
    """The lowest frequencies [Hz] of a link clamped at x = 0 and free at x = l_p.

    thickness: h_1 [m]. modulus: E [Pa]. density: rho [kg/m^3]. length: l_p [m]. width: z [m].
    elements: of equal length. profile: h / h_1 over x / l_p, the constant-strength taper by
    default. points: of the Gauss quadrature in each element; the taper's end, where it is singular,
    needs many. count: how many.

    Bilinear forms: M(u, v) = integral of rho z h u v and K(u, v) = integral of
    E z h^3 / 12 u'' v''.
    """
    if profile is None:
        profile = _constant_strength
    mesh = skfem.MeshLine(np.linspace(0.0, length, elements + 1))
    degree = 2 * (points or 60) - 1
    basis = skfem.Basis(mesh, skfem.ElementLineHermite(), intorder=degree)

    @skfem.BilinearForm
    def mass(u, v, w):
        return density * width * thickness * profile(w.x[0] / length) * u * v

    @skfem.BilinearForm
    def stiffness(u, v, w):
        height = thickness * profile(w.x[0] / length)
        return modulus * width * height**3 / 12 * dd(u)[0, 0] * dd(v)[0, 0]

    root = basis.get_dofs(lambda x: np.isclose(x[0], 0.0)).all()
    free = np.setdiff1d(np.arange(basis.N), root)
    m = mass.assemble(basis).toarray()[np.ix_(free, free)]
    k = stiffness.assemble(basis).toarray()[np.ix_(free, free)]
    inverse = eigh(m, k, eigvals_only=True)[::-1]
    return 1 / np.sqrt(inverse[:count]) / (2 * np.pi)


def _constant_strength(position):
    return np.sqrt(np.maximum(1.0 - position, 0.0))
