"""The normal direction alone: a parcel with one coordinate strikes the fence held still, or an
undeformable wall.

Everything but the contact law is linear, so that the gap and its rate at the end of a step are
affine in the force there: one scalar equation a step, whatever the number of modes.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from . import contact, integrate, newton, tally
from .fence import Fence
from .fidelity import Fidelity
from .instant import Energy, Instant, Power
from .kinematics import Acceleration, Body
from .link import Blocks, FlexibleLink, Shape, Vibration, dot, propagate, total
from .mechanics import Contact
from .propagation import Propagator, relaxation
from .result import Result, gather
from .scenes import NormalScene
from .status import Status, worst


class _State(NamedTuple):
    """Advance of the parcel [m] beyond the fence at rest and its rate [m/s], the contact force [N];
    of the fence the vibration, and the rate [N/s] of the load that the modes left out carry."""

    advance: Array
    rate: Array
    force: Array
    vibration: Vibration | None
    lagged_rate: Array | None


class _HeldFence(eqx.Module):
    """The fence held still, as a step sees it at the one place where it is struck."""

    link: FlexibleLink
    shape: Shape
    maps: tuple[Propagator, ...]
    decay: Array
    step: float = eqx.field(static=True)

    def __init__(self, fence: Fence, place: Array, fidelity: Fidelity, step: float):
        self.link = FlexibleLink(fence, fidelity)
        self.shape = self.link.shape(place)
        self.maps = self.link.propagators(step)
        self.decay = relaxation(self.link.lag, step)
        self.step = step

    @property
    def lagging(self) -> Array | None:
        """Compliance [m/N] of the modes left out."""
        return self.shape.residual

    def modal_force(self, force: Array) -> Blocks:
        """[m/s^2] under a contact force [N]."""
        share = force / self.link.mass_scale
        return tuple(-phi * share for phi in self.shape.load)

    def free(self, state: _State) -> Vibration:
        """The modes at the end of the step under a force that falls to zero in it."""
        none = tuple(jnp.zeros_like(q) for q in self.link.frequency_squared)
        assert state.vibration is not None
        return propagate(self.maps, state.vibration, self.modal_force(state.force), none)

    def pushed(self, free: Vibration, force: Array) -> Vibration:
        """The modes at the end of the step with the force there."""
        loads = self.modal_force(force)
        q = tuple(a + m.q_end * f for a, m, f in zip(free.amplitude, self.maps, loads, strict=True))
        v = tuple(a + m.v_end * f for a, m, f in zip(free.rate, self.maps, loads, strict=True))
        return Vibration(q, v)

    def lagged_rate(self, state: _State, force: Array) -> Array:
        """Rate [N/s] at the end of the step of the load r that the modes left out carry,
        r + lag rdot = N."""
        slope = (force - state.force) / self.step
        return self.decay * state.lagged_rate + (1 - self.decay) * slope

    def deflection(self, vibration: Vibration, force: Array, lagged_rate: Array | None):
        """Deflection [m] where the fence is struck, along the blow, and its rate [m/s]."""
        give = -dot(self.shape.deflection, vibration.amplitude)
        give_rate = -dot(self.shape.deflection, vibration.rate)
        if self.lagging is not None:
            give = give + self.lagging * (force - self.link.lag * lagged_rate)
            give_rate = give_rate + self.lagging * lagged_rate
        return give, give_rate

    def compliance(self):
        """How far [m/N] and how fast [m/s/N] the place gives way for a force at the step's end."""
        loads = [phi / self.link.mass_scale for phi in self.shape.load]
        pushed = [m.q_end * b for m, b in zip(self.maps, loads, strict=True)]
        struck = [m.v_end * b for m, b in zip(self.maps, loads, strict=True)]
        give = dot(self.shape.deflection, pushed)
        give_rate = dot(self.shape.deflection, struck)
        if self.lagging is not None:
            by_rate = (1 - self.decay) / self.step
            give = give + self.lagging * (1 - self.link.lag * by_rate)
            give_rate = give_rate + self.lagging * by_rate
        return give, give_rate


class _Blow(NamedTuple):
    """The scalar equation of a step: N = law(gap - give N, rate - give_rate N)."""

    stiffness: Array
    viscosity: Array
    gap: Array
    rate: Array
    give: Array
    give_rate: Array

    def evaluate(self, unknowns):
        """Residual, its slope, its size against what is tolerated, and gap, rate, unbalance."""
        (force,) = unknowns
        gap, rate = self.gap - self.give * force, self.rate - self.give_rate * force
        law = contact.kelvin(self.stiffness, self.viscosity, gap, rate)
        value = force - law.force
        slope = 1 + law.by_gap * self.give + law.by_rate * self.give_rate
        unbalance = jnp.abs(value)
        size = unbalance / (1e-9 * law.force + 1e-9)
        return (value,), [[slope]], size, (gap, rate, unbalance)

    def shorten(self, extra, change):
        """Whole Newton steps: the residual rises all along."""
        return jnp.ones_like(self.gap)


