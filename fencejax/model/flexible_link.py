"""The flexible link in clamped-root modes, in SI units, and the point of it that a corner meets."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..fidelity import Fidelity
from ..parts import AbstractDrive, AbstractTorqueDrive, DriveMotion, Fence, SecondOrderLoads
from . import beam
from .fence_geometry import Arc, FencePoint, arc, arc_point, chain, small_point
from .hinge import ClampedLink, Hinge
from .mode_shapes import Blocks, ShapeTable, arc_modes
from .pad import Cover
from .propagation import Propagator, propagator
from .rest_shape import RestTable
from .second_order import Chords, following
from .section import SectionTable
from .shape import Shape
from .vibration import Vibration, blocks, combined, dot, one_by_one


class FlexibleLink(eqx.Module):
    """M u'' + B u' + K u = Q - M Phi alpha'' in modes: eta'' + c eta' + w^2 eta = f.

    w = sum phi_i eta_i with phi_i dimensionless, mass-normalised by rho z h_1 l_p = m_0, so that
    eta is in metres and f_i = phi_i(sigma) Q / m_0 - p_i alpha''.

    On a shaft that gives way the modes are those of fence and shaft together, with a rotation of
    the rigid link each (`fencejax.model.hinge`), and alpha is the motor's angle. On a torque drive
    the fence's rotation is among the modes too, and alpha = 0.
    """

    rigid_length: Array
    length: Array
    mass_scale: Array
    eigenvalues: Array
    frequency_squared: Blocks
    lag: Array
    deflection: Blocks
    slope: Blocks
    table: ShapeTable
    flexibility: Array
    swing: Blocks
    bending: Blocks
    bending_flexibility: Blocks
    stress_scale: Array
    stations: Array
    swing_inertia: Array
    root_inertia: Array
    cover: Cover | None
    hinge: Hinge | None
    rest_table: RestTable | None
    section: SectionTable | None
    second_order: SecondOrderLoads | None
    elements: int = eqx.field(static=True)
    geometry: str = eqx.field(static=True)

    def __init__(self, fence: Fence, fidelity: Fidelity, drive: AbstractDrive | None = None):
        precision = fence.mass_scale.dtype
        tables = beam.tables(fence.taper, fidelity.elements, fidelity.mode_count)
        tables = jax.tree.map(lambda table: table.astype(precision), tables)
        self.elements = fidelity.elements
        # A rigid fence has no bent line.
        self.geometry = fidelity.geometry if fidelity.mode_count else "small"
        self.rigid_length = fence.rigid_length
        self.length = fence.flexible_length
        self.mass_scale = fence.mass_scale
        rate = fence.stiffness_scale / fence.mass_scale
        self.eigenvalues = rate * jnp.asarray(tables.eigenvalues)
        self.lag = jnp.zeros_like(rate)
        if fidelity.mode_count:
            self.lag = 2 * fence.material.damping_ratio / jnp.sqrt(self.eigenvalues[0])
        mass, first_moment, second_moment = self.mass_scale * jnp.asarray(tables.mass)
        arm = self.rigid_length
        self.swing_inertia = (
            mass * arm**2 + 2 * first_moment * arm * self.length + second_moment * self.length**2
        )
        rigid_mass = fence.material.density * fence.width * fence.thickness * arm
        self.root_inertia = rigid_mass * arm**2 / 3
        self.rest_table = None
        if fence.rest_shape is not None:
            self.rest_table = RestTable(fence, tables, arc_modes(fidelity))
        self.section = self.second_order = None
        if fence.second_order is not None and fence.second_order.act and fidelity.mode_count:
            self.second_order = fence.second_order
        if self.second_order is not None or (fence.shear is not None and fidelity.mode_count):
            self.section = SectionTable(fence, tables.relative_thickness)
        self.hinge, clamped_moment = None, tables.moment
        mount = drive if isinstance(drive, AbstractTorqueDrive) else fence.shaft
        if mount is not None:
            self.root_inertia = self.root_inertia + mount.inertia
            swing = arm * jnp.asarray(tables.swing_root) + self.length * jnp.asarray(
                tables.swing_tip
            )
            inertia = self.root_inertia + self.swing_inertia
            clamped = ClampedLink(self.eigenvalues, swing, self.mass_scale, inertia, self.lag)
            self.hinge = Hinge(mount, clamped)
            tables = self.hinge.mixed(tables, rate, self.length)
            self.eigenvalues = self.hinge.eigenvalues
        self.frequency_squared = blocks(self.eigenvalues)
        self.deflection = blocks(tables.deflection)
        self.slope = blocks(tables.slope)
        self.table = ShapeTable(tables, fidelity)
        self.flexibility = 1 / fence.stiffness_scale
        self.swing = tuple(
            self.rigid_length * a + self.length * b
            for a, b in zip(blocks(tables.swing_root), blocks(tables.swing_tip), strict=True)
        )
        # Bending stress at the nodes: E (h / 2) |w''| = M (h / 2) / I.
        self.bending = tuple(
            fence.stiffness_scale * self.length * block for block in blocks(tables.moment)
        )
        if self.hinge is not None and self.hinge.driven:
            # A static load turns the free hinge; the bending by it is that of the clamped modes.
            static = self.mass_scale * self.hinge.link.eigenvalues[None]
            flexibility = self.hinge.clamped_loads(clamped_moment / static)
            self.bending_flexibility = tuple(
                fence.stiffness_scale * self.length * block for block in blocks(flexibility)
            )
        else:
            self.bending_flexibility = tuple(
                block / (self.mass_scale * (value[None] if value.ndim else value))
                for block, value in zip(self.bending, self.frequency_squared, strict=True)
            )
        thickness = fence.thickness * jnp.asarray(tables.relative_thickness)
        self.stress_scale = 6 / (fence.width * thickness**2)
        nodes = np.arange(self.elements) / self.elements
        self.stations = self.length * jnp.asarray(nodes, dtype=precision)
        self.cover = None if fence.pad is None else Cover(fence)

    @property
    def corrected(self) -> bool:
        """Whether there is a compliance besides that of the modes kept."""
        return self.table.corrected or (self.section is not None and self.section.shear is not None)

    @property
    def reach(self) -> Array:
        """R_z [m]."""
        return self.rigid_length + self.length

    @property
    def damping(self) -> Blocks:
        """c_i = (2 zeta / omega_1) omega_i^2 [1/s], omega_1 that of the clamped fence; on a shaft
        with its own."""
        rates = tuple(self.lag * value for value in self.frequency_squared)
        if self.hinge is None:
            return rates
        return tuple(a + b for a, b in zip(rates, blocks(self.hinge.damping), strict=True))

    @property
    def clamped_eigenvalues(self) -> Array:
        """omega_i^2 [1/s^2] of the fence clamped at its root."""
        return self.eigenvalues if self.hinge is None else self.hinge.link.eigenvalues

    @property
    def slowest(self) -> Array:
        """Omega^2 [1/s^2] of the first mode that bends, or of the only one."""
        free = self.hinge is not None and self.hinge.driven and self.eigenvalues.size > 1
        return self.eigenvalues[int(free)]

    def motion(self, drive: DriveMotion, state: Vibration, force: Blocks = ()) -> DriveMotion:
        """The drive's motion; of a torque drive the hinge's motion in the `state` under the modal
        forces [m/s^2]; without these, the acceleration is 0."""
        if self.hinge is None or not self.hinge.driven:
            return drive
        angle, speed = self.hinge.twist(state)
        turn, acceleration = blocks(self.hinge.turn), jnp.zeros_like(angle)
        if force:
            acceleration = dot(turn, self.acceleration(state, force))
        return DriveMotion(angle, speed, acceleration, drive.torque)

    def rest(self) -> Vibration:
        """No deflection, no motion."""
        zero = tuple(jnp.zeros_like(value) for value in self.frequency_squared)
        return Vibration(zero, zero)

    def propagators(self, lengths: list[Array]) -> Propagator:
        """The exact maps of all modes over steps of the given lengths [s], (lengths, m) each."""
        shape = (len(lengths), self.eigenvalues.size)
        stiffness = jnp.broadcast_to(self.eigenvalues, shape)
        steps = jnp.broadcast_to(jnp.stack(lengths)[:, None], shape)
        damping = self.lag * stiffness
        if self.hinge is not None:
            damping = damping + jnp.broadcast_to(self.hinge.damping, shape)
        return propagator(stiffness, damping, steps)

    def drive_force(self, drive: DriveMotion) -> Blocks:
        """The modal forces by the drive [m/s^2]: -p_i alpha'' of one that prescribes the angle, and
        by the torque T of one that prescribes that, as `Hinge.driving` has it."""
        if self.hinge is not None and drive.torque is not None:
            return tuple(a * drive.torque for a in blocks(self.hinge.driving))
        return tuple(-p * drive.acceleration for p in self.swing)

    def loaded(self, inertia: Blocks, shapes: tuple["Shape", ...], normals) -> Blocks:
        """Modal forces [m/s^2]: those of the swing, less the contact forces [N] at the shapes."""
        force = list(inertia)
        for shape, normal in zip(shapes, normals, strict=True):
            share = normal / self.mass_scale
            force = [f - phi * share for f, phi in zip(force, shape.load, strict=True)]
        return tuple(force)

    def acceleration(self, state: Vibration, force: Blocks) -> Blocks:
        """eta'' = f - c eta' - w^2 eta [m/s^2]."""
        return tuple(
            f - c * v - k * q
            for f, c, v, k, q in zip(
                force, self.damping, state.rate, self.frequency_squared, state.amplitude,
                strict=True,
            )
        )

    def shape(self, place: Array) -> Shape:
        """The shapes at the arc coordinate `place` = sigma [m].

        Zero on the rigid link; beyond the tip continued along the tangent there.
        """
        index, s = self._element(place)
        beyond = jnp.maximum(place - self.reach, 0.0)
        sampled = self.table.at(index, s)
        inverse = 1 / self.length
        scale = self.elements * inverse
        slope = tuple(scale * d for d in sampled.slope)
        deflection = tuple(
            v + d * beyond for v, d in zip(sampled.deflection, slope, strict=True)
        )
        residual = residual_mode = residual_tip = shear = arc = None
        if self.section is not None:
            shear = self.section.shear_compliance(place, index, s)
        yielding = sampled.yielding(self.flexibility, scale, shear)
        if yielding is not None:
            residual, residual_mode, residual_tip = yielding
        left_out = residual
        if shear is not None:
            left_out = None if sampled.residual is None else self.flexibility * sampled.residual
        if sampled.pairs is not None and sampled.cube is not None:
            arc = (tuple(pair * inverse for pair in sampled.pairs), sampled.cube * inverse**2)
        rest = None
        if self.rest_table is not None:
            rest = self.rest_table.at((place - self.rigid_length) / self.length, index, s)
        load = sampled.load if self.table.shared else deflection
        if self.hinge is not None:
            turn = blocks(self.hinge.turn)
            load = tuple(v + place * a for v, a in zip(load, turn, strict=True))
        return Shape(
            deflection, slope, load, residual, residual_mode, residual_tip, arc, place, rest,
            left_out,
        )

    def followed(self, shape: Shape, amplitude: Blocks) -> Shape:
        """The shape for a force that loads the bent fence there, with its second-order loads, by
        the modes' amplitudes [m]."""
        assert self.second_order is not None
        assert self.section is not None
        index, s = self._element(shape.place)
        deflection, slope = dot(shape.deflection, amplitude), dot(shape.slope, amplitude)
        deflection, _, slope = shape.from_line(deflection, slope, slope)
        nodes = combined(self.deflection, amplitude)
        if self.rest_table is not None:
            nodes = nodes + self.rest_table.deflection
        chords = Chords.to(
            shape.place, index.astype(s.dtype) + s, self.length / self.elements,
            (nodes, deflection), slope, self.section.half_thickness(index, s),
        )  # fmt: skip
        normal, friction = following(self.second_order, chords)
        at = tuple(zip(self.deflection, shape.deflection, shape.slope, strict=True))
        more = tuple(normal.load(chords, *each) for each in at)
        added = tuple(friction.load(chords, *each) for each in at)
        if self.hinge is not None:
            turn, arm = blocks(self.hinge.turn), normal.arm - shape.place
            more = tuple(f + arm * a for f, a in zip(more, turn, strict=True))
            added = tuple(f + friction.arm * a for f, a in zip(added, turn, strict=True))
        load = tuple(phi + f for phi, f in zip(shape.load, more, strict=True))
        return shape._replace(load=load, following=normal, friction=(friction, added))

    def _element(self, place):
        """Element [0, n) and local coordinate in [0, 1] of an arc coordinate sigma:
        floor((sigma - l_s) / Delta l), and what is left of it. On the rigid link it is the first
        element, beyond the tip the last.

        Paper: (2.9), (2.10). There an error beyond the tip.
        """
        position = jnp.clip((place - self.rigid_length) / self.length, 0.0, 1.0) * self.elements
        floor = jnp.floor(jax.lax.stop_gradient(position))
        floor = jnp.clip(floor, 0.0, self.elements - 1.0)
        # Unsigned, so that no test for a negative index is compiled.
        return floor.astype(jnp.uint32), position - floor

    def tip_deflection(
        self, amplitude: Blocks, loads: tuple[Array, ...], shapes: tuple[Shape, ...]
    ) -> Array:
        """Deflection of the tip [m] from the straight line of the rigid link, that of the modes
        left out under the lagged contact forces `loads` [N] included."""
        deflection = jnp.zeros_like(self.length)
        deflection = deflection + dot(tuple(block[-1] for block in self.deflection), amplitude)
        for load, shape in zip(loads, shapes, strict=True):
            if shape.residual_tip is not None:
                deflection = deflection - shape.residual_tip * load
        return deflection

    def clamped(self, state: Vibration) -> Vibration:
        """The state in the clamped-root modes."""
        if self.hinge is None:
            return state
        count = self.hinge.clamped.shape[0]
        parts = (self.hinge.first_clamped(part, count) for part in state)
        return Vibration(*(blocks(jnp.stack(part)) if part else () for part in parts))

    def point(self, shape: Shape, state: Vibration) -> FencePoint:
        """The point of the fence at a shape's place, in the geometry of the fidelity."""
        point = self._bent_point(shape, state)
        return point if self.hinge is None else point.turned_by(*self.hinge.twist(state))

    def point_on(self, drive: DriveMotion, shape: Shape, state: Vibration) -> FencePoint:
        """The point of the fence in the frame of the `drive`, that of `motion`."""
        point = self.point(shape, state)
        if self.hinge is None or not self.hinge.driven:
            return point
        return point.turned_by(-drive.angle, -drive.speed)

    def _bent_point(self, shape: Shape, state: Vibration) -> FencePoint:
        """The point of the fence relative to the line of the rigid link."""
        zero = jnp.zeros_like(shape.place)
        if not self.frequency_squared:
            return small_point(shape.place, *shape.from_line(zero, zero, zero))
        if self.geometry == "chord":
            return self.chord_point(shape, state, zero, zero, zero)
        deflection = dot(shape.deflection, state.amplitude)
        rate = dot(shape.deflection, state.rate)
        bent = shape.from_line(deflection, rate, dot(shape.slope, state.amplitude))
        if self.geometry == "arc":
            return arc_point(shape.place, self.arc(shape, state), *bent)
        return small_point(shape.place, *bent)

    def arc(self, shape: Shape, state: Vibration) -> Arc:
        """The displacements of a point by an arc, from the first modes."""
        assert shape.arc is not None
        modes = self.table.arc_modes
        if self.hinge is not None:
            q, v = (self.hinge.first_clamped(part, modes) for part in state)
        else:
            q, v = (one_by_one(part)[:modes] for part in state)
        bent = arc(*shape.arc, q, v)
        return bent if shape.rest is None else shape.rest.bent(bent, q, v)

    def chord_point(
        self, shape: Shape, state: Vibration, extra: Array, extra_rate: Array, turn: Array
    ) -> FencePoint:
        """A point of the chain of chords.

        `extra` [m] is the deflection of the modes left out at this point, `extra_rate` its rate and
        `turn` [rad] their slope.
        """
        (x, y), (x_rate, y_rate) = jax.jvp(
            lambda amplitude: self._chain(shape.place, amplitude),
            (state.amplitude,),
            (state.rate,),
        )
        slope = dot(shape.slope, state.amplitude) + turn
        if shape.rest is not None:
            slope = slope + shape.rest.line.slope
        return FencePoint(x, y + extra, x_rate, y_rate + extra_rate, slope)

    def _chain(self, place, amplitude):
        """Position in the turning frame of the point at `place` on the chain of chords."""
        nodes = combined(self.deflection, amplitude), combined(self.slope, amplitude)
        if self.rest_table is not None:
            nodes = nodes[0] + self.rest_table.deflection, nodes[1] + self.rest_table.slope
        return chain(
            place, *self._element(place), (self.rigid_length, self.length), *nodes
        )

    def bending_stress(self, amplitude: Blocks, loads, shapes) -> Array:
        """sigma_b [Pa] at the nodes 0 ... n - 1 of the link, positive where w'' is.

        Moment of the modes kept plus that of the contact loads carried statically by the modes
        left out: M = sum EI phi_i'' eta_i - sum_j r_j [(sigma_j - x)_+ - sum EI phi_i''
        phi_i(sigma_j) / (m_0 w_i^2)]. It is exact in the static limit with any number of modes.
        `loads` are the lagged contact forces r_j [N].
        """
        if not self.bending:
            return jnp.zeros_like(self.stations)
        moment = combined(self.bending, amplitude)
        for load, shape in zip(loads, shapes, strict=True):
            reached = jnp.minimum(shape.place, self.reach)
            beyond = jnp.maximum(reached - self.rigid_length - self.stations, 0.0)
            if shape.following is not None:
                beyond = beyond + shape.following.moment
            moment = moment - load * beyond
            moment = moment + load * combined(self.bending_flexibility, shape.load)
        return moment * self.stress_scale
