"""The full state of a scene at one instant; a history is made of such samples."""

import itertools
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ..model import (
    Acceleration,
    BeltForce,
    Contact,
    FenceState,
    FlexibleLink,
    Forces,
    Mechanics,
    NormalState,
    Vibration,
    dot,
    total,
)
from ..parts import DriveMotion, Parcel
from ..scenes import Body
from .interpolation import interpolate


class Energy(NamedTuple):
    """Energies at an instant [J]: of the parcel's motion, of the fence's motion, of its
    bending, and of the elastic part of the contacts, with the fence's cover."""

    parcel: Array
    fence: Array
    strain: Array
    contact: Array


class Power(NamedTuple):
    """Rates of work [W], positive where the name says it: done by `drive`, `belt` and `geometry`;
    taken up by `contact`, with the fence's cover (stored and dissipated); dissipated by the others.

    `geometry` is what small-deflection beam theory leaves out: the contact forces act along the
    bent fence's normal and tangent at the point U, while the beam is loaded with N along the
    undeflected normal (2.8) and with no tangential force. Of second-order loads it is what they
    still leave out.
    """

    drive: Array
    belt: Array
    geometry: Array
    contact: Array
    fence_friction: Array
    border_friction: Array
    belt_friction: Array
    beam_damping: Array


class Sample(NamedTuple):
    """A sample of a scene. Parts that the scene does not hold are `None` or empty."""

    time: Array
    body: Body
    acceleration: Acceleration
    drive: DriveMotion | None
    vibration: Vibration | None
    fence: tuple[Contact, ...]
    border: tuple[Contact, ...]
    belt: BeltForce | None
    fence_force: Array
    over_tip: Array
    """1 where the force of a corner ends beyond the tip and nothing in the scene takes over from
    it; 2 where a corner is under the fence that is not among the scene's `fence_corners`."""
    tip_deflection: Array
    """Deflection of the tip from the rigid link's line [m], positive where a parcel bends it."""
    stress: Array
    stress_place: Array
    torque: Array
    energy: Energy
    power: Power
    carried: tuple[tuple[Array, Array], ...]
    """For each load of the fence: the compliance [m/N] of the modes left out, and the load [N]
    that they carry; empty without them."""
    directions: tuple[tuple[Array, Array, Array], ...] = ()
    """For each corner at the fence: the direction (x, y) of the normal force and its moment about
    C_s [m]; empty where the tip carries none, as they follow from the fence's slope then."""
    surfaces: tuple[tuple[Contact, ...], ...] = ()
    """For each of the scene's other surfaces: its corners."""
    twist: Array | None = None
    """Angle of the hinge ahead of the motor [rad]; `None` without a flexible shaft. On a torque
    drive `drive` is the hinge's motion."""
    slip: Array | None = None
    """The part of the twist by which the clutch has slipped [rad]; `None` without a clutch."""
    stresses: Array | None = None
    """Bending stress [Pa] at the nodes 0 ... n - 1 of the flexible link, positive on the side away
    from the parcel where a parcel bends it; not in histories."""

    def at(self, times: ArrayLike) -> "Sample":
        """A history at other times [s], (K,): cubics between its samples (`interpolate`), constant
        before and after them.

            result.history.at(jnp.linspace(0.0, 0.1, 101))

        Within `jit`, `vmap` and derivatives as well; lanes whose steps differ then have their
        samples at the same times. The error is of the third order in the samples' spacing where a
        signal is smooth, and of the first across a kink: a force that begins or ends.

        Raises `ValueError` for one sample alone, and for times of another shape.
        """
        if jnp.ndim(self.time) != 1 or jnp.ndim(times) != 1:
            raise ValueError(
                "Argument `times` must be a vector, of a history with one axis of times, but they "
                f"have {jnp.ndim(times)} and {jnp.ndim(self.time)} axes. Write "
                "jax.vmap(lambda history: history.at(times)) for a batch."
            )
        leaves, structure = jax.tree.flatten(self)
        parts = [jnp.reshape(leaf, (leaf.shape[0], -1)) for leaf in leaves]
        knots = jnp.asarray(self.time)
        clock = jnp.asarray(times, dtype=knots.dtype)
        found = interpolate(clock, knots, jnp.concatenate(parts, axis=1))
        places = itertools.accumulate(part.shape[1] for part in parts)
        shown = [
            found[:, place - part.shape[1] : place].reshape(-1, *leaf.shape[1:])
            for place, part, leaf in zip(places, parts, leaves, strict=True)
        ]
        return jax.tree.unflatten(structure, shown)._replace(time=clock)


