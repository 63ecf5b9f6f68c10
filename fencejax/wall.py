"""The undeformable wall: a parcel with one coordinate."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from . import contact, integrate, newton, tally
from .fidelity import Fidelity
from .instant import Energy, Instant, Power
from .kinematics import Acceleration, Body
from .mechanics import Contact
from .result import Result, gather
from .scenes import WallScene
from .status import Status, worst


class _State(NamedTuple):
    gap: Array
    rate: Array
    force: Array


def _instant(scene: WallScene, time: Array, state: _State) -> Instant:
    """The sample of a wall scene: the parcel moves along -y onto a wall at y = 0."""
    zero = jnp.zeros_like(state.gap)
    mass = scene.parcel.mass
    contacts = Contact(state.force, zero, state.gap, state.rate, zero, zero)
    return Instant(
        time=time,
        body=Body(zero, -state.gap, zero, zero, -state.rate, zero),
        acceleration=Acceleration(zero, state.force / mass, zero),
        drive=None,
        vibration=None,
        fence=(contacts,),
        border=(),
        belt=None,
        fence_force=state.force,
        tip_deflection=zero,
        stress=zero,
        stress_place=zero,
        torque=zero,
        energy=Energy(
            0.5 * mass * state.rate**2,
            zero,
            zero,
            contact.stored_energy(scene.parcel.stiffness, state.gap),
        ),
        power=Power(zero, zero, zero, state.force * state.rate, zero, zero, zero, zero),
        carried=(),
    )


def run(scene: WallScene, fidelity: Fidelity, history: bool) -> Result:
    """Integrate m_p Dddot = -N(D, Ddot) from D = 0, Ddot = v_n."""
    steps = integrate.count_steps(scene.duration, fidelity.step)
    h = scene.duration / steps
    parcel = scene.parcel
    zero = jnp.zeros_like(parcel.mass + scene.speed)
    begin = _State(zero, scene.speed + zero, zero)

    def advance(args, y, index):
        parcel, iterations = args
        state, tallied = y

        def evaluate(given, unknowns):
            (parcel, state), (rate,) = given, unknowns
            gap = state.gap + h * (2 * state.rate + rate) / 3
            gap = gap - h * h * state.force / (6 * parcel.mass)
            law = contact.kelvin(parcel.stiffness, contact.viscosity(parcel), gap, rate)
            value = rate - state.rate + 0.5 * h * (state.force + law.force) / parcel.mass
            slope = 1 + 0.5 * h * (law.by_gap * h / 3 + law.by_rate) / parcel.mass
            unbalance = 2 * parcel.mass * jnp.abs(value) / h
            size = unbalance / (1e-9 * law.force + 1e-9)
            return (value,), [[slope]], size, (_State(gap, rate, law.force), unbalance)

        guess = (state.rate - h * state.force / parcel.mass,)
        _, (after, defect) = newton.solve(
            evaluate, lambda *_: jnp.ones_like(zero), (parcel, state), guess, iterations
        )
        instant = _instant(scene, h * (index + 1), after)
        return after, tally.add(tallied, instant, h, jnp.zeros_like(zero), defect)

    first = _instant(scene, zero, begin)
    (_, tallied), samples = integrate.run_steps(
        advance,
        (begin, tally.begin(first, jnp.zeros_like(zero))),
        (parcel, jnp.full_like(zero, fidelity.iterations)),
        lambda y: y[1].last,
        steps,
        fidelity,
        history,
    )
    side = jnp.minimum(parcel.length, parcel.breadth)
    status = worst(
        [
            (Status.NEVER_TOUCHED, tallied.force.value <= 0),
            (Status.IN_CONTACT_AT_END, tallied.last.fence_force > 0),
            (Status.DEEP_PENETRATION, tallied.deepest > side / 2),
            (Status.STEP_TOO_COARSE, tallied.defect > 1e-3 * tallied.force.value + 1e-9),
            (Status.NON_FINITE, ~jnp.isfinite(tallied.last.body.y + tallied.force.value)),
        ],
        zero,
    )
    if samples is not None:
        samples = integrate.join(first, samples)
    return gather(tallied, first, samples, zero, status)
