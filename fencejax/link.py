"""The flexible link in clamped-root modes, in SI units, and the point of it that a corner meets.

Arrays of modes come as *blocks*: a tuple with one scalar a mode where the modes are few, which the
compiler fuses and `vmap` turns into arrays with the batch last, or one array for all where they
are many.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from . import beam
from .drive import AbstractDrive, DriveMotion
from .fence import Fence
from .fidelity import Fidelity
from .propagation import Propagator, propagator

Blocks = tuple[Array, ...]

_MOST_SCALAR_MODES = 8
_SWING_STEPS = 256


def _blocks(values) -> Blocks:
    """Split (..., m) into blocks, the modes first gone or last kept."""
    modes = values.shape[-1]
    if modes > _MOST_SCALAR_MODES:
        return (jnp.asarray(values, dtype=float),)
    return tuple(jnp.asarray(values[..., i], dtype=float) for i in range(modes))


def dot(left: Blocks, right: Blocks) -> Array:
    """Sum over the modes of the product of two blocks."""
    return total(a * b for a, b in zip(left, right, strict=True))


def total(blocks) -> Array:
    """Sum over the modes."""
    result = jnp.zeros(())
    for block in blocks:
        result = result + jnp.sum(block)
    return result


class Vibration(NamedTuple):
    """Modal amplitudes [m] and their rates [m/s], as blocks."""

    amplitude: Blocks
    rate: Blocks


class Shape(NamedTuple):
    """The mode shapes at one arc coordinate: deflection [1], slope [1/m], as blocks, and the
    compliance [m/N] of the modes left out (`None` where there is none)."""

    deflection: Blocks
    slope: Blocks
    residual: Array | None
    place: Array


class FencePoint(NamedTuple):
    """A point of the fence in the frame that turns with the rigid link: position (x, y) [m],
    velocity (x_rate, y_rate) [m/s] relative to that frame, slope [rad]."""

    x: Array
    y: Array
    x_rate: Array
    y_rate: Array
    slope: Array


class FlexibleLink(eqx.Module):
    """M u'' + B u' + K u = Q - M Phi alpha'' in modes: eta'' + c eta' + w^2 eta = f.

    w = sum phi_i eta_i with phi_i dimensionless, mass-normalised by rho z h_1 l_p = m_0, so that
    eta is in metres and f_i = phi_i(sigma) Q / m_0 - p_i alpha''.
    """

    rigid_length: Array
    length: Array
    mass_scale: Array
    frequency_squared: Blocks
    lag: Array
    deflection: Blocks
    slope: Blocks
    swing: Blocks
    residual: Array | None
    bending: Blocks
    bending_flexibility: Blocks
    stress_scale: Array
    stations: Array
    swing_inertia: Array
    root_inertia: Array
    elements: int = eqx.field(static=True)

    def __init__(self, fence: Fence, fidelity: Fidelity):
        tables = beam.tables(fence.taper, fidelity.elements, fidelity.mode_count)
        self.elements = fidelity.elements
        self.rigid_length = fence.rigid_length
        self.length = fence.flexible_length
        self.mass_scale = fence.mass_scale
        rate = fence.stiffness_scale / fence.mass_scale
        self.frequency_squared = tuple(rate * value for value in _blocks(tables.eigenvalues))
        first = self.frequency_squared[0].reshape(-1)[0]
        self.lag = 2 * fence.material.damping_ratio / jnp.sqrt(first)
        self.deflection = _blocks(tables.deflection)
        self.slope = _blocks(tables.slope)
        self.swing = tuple(
            self.rigid_length * a + self.length * b
            for a, b in zip(_blocks(tables.swing_root), _blocks(tables.swing_tip), strict=True)
        )
        flexibility = 1 / fence.stiffness_scale
        residual = jnp.asarray(tables.residual, dtype=float)
        self.residual = flexibility * residual if fidelity.residual else None
        # Bending stress at the nodes: E (h / 2) |w''| = M (h / 2) / I.
        self.bending = tuple(
            fence.stiffness_scale * self.length * block for block in _blocks(tables.moment)
        )
        self.bending_flexibility = tuple(
            block / (self.mass_scale * value)
            for block, value in zip(self.bending, self.frequency_squared, strict=True)
        )
        thickness = fence.thickness * jnp.asarray(tables.relative_thickness, dtype=float)
        self.stress_scale = 6 / (fence.width * thickness**2)
        self.stations = self.length * jnp.arange(self.elements) / self.elements
        mass, first_moment, second_moment = self.mass_scale * jnp.asarray(tables.mass)
        arm = self.rigid_length
        self.swing_inertia = (
            mass * arm**2 + 2 * first_moment * arm * self.length + second_moment * self.length**2
        )
        rigid_mass = fence.material.density * fence.width * fence.thickness * arm
        self.root_inertia = rigid_mass * arm**2 / 3

    @property
    def reach(self) -> Array:
        """R_z [m]."""
        return self.rigid_length + self.length

    @property
    def damping(self) -> Blocks:
        """c_i = (2 zeta / omega_1) omega_i^2 [1/s]."""
        return tuple(self.lag * value for value in self.frequency_squared)

    def rest(self) -> Vibration:
        """No deflection, no motion."""
        zero = tuple(jnp.zeros_like(value) for value in self.frequency_squared)
        return Vibration(zero, zero)

    def propagators(self, step) -> tuple[Propagator, ...]:
        """The exact one-step map of every block."""
        return tuple(
            propagator(a, c, step)
            for a, c in zip(self.frequency_squared, self.damping, strict=True)
        )

    def inertia_force(self, drive: DriveMotion) -> Blocks:
        """-p_i alpha'' [m/s^2]: what the swing of the root does to each mode."""
        return tuple(-p * drive.acceleration for p in self.swing)

    def swung(self, drive: AbstractDrive, time: Array) -> Vibration:
        """The state at `time` of a fence that has swung free of contact from rest at t = 0."""
        step = jnp.maximum(time / _SWING_STEPS, 1e-9)
        maps = self.propagators(step)

        def advance(carry, index):
            state, force = carry
            after = self.inertia_force(drive.motion((index + 1.0) * step))
            return (propagate(maps, state, force, after), after), None

        start = (self.rest(), self.inertia_force(drive.motion(jnp.zeros_like(step))))
        (state, _), _ = jax.lax.scan(advance, start, jnp.arange(_SWING_STEPS, dtype=step.dtype))
        return state

    def shape(self, place: Array) -> Shape:
        """The shapes at the arc coordinate `place` = sigma [m].

        Zero on the rigid link; beyond the tip continued along the tangent there.
        """
        index, s = self._element(place)
        weights = beam.hermite(s)
        slopes = beam.hermite_slope(s)
        size = self.length / self.elements
        beyond = jnp.maximum(place - self.reach, 0.0)
        deflections, inclinations = [], []
        for node_deflection, node_slope in zip(self.deflection, self.slope, strict=True):
            a, c = _pick(node_deflection, index), _pick(node_deflection, index + 1)
            b, d = _pick(node_slope, index), _pick(node_slope, index + 1)
            b, d = b / self.elements, d / self.elements
            inclination = (
                a * slopes[0] + b * slopes[1] + c * slopes[2] + d * slopes[3]
            ) / size
            inclinations.append(inclination)
            deflections.append(
                a * weights[0] + b * weights[1] + c * weights[2] + d * weights[3]
                + inclination * beyond
            )
        residual = None
        if self.residual is not None:
            a, c = _pick(self.residual[:, 0], index), _pick(self.residual[:, 0], index + 1)
            b, d = _pick(self.residual[:, 1], index), _pick(self.residual[:, 1], index + 1)
            b, d = b / self.elements, d / self.elements
            residual = a * weights[0] + b * weights[1] + c * weights[2] + d * weights[3]
        return Shape(tuple(deflections), tuple(inclinations), residual, place)

    def _element(self, place):
        """Element [0, n) and local coordinate in [0, 1] of an arc coordinate."""
        position = jnp.clip((place - self.rigid_length) / self.length, 0.0, 1.0) * self.elements
        floor = jnp.floor(jax.lax.stop_gradient(position))
        index = jnp.clip(floor, 0, self.elements - 1).astype(jnp.int32)
        return index, position - index

    def tip_deflection(self, amplitude: Blocks) -> Array:
        """Deflection of the tip [m] from the straight line of the rigid link."""
        return dot(tuple(block[-1] for block in self.deflection), amplitude)

    def small_point(self, shape: Shape, deflection: Array, rate: Array, slope: Array) -> FencePoint:
        """U = sigma t_alpha + w n_alpha: a small deflection normal to the straight line."""
        return FencePoint(shape.place, deflection, jnp.zeros_like(rate), rate, slope)

    def chord_point(self, shape: Shape, state: Vibration, extra: Array, extra_rate: Array):
        """(2.14)-(2.17): the chords of the elements, each turned by its angle.

        `extra` [m] is the deflection of the modes left out at this point, and `extra_rate` its
        rate.
        """
        (x, y), (x_rate, y_rate) = jax.jvp(
            lambda amplitude: self._chain(shape.place, amplitude),
            (state.amplitude,),
            (state.rate,),
        )
        slope = dot(shape.slope, state.amplitude)
        return FencePoint(x, y + extra, x_rate, y_rate + extra_rate, slope)

    def _chain(self, place, amplitude):
        """Position in the turning frame of the point at `place` on the chain of chords."""
        index, s = self._element(place)
        size = self.length / self.elements
        deflection = sum(
            jnp.sum(table * value, -1) if jnp.ndim(value) else table * value
            for table, value in zip(self.deflection, amplitude, strict=True)
        )
        slope = sum(
            jnp.sum(table * value, -1) if jnp.ndim(value) else table * value
            for table, value in zip(self.slope, amplitude, strict=True)
        )
        angles = jnp.diff(deflection) / size
        whole = jnp.arange(self.elements) < index
        x = self.rigid_length + size * jnp.sum(jnp.where(whole, jnp.cos(angles), 0.0))
        y = size * jnp.sum(jnp.where(whole, jnp.sin(angles), 0.0))
        # The partial chord's angle, (w(d) - w_i) / d, by the cubic divided by d: free of 0 / 0.
        a, c = deflection[index], deflection[index + 1]
        b, d = slope[index] / self.elements, slope[index + 1] / self.elements
        angle = (b + s * (3 * (c - a) - 2 * b - d) + s**2 * (2 * (a - c) + b + d)) / size
        # On the rigid link and beyond the tip the line goes on straight.
        before = jnp.minimum(place - self.rigid_length, 0.0)
        beyond = jnp.maximum(place - self.reach, 0.0)
        end_slope = (b * 0 + d) / size
        return (
            x + s * size * jnp.cos(angle) + before + beyond * jnp.cos(end_slope),
            y + s * size * jnp.sin(angle) + beyond * jnp.sin(end_slope),
        )

    def bending_stress(self, amplitude: Blocks, loads, places, shapes) -> Array:
        """|sigma_b| [Pa] at the nodes 0 ... n - 1 of the link.

        Moment of the modes kept plus that of the contact loads carried statically by the modes
        left out: M = sum EI phi_i'' eta_i - sum_j r_j [(sigma_j - x)_+ - sum EI phi_i''
        phi_i(sigma_j) / (m_0 w_i^2)]. It is exact in the static limit with any number of modes.
        `loads` are the lagged contact forces r_j [N].
        """
        moment = jnp.zeros_like(self.stations)
        for table, value in zip(self.bending, amplitude, strict=True):
            moment = moment + (table @ value if jnp.ndim(value) else table * value)
        for load, place, shape in zip(loads, places, shapes, strict=True):
            reached = jnp.minimum(place, self.reach)
            moment = moment - load * jnp.maximum(reached - self.rigid_length - self.stations, 0.0)
            for table, value in zip(self.bending_flexibility, shape.deflection, strict=True):
                moment = moment + load * (table @ value if jnp.ndim(value) else table * value)
        return jnp.abs(moment) * self.stress_scale


def _pick(table: Array, index: Array) -> Array:
    return table.at[index].get(mode="promise_in_bounds")


def propagate(maps, state: Vibration, start: Blocks, end: Blocks) -> Vibration:
    """One exact step under modal forces [m/s^2] that vary linearly from `start` to `end`."""
    amplitude, rate = [], []
    for m, q, v, f0, f1 in zip(maps, state.amplitude, state.rate, start, end, strict=True):
        amplitude.append(m.qq * q + m.qv * v + m.q_start * f0 + m.q_end * f1)
        rate.append(m.vq * q + m.vv * v + m.v_start * f0 + m.v_end * f1)
    return Vibration(tuple(amplitude), tuple(rate))
