"""The flexible link by finite elements, dimensionless: matrices, clamped modes, static compliance.

Two-node cubic-Hermite Euler-Bernoulli elements on x / l_p in [0, 1], with the mass and stiffness
of the tapered section (2.1) integrated exactly inside each element. In units of rho z h_1 l_p
(mass) and E I_1 / l_p^3 (stiffness) nothing but the profile of the thickness is left, so for a
profile without parameters everything here is done once, in NumPy, before the program is traced;
for a profile with traced parameters the same code runs in JAX, inside the program.
"""

import functools
from types import ModuleType
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..parts import AbstractTaper

ARC_MODES = 3
# Points of Gauss's rule in an element: exact for polynomials up to the degree 19.
_GAUSS_POINTS = 10


class BeamTables(NamedTuple):
    """The tables of the clamped flexible link for a simulation, dimensionless.

    n elements, m modes; the shapes are mass-normalised, positive at the tip; node 0 is the root.
    """

    eigenvalues: Any
    """(m,): omega_i^2 in units of E I_1 / (rho z h_1 l_p^4)."""
    deflection: Any
    """(n + 1, m): shapes at the nodes."""
    slope: Any
    """(n + 1, m): their derivatives in x / l_p."""
    swing_root: Any
    """(m,): integral of g phi_i, the share of a rigid translation."""
    swing_tip: Any
    """(m,): integral of g (x / l_p) phi_i, the share of a rigid rotation about the root."""
    mass: Any
    """(3,): integrals of g, g x / l_p and g (x / l_p)^2."""
    residual: Any
    """(n, 7): deflection under a unit force at the same point, less the share of the m modes, in
    units of l_p^3 / (E I_1): in each element a polynomial of the sixth degree in its local
    coordinate, lowest power first."""
    residual_tip: Any
    """(n + 1, 2): the same for the deflection of the tip under a unit force at the node."""
    moment: Any
    """(n, m): bending moment of each mode at the nodes 0 ... n - 1, per unit modal amplitude, in
    units of E I_1 / l_p^2, from the balance of the inertia forces beyond the node."""
    relative_thickness: Any
    """(n,): g at the nodes 0 ... n - 1."""
    shortening: Any
    """(n + 1, a, a, 2): integral of 1/2 phi_i' phi_j' from the root to the node, and its derivative
    in x / l_p there: how much of its length the link, bent in its first modes, `ARC_MODES` at most,
    loses along the straight line."""
    cubed: Any
    """(n + 1, 2): integral of 1/6 phi_1'^3, and its derivative: what the sine of the first mode's
    slope takes off the deflection."""


def hermite(s: Any) -> tuple[Any, Any, Any, Any]:
    """The cubic shape functions at s in [0, 1], for an element of unit length: deflection and slope
    at the first node, deflection and slope at the second.

    Paper: (2.17).
    """
    return (
        1 - 3 * s**2 + 2 * s**3,
        s - 2 * s**2 + s**3,
        3 * s**2 - 2 * s**3,
        s**3 - s**2,
    )


def hermite_slope(s: Any) -> tuple[Any, Any, Any, Any]:
    """Derivatives of `hermite`."""
    return (-6 * s + 6 * s**2, 1 - 4 * s + 3 * s**2, 6 * s - 6 * s**2, 3 * s**2 - 2 * s)


def _hermite_curvature(s):
    return (-6 + 12 * s, -4 + 6 * s, 6 - 12 * s, 6 * s - 2)


def _quadrature(elements: int):
    """Gauss points in every element: positions, tip distances and weights, each (elements, q).

    The points are Gauss points in sqrt(1 - x / l_p), in which the square-root taper and all powers
    of x are polynomials, so that both the mass and the stiffness are integrated exactly.
    """
    nodes, weights = np.polynomial.legendre.leggauss(_GAUSS_POINTS)
    edges = np.sqrt(1.0 - np.arange(elements + 1) / elements)
    first, last = edges[:-1, None], edges[1:, None]
    root = 0.5 * (first + last) + 0.5 * (first - last) * nodes
    weight = 0.5 * (first - last) * weights * 2.0 * root
    return 1.0 - root**2, root**2, weight