def describe(
    mechanics: Mechanics, time: Array, body: Body, forces: Forces, fence: FenceState | None
) -> Sample:
    """Gather a sample from the motion, the forces and the fence's state."""
    zero = jnp.zeros_like(body.x)
    at_fence = tuple(meeting.contact for meeting in forces.fence)
    at_border = tuple(meeting.contact for meeting in forces.border)
    at_still = tuple(meeting.contact for meeting in forces.still)
    fence_force = sum((c.normal for c in at_fence), zero)
    kinetic = 0.5 * mechanics.mass * (body.x_rate**2 + body.y_rate**2)
    kinetic = kinetic + 0.5 * mechanics.inertia * body.spin**2
    stored = sum((mechanics.law.stored_energy(c.gap) for c in at_still), zero)
    over_tip = zero
    for k, (c, touch, _, _) in enumerate(forces.fence):
        share = mechanics.fade(c.place)
        stored = stored + touch.remaining(share) * mechanics.law.stored_energy(c.gap)
        over_tip = jnp.where(mechanics.ends(k, c, touch), 1.0, over_tip)
        if touch.missed is not None:
            over_tip = jnp.where(touch.missed > 0, 2.0, over_tip)
    tip, stress, place, torque, stresses = zero, zero, zero, zero, None
    vibration = twist = slip = drive = None
    energy = Energy(kinetic, zero, zero, stored)
    power = Power(
        drive=zero,
        belt=zero,
        geometry=zero,
        contact=sum((c.normal * c.gap_rate for c in at_fence + at_still), zero),
        fence_friction=sum((-c.friction * c.sliding for c in at_fence), zero),
        border_friction=sum((-c.friction * c.sliding for c in at_still), zero),
        belt_friction=zero,
        beam_damping=zero,
    )
    if forces.belt is not None:
        assert mechanics.belt is not None
        power = power._replace(
            belt=forces.belt.x * mechanics.belt.speed, belt_friction=forces.belt.dissipated
        )
    if fence is not None:
        link = mechanics.link
        assert link is not None
        tip, stress, place, stresses = bent(link, fence)
        assert fence.drive is not None
        vibration = link.clamped(fence.vibration)
        drive = link.motion(fence.drive, fence.vibration, fence.modal_force)
        if link.hinge is not None and not link.hinge.driven:
            twist = link.hinge.twist(fence.vibration)[0]
        if link.hinge is not None and link.hinge.clutch is not None and fence.clutch is not None:
            slip = link.hinge.clutch.slip(fence.clutch)
        torque = _torque(link, fence, forces)
        energy = _fence_energy(link, fence, energy)
        power = _fence_power(link, fence, forces, power)
        power = power._replace(drive=torque * drive.speed)
        if fence.pads:
            energy = energy._replace(contact=energy.contact + pad_energy(link, fence))
            taken = pad_power(link, fence, fence.loads(forces))
            power = power._replace(contact=power.contact + taken)
    return Sample(
        time=time,
        body=body,
        acceleration=forces.acceleration,
        drive=drive,
        vibration=vibration,
        fence=at_fence,
        border=at_border,
        belt=forces.belt,
        fence_force=fence_force,
        over_tip=over_tip,
        tip_deflection=tip,
        stress=stress,
        stress_place=place,
        torque=torque,
        energy=energy,
        power=power,
        carried=() if fence is None else carried(fence),
        directions=tuple(
            meeting.touch.normal for meeting in forces.fence if meeting.touch.tip_load is not None
        ),
        surfaces=tuple(
            tuple(meeting.contact for meeting in group) for group in forces.surfaces
        ),
        twist=twist,
        slip=slip,
        stresses=stresses,
    )


def carried(fence: FenceState) -> tuple[tuple[Array, Array], ...]:
    """Compliance [m/N] of the modes left out and the load [N] that they carry, at each corner."""
    return tuple(
        (shape.left_out, load)
        for shape, load in zip(fence.shapes, fence.lagged, strict=True)
        if shape.left_out is not None
    )


def bent(link: FlexibleLink, fence: FenceState) -> tuple[Array, Array, Array, Array]:
    """Deflection of the tip [m], positive where a parcel bends it, the largest bending stress [Pa]
    in size and its arc coordinate [m], and the stress at every node [Pa], signed as the tip's
    deflection is."""
    amplitude = fence.vibration.amplitude
    tip = -link.tip_deflection(amplitude, fence.lagged, fence.shapes)
    signed = link.bending_stress(amplitude, fence.lagged, fence.shapes)
    stresses = jnp.abs(signed)
    worst = jnp.argmax(stresses)
    return tip, stresses[worst], link.rigid_length + link.stations[worst], -signed


def strain_energy(link: FlexibleLink, fence: FenceState) -> Array:
    """Energy of the modes and of the modes left out [J]."""
    strain = 0.5 * link.mass_scale * total(
        k * q * q for k, q in zip(link.frequency_squared, fence.vibration.amplitude, strict=True)
    )
    if link.hinge is not None and link.hinge.clutch is not None and fence.clutch is not None:
        angle, _ = link.hinge.twist(fence.vibration)
        strain = strain + link.hinge.clutch.stored(angle, fence.clutch)
    for force, rate in fence.residual:
        strain = strain + 0.5 * (force - link.lag * rate) ** 2
    return strain