def run(scene: NormalScene, fidelity: Fidelity, history: bool) -> Result:
    """Integrate m_p pddot = -N(D, Ddot), D = p - w(sigma), from p = 0, pdot = v_n, with the fence's
    deflection w along the blow; without a fence w = 0."""
    steps = integrate.count_steps(scene.duration, fidelity.step)
    h = scene.duration / steps
    parcel = scene.parcel
    zero = jnp.zeros_like(parcel.mass + scene.speed)
    fence = None
    if scene.fence is not None and fidelity.mode_count:
        assert scene.distance is not None
        fence = _HeldFence(scene.fence, scene.distance, fidelity, h)
    vibration = lagged_rate = None
    if fence is not None:
        vibration = fence.link.rest()
        zero = zero + 0.0 * (fence.link.mass_scale + fence.link.reach + fence.shape.place)
        lagged_rate = None if fence.lagging is None else jnp.zeros_like(zero)
    begin = _State(zero, scene.speed + zero, zero, vibration, lagged_rate)
    reach = jnp.zeros_like(zero) if fence is None else fence.link.reach

    def advance(args, y, index):
        parcel, fence, iterations = args
        state, tallied = y
        share = h / parcel.mass
        gap = state.advance + h * state.rate - h * share * state.force / 3
        rate = state.rate - 0.5 * share * state.force
        give, give_rate, free = h * share / 6, 0.5 * share, None
        if fence is not None:
            free = fence.free(state)
            unloaded = jnp.zeros_like(gap)
            lagged = None if fence.lagging is None else fence.lagged_rate(state, unloaded)
            ahead, ahead_rate = fence.deflection(free, unloaded, lagged)
            yields, yields_rate = fence.compliance()
            gap, rate = gap - ahead, rate - ahead_rate
            give, give_rate = give + yields, give_rate + yields_rate
        blow = _Blow(parcel.stiffness, contact.viscosity(parcel), gap, rate, give, give_rate)
        guess = (jnp.maximum(2 * state.force - tallied.force.before, 0.0),)
        (force,), (gap, rate, unbalance) = newton.solve(
            _Blow.evaluate, _Blow.shorten, blow, guess, iterations
        )
        after = _State(
            advance=state.advance + h * state.rate - h * share * (state.force / 3 + force / 6),
            rate=state.rate - 0.5 * share * (state.force + force),
            force=force,
            vibration=None if fence is None else fence.pushed(free, force),
            lagged_rate=(
                None
                if fence is None or fence.lagging is None
                else fence.lagged_rate(state, force)
            ),
        )
        instant = _instant(parcel, fence, h * (index + 1), after, gap, rate)
        return after, tally.add(tallied, instant, h, reach, unbalance)

    first = _instant(parcel, fence, zero, begin, zero, begin.rate)
    (_, tallied), samples = integrate.run_steps(
        advance,
        (begin, tally.begin(first, reach)),
        (parcel, fence, jnp.full_like(zero, fidelity.iterations)),
        lambda y: y[1].last,
        steps,
        fidelity,
        history,
    )
    if samples is not None:
        samples = integrate.join(first, samples)
    return gather(tallied, first, samples, zero, _status(scene, tallied))


def _instant(
    parcel, fence: _HeldFence | None, time: Array, state: _State, gap: Array, rate: Array
) -> Instant:
    """A sample: the fence lies along x, and the parcel moves along -y onto it."""
    zero = jnp.zeros_like(time)
    place = zero if fence is None else fence.shape.place + zero
    energy = Energy(
        0.5 * parcel.mass * state.rate**2,
        zero,
        zero,
        contact.stored_energy(parcel.stiffness, gap),
    )
    power = Power(zero, zero, zero, state.force * rate, zero, zero, zero, zero)
    tip, stress, stress_place, carried = zero, zero, zero, ()
    if fence is not None:
        assert state.vibration is not None
        link, (amplitude, speed) = fence.link, state.vibration
        lagged = ()
        strain = link.frequency_squared
        strain = 0.5 * link.mass_scale * total(
            k * q * q for k, q in zip(strain, amplitude, strict=True)
        )
        damped = link.mass_scale * total(
            c * v * v for c, v in zip(link.damping, speed, strict=True)
        )
        if fence.lagging is not None:
            assert state.lagged_rate is not None
            lagged = (state.force - link.lag * state.lagged_rate,)
            carried = ((fence.lagging, lagged[0]),)
            strain = strain + 0.5 * fence.lagging * lagged[0] ** 2
            damped = damped + link.lag * fence.lagging * state.lagged_rate**2
        shapes = (fence.shape,) if lagged else ()
        tip = link.tip_deflection(amplitude, lagged, shapes)
        stresses = link.bending_stress(amplitude, lagged, (place,) if lagged else (), shapes)
        worst_node = jnp.argmax(stresses)
        stress, stress_place = stresses[worst_node], link.rigid_length + link.stations[worst_node]
        energy = energy._replace(
            fence=0.5 * link.mass_scale * total(v * v for v in speed), strain=strain
        )
        power = power._replace(beam_damping=damped)
    return Instant(
        time=time,
        body=Body(place, -state.advance, zero, zero, -state.rate, zero),
        acceleration=Acceleration(zero, state.force / parcel.mass, zero),
        drive=None,
        vibration=None if fence is None else state.vibration,
        fence=(Contact(state.force, zero, gap, rate, place, zero),),
        border=(),
        belt=None,
        fence_force=state.force,
        tip_deflection=tip,
        stress=stress,
        stress_place=stress_place,
        torque=zero,
        energy=energy,
        power=power,
        carried=carried,
    )


def _status(scene: NormalScene, tallied: tally.Tally) -> Array:
    """The largest status that applies, as a floating-point number."""
    side = jnp.minimum(scene.parcel.length, scene.parcel.breadth)
    checks = [
        (Status.NEVER_TOUCHED, tallied.force.value <= 0),
        (Status.IN_CONTACT_AT_END, tallied.last.fence_force > 0),
        (Status.DEEP_PENETRATION, tallied.deepest > side / 2),
        (Status.STEP_TOO_COARSE, tallied.defect > 1e-3 * tallied.force.value + 1e-9),
        (Status.NON_FINITE, ~jnp.isfinite(tallied.last.body.y + tallied.force.value)),
    ]
    if scene.fence is not None:
        limit = scene.fence.flexible_length / 4
        checks.append((Status.LARGE_DEFLECTION, tallied.tip.value > limit))
    return worst(checks, tallied.last.body.y)
