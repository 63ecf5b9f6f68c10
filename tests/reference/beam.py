"""Finite elements of the fence's flexible link, in NumPy.

Two-node cubic-Hermite Euler-Bernoulli elements on a cantilever of constant bending strength,
h(x) = h1 sqrt((l_p - x)/l_p), x from the clamped root (T. Piatkowski, J. Theor. Appl. Mech.
48(1), 2010, section 2.1). Node values are the transverse displacement [m] and the slope [rad].
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh


class Modes(NamedTuple):
    """Clamped-root modes of the flexible link, normalised to unit modal mass.

    frequency: circular frequencies omega [rad/s], ascending, shape (modes,).
    damping: modal damping c of eta'' + c eta' + omega^2 eta [1/s], c = 2 zeta omega^2/omega_1.
    displacement: q3 of every node, root included, per unit eta [kg^-1/2], (elements + 1, modes).
    slope: q5 of every node per unit eta [1/(m kg^1/2)], (elements + 1, modes).
    participation: V^T M Phi, Phi = (l_s + x, 1) the rigid swing [kg^1/2 m], (modes,).
    """

    frequency: np.ndarray
    damping: np.ndarray
    displacement: np.ndarray
    slope: np.ndarray
    participation: np.ndarray


def hermite(position, length):
    """Hermite cubics of one element as powers of `position`, and their second derivatives.

    position: distance from the element's first node [m], any shape.
    length: element length [m].
    Returns (values, curvatures), each with a last axis of four: displacement and slope of the
    first node, then of the second. Units [1, m, 1, m] and [1/m^2, 1/m, 1/m^2, 1/m].
    """
    r = np.asarray(position) / length
    values = np.stack(
        [
            1 - 3 * r**2 + 2 * r**3,
            length * (r - 2 * r**2 + r**3),
            3 * r**2 - 2 * r**3,
            length * (r**3 - r**2),
        ],
        axis=-1,
    )
    curvatures = np.stack(
        [
            (12 * r - 6) / length**2,
            (6 * r - 4) / length,
            (6 - 12 * r) / length**2,
            (6 * r - 2) / length,
        ],
        axis=-1,
    )
    return values, curvatures


def matrices(length, width, thickness, modulus, density, elements):
    """Mass and stiffness matrices of the free link, root degrees of freedom included.

    M = int rho z h H^T H dx and K = int E (z h^3/12) H''^T H'' dx over each element. With
    s = sqrt(1 - x/l_p) both integrands are polynomials in s, of degree 14 and 8, so the ten
    Gauss points used are exact.

    length: l_p [m]. width: z [m]. thickness: h1 at the root [m]. modulus: E [Pa].
    density: rho [kg/m^3]. elements: number of equal elements.
    Returns (M, K), (2 elements + 2) square, ordered displacement, slope, node by node.
    """
    size = length / elements
    nodes = size * np.arange(elements + 1)
    s_of_node = np.sqrt(1 - np.arange(elements + 1) / elements)
    points, weights = np.polynomial.legendre.leggauss(10)
    first, last = s_of_node[:-1, None], s_of_node[1:, None]
    s = 0.5 * (first + last) + 0.5 * (first - last) * points
    x = length * (1 - s**2)
    dx = 0.5 * (first - last) * weights * 2 * length * s
    values, curvatures = hermite(x - nodes[:-1, None], size)
    thick = thickness * s
    mass_blocks = np.einsum("eg,egi,egj->eij", density * width * thick * dx, values, values)
    bending = modulus * width * thick**3 / 12
    stiffness_blocks = np.einsum("eg,egi,egj->eij", bending * dx, curvatures, curvatures)
    mass = np.zeros((2 * elements + 2, 2 * elements + 2))
    stiffness = np.zeros_like(mass)
    for element in range(elements):
        block = slice(2 * element, 2 * element + 4)
        mass[block, block] += mass_blocks[element]
        stiffness[block, block] += stiffness_blocks[element]
    return mass, stiffness


def clamped_modes(
    rigid_length, length, width, thickness, modulus, density, damping_ratio, elements, count=None
):
    """Modes of the link clamped at its root, from K v = omega^2 M v.

    rigid_length: l_s [m], enters the participation only. damping_ratio: zeta of mode 1 [-], with
    damping proportional to stiffness, B = (2 zeta/omega_1) K. count: how many of the
    2 `elements` modes to keep (default all). Other arguments as in `matrices`.
    """
    mass, stiffness = matrices(length, width, thickness, modulus, density, elements)
    # The inverse problem (largest 1/omega^2) keeps the low modes accurate to round-off.
    inverse_square, vectors = eigh(mass[2:, 2:], stiffness[2:, 2:])
    inverse_square, vectors = inverse_square[::-1], vectors[:, ::-1]
    frequency = 1 / np.sqrt(inverse_square)
    vectors = vectors * frequency  # v^T K v = 1 becomes v^T M v = 1
    vectors = vectors * np.sign(vectors[-2])
    swing = np.ones(2 * elements + 2)
    swing[::2] = rigid_length + length / elements * np.arange(elements + 1)
    participation = vectors.T @ (mass[2:] @ swing)
    damping = 2 * damping_ratio * frequency**2 / frequency[0]
    root = np.zeros((1, vectors.shape[1]))
    kept = slice(count)
    return Modes(
        frequency[kept],
        damping[kept],
        np.concatenate([root, vectors[::2]])[:, kept],
        np.concatenate([root, vectors[1::2]])[:, kept],
        participation[kept],
    )