def matrices(taper: AbstractTaper, elements: int, xp: ModuleType = np) -> tuple[Any, Any]:
    """Mass and stiffness of the free link: (2 n + 2, 2 n + 2) each, in units of rho z h_1 l_p and
    E I_1 / l_p^3, for the degrees of freedom (w, dw/d(x / l_p)) node after node.

    M = integral of g H H^T, K = integral of g^3 H'' H''^T.
    """
    position, tip_distance, weight = _quadrature(elements)
    length = 1.0 / elements
    local = position * elements - np.arange(elements)[:, None]
    scale = np.array([1.0, length, 1.0, length])
    shape = np.stack(hermite(local), -1) * scale
    curvature = np.stack(_hermite_curvature(local), -1) * scale / length**2
    g = taper(position, tip_distance)
    mass = xp.einsum("eq,eqi,eqj->eij", weight * g, shape, shape)
    stiffness = xp.einsum("eq,eqi,eqj->eij", weight * g**3, curvature, curvature)
    # Sum the elements with a one-hot map, which NumPy and JAX share.
    place = np.zeros((elements, 4, 2 * elements + 2))
    for element in range(elements):
        place[element, np.arange(4), 2 * element + np.arange(4)] = 1.0
    assemble = functools.partial(xp.einsum, "eia,eij,ejb->ab", optimize=True)
    return assemble(place, mass, place), assemble(place, stiffness, place)


def _clamped_modes(mass, stiffness, xp):
    """Eigenvalues and mass-normalised vectors of the link clamped at its root, by Cholesky."""
    lower = xp.linalg.cholesky(mass[2:, 2:])
    half = xp.linalg.solve(lower, stiffness[2:, 2:])
    reduced = xp.linalg.solve(lower, half.T)
    values, vectors = xp.linalg.eigh(0.5 * (reduced + reduced.T))
    shapes = xp.linalg.solve(lower.T, vectors)
    return values, shapes * xp.sign(shapes[-2])[None]


def build_tables(
    taper: AbstractTaper, elements: int, modes: int, xp: ModuleType = np
) -> BeamTables:
    """The tables of a taper, with `xp` either NumPy or JAX's NumPy.

    `modes` may be 0 (a rigid fence) up to 2 `elements` (all of them).
    """
    mass, stiffness = matrices(taper, elements, xp)
    values, vectors = _clamped_modes(mass, stiffness, xp)
    values, vectors = values[:modes], vectors[:, :modes]
    zero = np.zeros((2, modes))
    full = xp.concatenate([zero, vectors])
    deflection, slope = full[0::2], full[1::2]

    stations = np.arange(elements + 1) / elements
    translation = np.stack([np.ones(elements + 1), np.zeros(elements + 1)], -1).ravel()
    rotation = np.stack([stations, np.ones(elements + 1)], -1).ravel()
    swing_root = full.T @ (mass @ translation)
    swing_tip = full.T @ (mass @ rotation)
    moments_of_mass = xp.stack(
        [
            translation @ mass @ translation,
            translation @ mass @ rotation,
            rotation @ mass @ rotation,
        ]
    )

    # Static compliance, less that of the modes.
    compliance = xp.linalg.solve(stiffness[2:, 2:], np.eye(2 * elements))
    modal = (vectors / values[None]) @ vectors.T if modes else 0.0 * compliance
    left = compliance - modal
    cubics = _CUBICS * np.array([1.0, 1.0 / elements, 1.0, 1.0 / elements])[:, None]
    tip = xp.stack([left[-2, 0::2], left[-2, 1::2]], -1)

    return BeamTables(
        eigenvalues=values,
        deflection=deflection,
        slope=slope,
        swing_root=swing_root,
        swing_tip=swing_tip,
        mass=moments_of_mass,
        residual=_within(left, cubics, xp),
        residual_tip=xp.concatenate([np.zeros((1, 2)), tip]),
        moment=_moments(taper, elements, values, full, xp),
        relative_thickness=taper(stations[:-1], 1.0 - stations[:-1]) + 0.0 * values[:1].sum(),
        shortening=integrated(
            lambda s: 0.5 * s[..., :, None] * s[..., None, :], full[:, :ARC_MODES], xp
        ),
        cubed=integrated(lambda s: s[..., :1].sum(-1) ** 3 / 6, full[:, :1], xp),
    )


