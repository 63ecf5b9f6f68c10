"""The normal direction alone: a parcel with one coordinate strikes the fence held still, or an
undeformable wall.

Everything but the contact law is linear, so that the gap and its rate at the end of a step are
affine in the force there: one scalar equation a step, whatever the number of modes.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Fidelity
from ..model import Acceleration, Contact, FenceState, FlexibleLink, total
from ..parts import AbstractContactLaw, DriveMotion, Parcel
from ..results import (
    Energy,
    Power,
    Result,
    Sample,
    Status,
    accumulators as tally,
    bent,
    carried,
    damping_power,
    gather,
    strain_energy,
    unresolved,
    worst,
)
from ..scenes import Body, NormalScene, consistent
from . import newton, time_loop as integrate
from .fence_response import FenceEnd
from .step_size import Clock


class _State(NamedTuple):
    """Advance of the parcel [m] beyond the fence at rest and its rate [m/s], the contact force [N]
    and that of one step back, and the fence."""

    advance: Array
    rate: Array
    force: Array
    force_before: Array
    fence: FenceState | None


class _Blow(NamedTuple):
    """The scalar equation of a step: N = law(gap - give N, rate - give_rate N)."""

    law: AbstractContactLaw
    viscosity: Array
    gap: Array
    rate: Array
    give: Array
    give_rate: Array

    def evaluate(self, unknowns):
        """Residual, its slope, its size against what is tolerated, and gap, rate, unbalance."""
        (force,) = unknowns
        gap, rate = self.gap - self.give * force, self.rate - self.give_rate * force
        law = self.law.force(gap, rate, self.viscosity)
        value = force - law.force
        slope = 1 + law.by_gap * self.give + law.by_rate * self.give_rate
        unbalance = jnp.abs(value)
        size = unbalance / (1e-9 * law.force + 1e-9)
        return (value,), [[slope]], size, (gap, rate, unbalance)

    def shorten(self, extra, change, last):
        """Whole Newton steps: the residual rises all along."""
        return jnp.ones_like(self.gap)


def run(scene: NormalScene, fidelity: Fidelity, history: bool) -> Result:
    """Integrate m_p pddot = -N(D, Ddot), D = p - w(sigma), from p = 0, pdot = v_n, with the fence's
    deflection w along the blow; without a fence w = 0."""
    steps = integrate.count_steps(scene.duration, fidelity.step)
    step = scene.duration / steps
    fidelity = fidelity.replace(longest_stride=1)
    zero = jnp.zeros_like(scene.parcel.mass + scene.speed)
    link = shape = maps = fence = None
    if scene.fence is not None and fidelity.mode_count:
        assert scene.distance is not None
        link = FlexibleLink(scene.fence, fidelity)
        shape = link.shape(scene.distance)
        zero = zero + 0.0 * (link.mass_scale + link.reach + shape.place)
        maps = link.propagators([zero + step])
        fence = FenceState.unloaded(link, link.rest(), 1)
    clock = Clock(link, fidelity, zero, step, maps)
    begin = _State(zero, scene.speed + zero, zero, zero, fence)
    reach = zero if link is None else link.reach
    given = (scene.parcel, link, shape, clock)

    def advance(args, y, begins, ends):
        state, tallied = y
        state, sample, length, unbalance = _step(args, state, begins, ends)
        return state, tally.add(tallied, sample, length, unbalance, tally.Scope(reach))

    _, like, _, _ = jax.eval_shape(_step, given, begin, zero, zero)
    body = Body(reach, *(zero,) * 5)
    (_, tallied), samples = integrate.run_steps(
        integrate.Stepper(advance),
        (begin, tally.empty(like, body, alike=True)),
        given,
        (lambda y: y[1].last) if history else None,
        steps,
        fidelity,
    )
    return gather(tallied, samples, zero, _status(scene, link, tallied))


def _step(given, state: _State, begins: Array, ends: Array):
    """The state one step on, its sample, the step's length and what its equation leaves [N]."""
    parcel, link, shape, clock = given
    stride = clock.stride(ends - begins)
    h = stride.length
    share = h / parcel.mass
    gap = state.advance + h * state.rate - h * share * state.force / 3
    rate = state.rate - 0.5 * share * state.force
    give, give_rate, fence = h * share / 6, 0.5 * share, None
    if link is not None:
        assert state.fence is not None
        still = DriveMotion(*(jnp.zeros_like(gap),) * 3)
        fence = FenceEnd(link, stride, still, state.fence, (state.force,), (shape,))
        deflection, deflection_rate, _ = fence.deflection(0, (jnp.zeros_like(gap),))
        yields, yields_rate = fence.compliance(0, 0)
        gap, rate = gap + deflection, rate + deflection_rate
        give, give_rate = give + yields, give_rate + yields_rate
    law = parcel.contact_law
    blow = _Blow(law, law.viscosity(parcel.mass), gap, rate, give, give_rate)
    guess = (jnp.maximum(2 * state.force - state.force_before, 0.0),)
    (force,), (gap, rate, unbalance) = newton.solve(
        _Blow.evaluate, _Blow.shorten, blow, guess, clock.iterations
    )
    held = None if fence is None else fence.state((force,))
    after = _State(
        advance=state.advance + h * state.rate - h * share * (state.force / 3 + force / 6),
        rate=state.rate - 0.5 * share * (state.force + force),
        force=force,
        force_before=state.force,
        fence=None if held is None else held.kept(),
    )
    return after, _instant(parcel, link, clock.time(ends), after, held, gap, rate), h, unbalance