def damping_power(link: FlexibleLink, fence: FenceState) -> Array:
    """Power dissipated by the modes, with shaft and clutch, and by the modes left out [W]."""
    damped = link.mass_scale * total(
        c * v * v for c, v in zip(link.damping, fence.vibration.rate, strict=True)
    )
    if link.hinge is not None:
        rate = fence.vibration.rate
        damped = damped - link.mass_scale * dot(link.hinge.coupling(rate), rate)
        if link.hinge.clutch is not None and fence.clutch is not None:
            twist = link.hinge.twist(fence.vibration)
            damped = damped + link.hinge.clutch.loss(*twist, fence.clutch)
    for _, rate in fence.residual:
        damped = damped + link.lag * rate**2
    return damped


def pad_energy(link: FlexibleLink, fence: FenceState) -> Array:
    """Energy stored in the cover [J]."""
    assert link.cover is not None
    return total(map(link.cover.stored_energy, fence.pads))


def pad_power(link: FlexibleLink, fence: FenceState, loads: tuple[Array, ...]) -> Array:
    """Power taken up by the cover under its `loads` [N], stored and dissipated [W]."""
    assert link.cover is not None
    return total(
        load * link.cover.compression(pad)[1]
        for load, pad in zip(loads, fence.pads, strict=True)
    )


def _torque(link: FlexibleLink, fence: FenceState, forces: Forces) -> Array:
    """Moment of the drive [N m]: the generalised force on alpha_w,
    (I_root + Phi^T M Phi) alpha'' + Phi^T M u'' + sum N sigma over the loads of the fence; of a
    torque drive its torque."""
    assert fence.drive is not None
    if fence.drive.torque is not None:
        return fence.drive.torque
    accelerations = link.acceleration(fence.vibration, fence.modal_force)
    torque = (link.root_inertia + link.swing_inertia) * fence.drive.acceleration
    torque = torque + link.mass_scale * dot(link.swing, accelerations)
    for load, shape in zip(fence.loads(forces), fence.shapes, strict=True):
        torque = torque + load * shape.arm
    return torque


def _fence_energy(link: FlexibleLink, fence: FenceState, energy: Energy) -> Energy:
    assert fence.drive is not None
    rate, speed = fence.vibration.rate, fence.drive.speed
    kinetic = 0.5 * (link.root_inertia + link.swing_inertia) * speed**2
    kinetic = kinetic + link.mass_scale * (
        speed * dot(link.swing, rate) + 0.5 * total(v * v for v in rate)
    )
    return energy._replace(fence=kinetic, strain=strain_energy(link, fence))


def _fence_power(
    link: FlexibleLink, fence: FenceState, forces: Forces, power: Power
) -> Power:
    assert fence.drive is not None
    geometry = jnp.zeros_like(power.drive)
    loads = fence.loads(forces)
    for k, ((c, parts, _, _), load, shape) in enumerate(
        zip(forces.fence, loads, fence.shapes, strict=True)
    ):
        transverse = shape.arm * fence.drive.speed + dot(shape.load, fence.vibration.rate)
        if fence.residual and shape.residual_mode is not None:
            transverse = transverse - shape.residual_mode[0] * fence.residual[k].rate
        if fence.pads and link.cover is not None:
            transverse = transverse - link.cover.compression(fence.pads[k])[1]
        across, along = parts.rates
        geometry = geometry + c.normal * across - load * transverse + c.friction * along
    return power._replace(
        geometry=geometry,
        beam_damping=damping_power(link, fence),
    )


def describe_normal(parcel: Parcel, link: FlexibleLink | None, state: NormalState) -> Sample:
    """A sample of a scene of the normal direction: the fence lies along x, and the parcel moves
    along -y onto it."""
    zero, fence = jnp.zeros_like(state.time), state.fence
    stored = parcel.contact_law.stored_energy(state.gap)
    energy = Energy(0.5 * parcel.mass * state.rate**2, zero, zero, stored)
    power = Power(zero, zero, zero, state.force * state.gap_rate, zero, zero, zero, zero)
    place, tip, stress, stress_place, stresses = zero, zero, zero, zero, None
    vibration = twist = None
    if link is not None and fence is not None:
        place = fence.shapes[0].place + zero
        tip, stress, stress_place, stresses = bent(link, fence)
        vibration = link.clamped(fence.vibration)
        twist = None if link.hinge is None else link.hinge.twist(fence.vibration)[0]
        kinetic = 0.5 * link.mass_scale * total(v * v for v in fence.vibration.rate)
        energy = energy._replace(fence=kinetic, strain=strain_energy(link, fence))
        power = power._replace(beam_damping=damping_power(link, fence))
        if fence.pads:
            energy = energy._replace(contact=stored + pad_energy(link, fence))
            taken = pad_power(link, fence, (state.force,))
            power = power._replace(contact=power.contact + taken)
    touching = Contact(state.force, zero, state.gap, state.gap_rate, place, zero)
    return Sample(
        time=state.time,
        body=Body(place, -state.advance, zero, zero, -state.rate, zero),
        acceleration=Acceleration(zero, state.force / parcel.mass, zero),
        drive=None,
        vibration=vibration,
        fence=(touching,),
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
        twist=twist,
        stresses=stresses,
    )