_CUBICS = np.array([[1, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]], dtype=float)
"""Coefficients of `hermite`, lowest power first."""


def _within(compliance, cubics, xp):
    """Compliance at a point of each element, a polynomial in the local coordinate (n, 7), from that
    of the nodes of the clamped link (2 n, 2 n) and the cubics by which the element's four degrees
    of freedom make the deflection there and, by virtual work, share the load, (4, 4)."""
    size = compliance.shape[0]
    edge = np.zeros((2, size))
    full = xp.concatenate([edge, compliance])
    full = xp.concatenate([np.zeros((size + 2, 2)), full], axis=1)
    dofs = 2 * np.arange(size // 2)[:, None] + np.arange(4)
    blocks = full[dofs[:, :, None], dofs[:, None, :]]
    product = np.zeros((4, 4, 7))
    for a in range(4):
        for b in range(4):
            product[a, b, a + b] = 1.0
    powers = np.einsum("ia,jb,abk->ijk", cubics, cubics, product)
    return xp.einsum("eij,ijk->ek", blocks, powers)


def integrated(function, full, xp):
    """Integral of a polynomial of the mode slopes from the root to each node, and its derivative
    there, in a new last axis. Exact up to the sixth degree of the element's coordinate."""
    elements = full.shape[0] // 2 - 1
    nodes, weights = np.polynomial.legendre.leggauss(4)
    scale = np.array([1.0, 1.0 / elements, 1.0, 1.0 / elements]) * elements
    shape = np.stack(hermite_slope(0.5 * (1 + nodes)), -1) * scale
    dofs = 2 * np.arange(elements)[:, None] + np.arange(4)
    slopes = xp.einsum("qi,eim->eqm", shape, full[dofs])
    parts = xp.einsum("q,eq...->e...", 0.5 * weights / elements, function(slopes))
    start = np.zeros((1, *parts.shape[1:]))
    values = xp.concatenate([start, xp.cumsum(parts, axis=0)])
    return xp.stack([values, function(full[1::2])], -1)


def _moments(taper, elements, values, full, xp):
    """M_i(x) = omega_i^2 integral from x to the tip of (s - x) g phi_i ds, at the first n nodes."""
    position, tip_distance, weight = _quadrature(elements)
    local = position * elements - np.arange(elements)[:, None]
    scale = np.array([1.0, 1.0 / elements, 1.0, 1.0 / elements])
    shape = np.stack(hermite(local), -1) * scale
    dofs = 2 * np.arange(elements)[:, None] + np.arange(4)
    phi = xp.einsum("eqi,eim->eqm", shape, full[dofs])
    inertia = (weight * taper(position, tip_distance))[..., None] * phi
    nodes = np.arange(elements) / elements
    arm = np.maximum(position[None] - nodes[:, None, None], 0.0)
    return values[None] * xp.einsum("neq,eqm->nm", arm, inertia)


@functools.lru_cache(maxsize=64)
def _cached(structure, elements: int, modes: int) -> BeamTables:
    return build_tables(jax.tree.unflatten(structure, []), elements, modes, np)


def tables(taper: AbstractTaper, elements: int, modes: int) -> BeamTables:
    """The tables of a taper: from NumPy, once, if it has no parameters; else traced. Always in the
    default precision, whatever that of the parameters."""
    leaves, structure = jax.tree.flatten(taper)
    if not leaves:
        return _cached(structure, elements, modes)
    taper = jax.tree.map(lambda leaf: jnp.asarray(leaf).astype(float), taper)
    return build_tables(taper, elements, modes, jnp)