def _instant(
    parcel: Parcel,
    link: FlexibleLink | None,
    time: Array,
    state: _State,
    fence: FenceState | None,
    gap: Array,
    rate: Array,
) -> Sample:
    """A sample: the fence lies along x, and the parcel moves along -y onto it."""
    zero = jnp.zeros_like(time)
    energy = Energy(
        0.5 * parcel.mass * state.rate**2,
        zero,
        zero,
        parcel.contact_law.stored_energy(gap),
    )
    power = Power(zero, zero, zero, state.force * rate, zero, zero, zero, zero)
    place, tip, stress, stress_place = zero, zero, zero, zero
    if link is not None and fence is not None:
        place = fence.shapes[0].place + zero
        tip, stress, stress_place = bent(link, fence)
        kinetic = 0.5 * link.mass_scale * total(v * v for v in fence.vibration.rate)
        energy = energy._replace(fence=kinetic, strain=strain_energy(link, fence))
        power = power._replace(beam_damping=damping_power(link, fence))
    return Sample(
        time=time,
        body=Body(place, -state.advance, zero, zero, -state.rate, zero),
        acceleration=Acceleration(zero, state.force / parcel.mass, zero),
        drive=None,
        vibration=None if fence is None else fence.vibration,
        fence=(Contact(state.force, zero, gap, rate, place, zero),),
        border=(),
        belt=None,
        fence_force=state.force,
        over_tip=zero,
        tip_deflection=tip,
        stress=stress,
        stress_place=stress_place,
        torque=zero,
        energy=energy,
        power=power,
        carried=() if fence is None else carried(fence),
    )


def _status(scene: NormalScene, link: FlexibleLink | None, tallied: tally.Tally) -> Array:
    """The largest status that applies, as a floating-point number."""
    side = jnp.minimum(scene.parcel.length, scene.parcel.breadth)
    checks = [
        (Status.NEVER_TOUCHED, tallied.force.value <= 0),
        (Status.IN_CONTACT_AT_END, tallied.last.fence_force > 0),
        (Status.DEEP_PENETRATION, tallied.deepest > side / 2),
        (Status.STEP_TOO_COARSE, tallied.defect > 1e-3 * tallied.force.value + 1e-9),
        (Status.INCONSISTENT, ~consistent(scene)),
        (Status.NON_FINITE, ~jnp.isfinite(tallied.last.body.y + tallied.force.value)),
        *unresolved(link, tallied),
    ]
    if scene.fence is not None:
        limit = scene.fence.flexible_length / 4
        checks.append((Status.LARGE_DEFLECTION, tallied.tip.value > limit))
    return worst(checks, tallied.last.body.y)
