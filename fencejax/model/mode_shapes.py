"""The mode shapes between the nodes of the flexible link: the elements' polynomials in one table,
and their values at one place."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Fidelity
from .beam import ARC_MODES, BeamTables

MOST_SCALAR_MODES = 8

Blocks = tuple[Array, ...]


class Sampled(NamedTuple):
    """The dimensionless shapes at a place, m modes.

    `deflection` and `load` [1], `slope` in the element's local coordinate; the compliances of the
    modes left out in units of l_p^3 / (E I_1), and how the first of them rises in the element's
    local coordinate, `None` where there are none; the arc integrals of pairs of modes and of the
    cube of the first, in units of 1 / l_p and 1 / l_p^2, `None` unless the geometry needs them.
    """

    deflection: Blocks
    slope: Blocks
    load: Blocks
    residual: Array | None
    residual_rise: Array | None
    residual_tip: Array | None
    pairs: tuple[Array, ...] | None
    cube: Array | None

    def yielding(
        self, flexibility: Array, scale: Array, shear: tuple[Array, Array] | None
    ) -> tuple[Array, tuple[Array, Array], Array] | None:
        """The compliance at the place besides that of the modes kept [m/N], the residual mode's
        deflection [m/J^0.5] and slope [rad/J^0.5], and the compliance at the tip [m/N]; `None`
        without any. `flexibility` is l_p^3 / (E I_1), `scale` n / l_p [1/m], and `shear` the
        compliance in shear [m/N] and its derivative along the link, if it yields in shear."""
        if self.residual is None:
            if shear is None:
                return None
            give, rise = shear
            mode = jnp.sqrt(give + flexibility * jnp.finfo(give.dtype).eps)
            return give, (mode, 0.5 * rise / mode), give
        assert self.residual_rise is not None
        assert self.residual_tip is not None
        own = flexibility * self.residual
        # It may be negative by round-off, and the root of 0 has no derivative.
        kept = jnp.maximum(self.residual, 0.0) + jnp.finfo(own.dtype).eps
        if shear is None:
            mode = jnp.sqrt(flexibility * kept)
            slope = 0.5 * flexibility * scale * self.residual_rise / mode
            return own, (mode, slope), flexibility * self.residual_tip
        give, rise = shear
        mode = jnp.sqrt(flexibility * kept + give)
        slope = 0.5 * (flexibility * scale * self.residual_rise + rise) / mode
        return own + give, (mode, slope), flexibility * self.residual_tip + give


class ShapeTable(eqx.Module):
    """The coefficients of the elements' polynomials, dimensionless: constants of the program unless
    the taper is traced. Each is an array of its own over the elements: on a CPU the compiler makes
    one kernel of a step only while no array of it exceeds 512 bytes.
    """

    cubics: tuple[tuple[Array, ...], ...]
    residual: tuple[Array, ...] | None
    modes: int = eqx.field(static=True)
    arc_modes: int = eqx.field(static=True)
    shared: bool = eqx.field(static=True)
    corrected: bool = eqx.field(static=True)

    def __init__(self, tables: BeamTables, fidelity: Fidelity):
        n = fidelity.elements
        self.modes = tables.deflection.shape[1]
        self.arc_modes = arc_modes(fidelity)
        self.shared = fidelity.load == "shared"
        self.corrected = fidelity.residual
        parts = [cubics(tables.deflection, tables.slope, n)]
        if self.shared:
            parts.append(_lines(tables.deflection))
        if self.corrected:
            parts.append(cubics(tables.residual_tip[:, :1], tables.residual_tip[:, 1:], n))
        for i in range(self.arc_modes):
            for j in range(i, self.arc_modes):
                pair = tables.shortening[:, i, j] * (1.0 if i == j else 2.0)
                parts.append(cubics(pair[:, :1], pair[:, 1:], n))
        if self.arc_modes:
            parts.append(cubics(tables.cubed[:, :1], tables.cubed[:, 1:], n))
        self.cubics = tuple(
            tuple(jnp.asarray(coefficient[:, k]) for coefficient in part)
            for part in parts
            for k in _columns(part[0].shape[1])
        )
        self.residual = None
        if self.corrected:
            self.residual = tuple(jnp.asarray(tables.residual[:, k]) for k in range(7))

    def at(self, index: Array, s: Array) -> Sampled:
        """The shapes in element `index` at its local coordinate `s` in [0, 1]."""
        values, slopes = [], []
        for table in self.cubics:
            a, b, c, d = (entry(column, index) for column in table)
            values.append(a + s * (b + s * (c + s * d)))
            slopes.append(b + s * (2 * c + 3 * s * d))
        m = len(_columns(self.modes))
        deflection, slope = tuple(values[:m]), tuple(slopes[:m])
        load, at = deflection, m
        if self.shared:
            load, at = tuple(values[m : 2 * m]), 2 * m
        residual = rise = residual_tip = pairs = cube = None
        if self.residual is not None:
            residual_tip, at = values[at], at + 1
            residual, rise = _polynomial([entry(column, index) for column in self.residual], s)
        if self.arc_modes:
            *pairs, cube = values[at:]
            pairs = tuple(pairs)
        return Sampled(deflection, slope, load, residual, rise, residual_tip, pairs, cube)


def arc_modes(fidelity: Fidelity) -> int:
    """The number of modes that an arc is computed from; 0 in the other geometries."""
    return min(fidelity.mode_count, ARC_MODES) if fidelity.geometry == "arc" else 0


def _columns(modes: int) -> list:
    """The modes one by one where they are few, else all in one."""
    return list(range(modes)) if modes <= MOST_SCALAR_MODES else [slice(0, modes)]


def entry(column: Array, index: Array) -> Array:
    """The entry of one element in an array over the elements."""
    return jax.lax.dynamic_index_in_dim(column, index, keepdims=False)


def _polynomial(coefficients, s: Array) -> tuple[Array, Array]:
    """The value and the derivative at `s` of a polynomial, lowest power first."""
    value, slope = coefficients[-1], jnp.zeros_like(s)
    for coefficient in reversed(coefficients[:-1]):
        slope = value + s * slope
        value = coefficient + s * value
    return value, slope


def cubics(value, slope, elements: int):
    """The four coefficients (n, k) each, in the local coordinate, of the elements' cubics with the
    given values and slopes in x / l_p at the nodes, (n + 1, k) each."""
    a, c = value[:-1], value[1:]
    b, d = slope[:-1] / elements, slope[1:] / elements
    return a, b, 3 * (c - a) - 2 * b - d, 2 * (a - c) + b + d


def _lines(value):
    """The coefficients of linear functions between the nodes: a load at d shared by the two nodes
    beside it as 1 - d / Delta l and d / Delta l.

    Paper: (2.8).
    """
    a, rise = value[:-1], value[1:] - value[:-1]
    return a, rise, 0 * rise, 0 * rise
