"""The fence at the end of a step, as a function of the contact forces there."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..model import (
    Arc,
    Blocks,
    FencePoint,
    FenceState,
    FlexibleLink,
    Propagator,
    ResidualMode,
    Shape,
    Vibration,
    arc_point,
    bending_loads,
    blocks,
    dot,
    propagate,
    small_point,
)
from ..parts import DriveMotion
from .hinge_response import HingeResponse
from .pad_response import PadResponse
from .step_size import Stride


class FenceResponse(eqx.Module):
    """The fence at the end of a step as a function of the contact forces there.

    The deflection, its rate and the slope at each place are affine in the forces, so that Newton's
    method sees these few numbers instead of the modes. The small terms of an arc are linearised
    about the predicted forces. (Taken at the predicted forces alone they would let a stiff contact
    or friction oscillate from step to step without end, as predicted forces lag behind by up to two
    steps.)
    """

    link: FlexibleLink
    stride: Stride
    drive: DriveMotion
    normals_before: tuple[Array, ...]
    lagged_before: tuple[Array, ...]
    residual_before: tuple[ResidualMode, ...]
    pads: tuple[PadResponse, ...]
    shares: tuple[Array, ...]
    shapes: tuple[Shape, ...]
    loadings: tuple[Blocks, ...]
    friction_forces: tuple[Array, ...]
    sticking: tuple[Array | float, ...]
    inertia: Blocks
    free: Vibration
    affine: tuple
    hinge: HingeResponse | None
    expected: tuple[Array, ...]
    arcs: tuple[tuple[Arc, tuple[Arc, ...]], ...]

    def __init__(
        self,
        link: FlexibleLink,
        stride: Stride,
        drive: DriveMotion,
        before: FenceState,
        normals: tuple[Array, ...],
        shapes: tuple[Shape, ...],
        shares: tuple[Array, ...] = (),
        expected: tuple[Array, ...] = (),
        friction_forces: tuple[Array, ...] = (),
        sticking: tuple[Array | float, ...] = (),
    ):
        """**Arguments:**

        - `before`: the fence at the start of the step, loaded by the forces `normals` [N].
        - `shapes`: the mode shapes at the places where it is loaded at the step's end.
        - `shares`: the shares [1] of the contact forces there that bend it; by default all of them.
        - `expected`: the predicted contact forces [N], for the small terms of the geometry.
        - `friction_forces`: the predicted friction [N], where loads follow the bent fence, so that
          friction loads it too.
        - `sticking`: the weights [1] of contacts that stick, whose friction counts by its value at
          the step's end alone (`friction_tangent`).
        """
        self.link, self.stride, self.drive = link, stride, drive
        self.normals_before, self.lagged_before = normals, before.lagged_rate
        self.residual_before = before.residual
        self.pads = ()
        if link.cover is not None:
            self.pads = tuple(PadResponse.of(link.cover, pad, stride) for pad in before.pads)
        self.shapes, self.shares = shapes, shares
        self.friction_forces, self.sticking = friction_forces, sticking
        self.inertia = link.drive_force(drive)
        self.free = propagate(stride.maps, before.vibration, before.modal_force, self.inertia)
        if link.hinge is not None:
            self.free = link.hinge.coupled(stride.maps, self.free)
        self.loadings = tuple(shape.load for shape in shapes)
        if friction_forces:
            self.shapes = self._followed(self.loads(expected))
            by_friction = tuple(s.friction[1] for s in self.shapes if s.friction is not None)
            self.loadings = tuple(shape.load for shape in self.shapes) + by_friction
        self.hinge = None
        if link.hinge is not None:
            pushes = tuple(self._uncoupled_pushes())
            self.hinge = HingeResponse(link, stride, self.free, pushes, before.clutch)
        self.affine = tuple(self._affine(k) for k in range(len(shapes)))
        predicted = self.loads(expected or tuple(jnp.zeros_like(s.place) for s in shapes))
        if friction_forces:
            predicted = predicted + self.loads(friction_forces)
        self.expected = self._with_clutch(predicted)
        self.arcs = self._arcs() if self.bends and link.geometry == "arc" else ()

    def _followed(self, loads) -> tuple[Shape, ...]:
        """The shapes for loads that follow the bent fence, whose line is that under the predicted
        `loads` [N]: it moves little in a step."""
        amplitude = self.free.amplitude
        for load, pushed in zip(loads, self.loadings, strict=True):
            share = load * (1 / self.link.mass_scale)
            moved = zip(amplitude, self.stride.maps, pushed, strict=True)
            amplitude = tuple(q - m.q_end * phi * share for q, m, phi in moved)
        return tuple(self.link.followed(shape, amplitude) for shape in self.shapes)

    @property
    def bends(self) -> bool:
        """Whether there are modes."""
        return len(self.link.frequency_squared) > 0

    @property
    def flexible(self) -> bool:
        """Whether the contact forces move the fence; they do not move a rigid one without a
        cover."""
        return self.bends or bool(self.pads)

    def _affine(self, k: int):
        """Deflection, its rate and slope at one place: at no contact force, and per newton [1/N]
        of each contact's force at the step's end."""
        shape, link = self.shapes[k], self.link
        free = (
            dot(shape.deflection, self.free.amplitude),
            dot(shape.deflection, self.free.rate),
            dot(shape.slope, self.free.amplitude),
        )
        gains, inverse = [], 1 / link.mass_scale
        for pushed, struck in self._pushes():
            gains.append(
                (
                    dot(shape.deflection, pushed) * inverse,
                    dot(shape.deflection, struck) * inverse,
                    dot(shape.slope, pushed) * inverse,
                )
            )
        return free, tuple(gains)

    def _pushes(self):
        """The amplitudes and rates by a unit of each load at the step's end, in units of 1 /
        m_0."""
        yield from self._uncoupled_pushes() if self.hinge is None else self.hinge.pushes

    def _uncoupled_pushes(self):
        """The responses to unit loads without the coupling of the modes by a shaft's damping."""
        for load, weight in self._loadings():
            ends = [_ends(m, weight) for m in self.stride.maps]
            yield Vibration(
                tuple(q * b for (q, _), b in zip(ends, load, strict=True)),
                tuple(v * b for (_, v), b in zip(ends, load, strict=True)),
            )

    def _loadings(self):
        """Each load's share in the modal forces, with the weight by which it acts from the step's
        start on, which is that of a sticking contact for friction and `None` for a normal force."""
        frictions = len(self.friction_forces)
        not_sticking = (None,) * (len(self.loadings) - frictions)
        return zip(self.loadings, not_sticking + self.sticking[:frictions], strict=True)

    def _arcs(self):
        """The small terms of the arc at each place under the predicted loads, and their derivatives
        in each load [1/N]."""
        units = [
            tuple(jnp.full_like(n, float(i == j)) for j, n in enumerate(self.expected))
            for i in range(len(self.expected))
        ]
        found = []
        for shape in self.shapes:
            arc, along = jax.linearize(
                lambda loads, shape=shape: self.link.arc(shape, self._vibration(loads)),
                self.expected,
            )
            found.append((arc, tuple(along(unit) for unit in units)))
        return tuple(found)

    def _arc(self, k: int, normals) -> Arc:
        """The small terms of the arc at place k."""
        arc, slopes = self.arcs[k]
        for normal, predicted, slope in zip(normals, self.expected, slopes, strict=True):
            arc = Arc(*(q + (normal - predicted) * d for q, d in zip(arc, slope, strict=True)))
        return arc

    def loads(self, normals: tuple[Array, ...]) -> tuple[Array, ...]:
        """The part of the contact forces that bends the fence [N]."""
        return bending_loads(self.shares, normals)

    def _with_clutch(self, loads: tuple[Array, ...]) -> tuple[Array, ...]:
        """These loads, followed by that of the clutch, if there is one."""
        return loads if self.hinge is None else self.hinge.with_clutch(loads)

    def bending_compliance(self, k: int, other: int):
        """The compliances of the deflection [m/N] and of its rate [m/s/N] at place k, at the step's
        end, for a force at another place there."""
        give, give_rate, _ = self.affine[k][1][other]
        if self.hinge is not None:
            turn, turn_rate = self.hinge.turns[other]
            arm = self.shapes[k].place
            give, give_rate = give + arm * turn, give_rate + arm * turn_rate
        own = self.shapes[k].residual
        if own is not None and k == other:
            by_rate = self.stride.lag_gain
            give = give + own * (1 - self.link.lag * by_rate)
            give_rate = give_rate + own * by_rate
        return give, give_rate

    def compliance(self, k: int, other: int, normal: Array):
        """The compliances of the gap and of its rate at place k. They include the cover, under the
        force `normal` [N] at place k, and count the shares of the forces that bend the fence."""
        give, give_rate = self.bending_compliance(k, other)
        if self.pads and k == other:
            load = self.shares[k] * normal if self.shares else normal
            pressed, pressed_rate = self.pads[k].compliance(load)
            give, give_rate = give + pressed, give_rate + pressed_rate
        if self.shares:
            both = self.shares[k] * self.shares[other % len(self.shares)]
            give, give_rate = both * give, both * give_rate
        return give, give_rate

    def drift(self, k: int, other: int, slope: Array) -> Array:
        """The sliding speed [m/s/N] of a corner at place k, where the fence has that `slope`, by a
        force at another place at the step's end, as the fence moves along itself. It is of the
        first order in the bending, and leaves out the chords' geometry: it serves Newton's method
        alone."""
        give, give_rate = self.compliance(k, other, self.expected[other])
        speed = self.drive.speed
        if self.hinge is not None and self.hinge.hinge.driven:
            turn, speed = self.hinge.free
            slope = slope - turn
        rate = slope * give_rate - speed * give
        if self.arcs:
            along = self.arcs[k][1][other].short_rate
            rate = rate + (along * self.shares[other % len(self.shares)] if self.shares else along)
        return rate

    def points(self, normals, friction_forces=()) -> tuple[FencePoint, ...]:
        """The point of the fence at each place where it is loaded, by the normal forces [N] there
        and, where friction loads it, by the friction."""
        if not self.flexible:
            zero = jnp.zeros_like(self.drive.angle)
            return tuple(small_point(s.place, *s.from_line(zero, zero, zero)) for s in self.shapes)
        loads = self.loads(normals) + (self.loads(friction_forces) if friction_forces else ())
        normals = self._with_clutch(loads)
        return tuple(self._point(k, normals) for k in range(len(self.shapes)))

    def deflection(self, k: int, normals) -> tuple[Array, Array, Array]:
        """Deflection [m] at place k, its rate [m/s] and the slope, to the first order and without
        the fence's cover."""
        deflection, rate, slope = self._bending(k, normals)
        if self.hinge is not None:
            arm, (turn, turn_rate) = self.shapes[k].place, self.hinge.twist(normals)
            deflection, rate = deflection + arm * turn, rate + arm * turn_rate
            slope = slope + turn
        return deflection, rate, slope

    def _bending(self, k: int, normals) -> tuple[Array, Array, Array]:
        """Deflection [m] at place k from the rigid link's line, its rate [m/s] and the slope."""
        extra, extra_rate, turn = self._residual(k, normals[k])
        (deflection, rate, slope), gains = self.affine[k]
        for normal, (give, give_rate, give_slope) in zip(normals, gains, strict=True):
            deflection = deflection - give * normal
            rate = rate - give_rate * normal
            slope = slope - give_slope * normal
        return deflection + extra, rate + extra_rate, slope + turn

    def _point(self, k: int, normals) -> FencePoint:
        point = self._bent_point(k, normals)
        if self.hinge is not None:
            point = point.turned_by(*self.hinge.twist(normals))
        if not self.pads:
            return point
        depth, rate = self.pads[k].compression(normals[k])
        return point._replace(y=point.y - depth, y_rate=point.y_rate - rate)

    def _bent_point(self, k: int, normals) -> FencePoint:
        link, shape = self.link, self.shapes[k]
        if not self.bends:
            zero = jnp.zeros_like(self.drive.angle)
            return small_point(shape.place, *shape.from_line(zero, zero, zero))
        if link.geometry == "chord":
            extra = self._residual(k, normals[k])
            return link.chord_point(shape, self._vibration(normals), *extra)
        if link.geometry == "arc":
            bent = shape.from_line(*self._bending(k, normals))
            return arc_point(shape.place, self._arc(k, normals), *bent)
        return small_point(shape.place, *shape.from_line(*self._bending(k, normals)))

    def _residual(self, k: int, normal):
        """Deflection [m] of the modes left out, its rate [m/s] and their slope."""
        shape = self.shapes[k].residual_mode
        if shape is None:
            return (jnp.zeros_like(normal),) * 3
        deflection, slope = shape
        force, rate = self._residual_mode(k, normal)
        amplitude = force - self.link.lag * rate
        return -deflection * amplitude, -deflection * rate, -slope * amplitude

    def _residual_mode(self, k: int, normal) -> ResidualMode:
        """The residual mode under place k at the step's end."""
        shape = self.shapes[k].residual_mode
        assert shape is not None
        force, before = shape[0] * normal, self.residual_before[k]
        return ResidualMode(force, self._lagged_rate(before.rate, before.force, force))

    def _lagged_rate(self, rate, before, now):
        """rdot at the step's end for r + beta rdot = f, from `rate` at its start and from f at both
        ends. It is exact for f linear over the step, and finite as beta -> 0."""
        return self.stride.lag_decay * rate + self.stride.lag_gain * (now - before)

    def _vibration(self, normals) -> Vibration:
        """The modes at the step's end."""
        amplitude, rate = list(self.free.amplitude), list(self.free.rate)
        if self.hinge is not None:
            for (pushed, struck), load in zip(self.hinge.pushes, normals, strict=True):
                share = load * (1 / self.link.mass_scale)
                amplitude = [q - p * share for q, p in zip(amplitude, pushed, strict=True)]
                rate = [v - p * share for v, p in zip(rate, struck, strict=True)]
            return Vibration(tuple(amplitude), tuple(rate))
        for (load, weight), normal in zip(self._loadings(), normals, strict=True):
            share = normal * (1 / self.link.mass_scale)
            for i, (phi, m) in enumerate(zip(load, self.stride.maps, strict=True)):
                q_end, v_end = _ends(m, weight)
                amplitude[i] = amplitude[i] - q_end * phi * share
                rate[i] = rate[i] - v_end * phi * share
        return Vibration(tuple(amplitude), tuple(rate))

    def state_before(self, before: FenceState, normals, frictions) -> FenceState:
        """The state at the start of the step, with the friction of sticking corners at its end,
        which acts from there on. `normals` [N] are the forces at its end and `frictions` [1] the
        friction there as shares of them."""
        forces = [mu * n for mu, n in zip(frictions, self.loads(normals), strict=True)]
        modal_force = self._with_friction(before.modal_force, forces, self.sticking)
        return before._replace(modal_force=modal_force)

    def _with_friction(self, force: Blocks, friction_forces, sticking) -> Blocks:
        """A modal force with the load by `friction_forces` [N] on the fence, each counted by its
        weight `sticking` [1]."""
        loadings = self.loadings[len(self.shapes) :]
        for load, friction, weight in zip(loadings, friction_forces, sticking, strict=False):
            share = weight * friction / self.link.mass_scale
            force = tuple(f - phi * share for f, phi in zip(force, load, strict=True))
        return force

    def state(self, normals, frictions=(), sticking=()) -> FenceState:
        """The fence under the solved forces: `normals` [N], and the friction that loads it, as
        shares `frictions` [1] of these; `sticking` [1] are the weights of the contacts that stick
        now."""
        normals, shapes, sticking_load = self.loads(normals), self.shapes, None
        all_loads = normals
        if frictions:
            all_loads = all_loads + tuple(mu * n for mu, n in zip(frictions, normals, strict=True))
            shapes = tuple(
                shape.with_friction(mu) for shape, mu in zip(shapes, frictions, strict=True)
            )
            no_load = tuple(jnp.zeros_like(f) for f in self.inertia)
            sticking_load = self._with_friction(no_load, all_loads[len(normals) :], sticking)
        all_loads = self._with_clutch(all_loads)
        load = self.link.loaded(self.inertia, shapes, normals)
        vibration, clutch = self._vibration(all_loads), None
        if self.hinge is not None:
            coupling = self.hinge.hinge.coupling(vibration.rate)
            load = tuple(f + g for f, g in zip(load, coupling, strict=True))
            clutch = self.hinge.clutch(all_loads)
        if clutch is not None and self.hinge is not None:
            relief, turn = clutch.relief / self.link.mass_scale, blocks(self.hinge.hinge.turn)
            load = tuple(f + a * relief for f, a in zip(load, turn, strict=True))
        lagged, rates, residual = normals, tuple(jnp.zeros_like(n) for n in normals), ()
        if self.link.corrected:
            rates = tuple(
                map(self._lagged_rate, self.lagged_before, self.normals_before, normals)
            )
            lagged = tuple(n - self.link.lag * r for n, r in zip(normals, rates, strict=True))
            residual = tuple(self._residual_mode(k, n) for k, n in enumerate(normals))
        pads = tuple(pad.state(n) for pad, n in zip(self.pads, normals, strict=False))
        return FenceState(
            self.drive, vibration, load, shapes, lagged, rates, residual, self.shares, pads,
            clutch, sticking_load,
        )  # fmt: skip


def _ends(maps: Propagator, weight: Array | float | None) -> tuple[Array, Array]:
    """Amplitude and rate by a unit of load at the step's end. The share `weight` of it, that of a
    sticking contact's friction, acts from the step's start on."""
    if weight is None:
        return maps.q_end, maps.v_end
    return maps.q_end + weight * maps.q_start, maps.v_end + weight * maps.v_start
