"""What a simulation returns."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array

from ..scenes import Body
from .accumulators import Tally
from .error_estimate import ErrorEstimate
from .sample import Energy, Power, Sample
from .status import Status


class Ledger(eqx.Module):
    """The energy ledger of a scene [J]: changes of what is held, work done, energy dissipated.

    residual = changes + dissipated + contact - work. It vanishes at the order of the step.
    """

    parcel_kinetic: Array
    """Change of the parcel's kinetic energy."""
    fence_kinetic: Array
    """Change of the fence's kinetic energy."""
    strain: Array
    """Change of the energy of bending."""
    contact_stored: Array
    """Change of the elastic energy of the contacts."""
    drive_work: Array
    """Work of the drive at the hinge."""
    belt_work: Array
    """Work of the belt's motion on the parcel."""
    geometry_work: Array
    """Work that small-deflection beam theory leaves out (see `fencejax.results.Power`)."""
    contact_loss: Array
    """Dissipated in the contacts."""
    fence_friction_loss: Array
    """Dissipated by corners sliding along the fence."""
    border_friction_loss: Array
    """Dissipated by corners sliding along the border."""
    belt_friction_loss: Array
    """Dissipated between parcel and belt."""
    damping_loss: Array
    """Dissipated in the fence's material."""

    @property
    def residual(self) -> Array:
        """What does not balance [J]."""
        held = self.parcel_kinetic + self.fence_kinetic + self.strain + self.contact_stored
        lost = (
            self.contact_loss
            + self.fence_friction_loss
            + self.border_friction_loss
            + self.belt_friction_loss
            + self.damping_loss
        )
        return held + lost - self.drive_work - self.belt_work - self.geometry_work


def ledger(begin: Energy, end: Energy, work: Power) -> Ledger:
    """The ledger from the energies held at the begin and at the end, with the integrals of the
    powers between them."""
    stored = end.contact - begin.contact
    return Ledger(
        parcel_kinetic=end.parcel - begin.parcel,
        fence_kinetic=end.fence - begin.fence,
        strain=end.strain - begin.strain,
        contact_stored=stored,
        drive_work=work.drive,
        belt_work=work.belt,
        geometry_work=work.geometry,
        contact_loss=work.contact - stored,
        fence_friction_loss=work.fence_friction,
        border_friction_loss=work.border_friction,
        belt_friction_loss=work.belt_friction,
        damping_loss=work.beam_damping,
    )


class Result(eqx.Module):
    """The outcome of a scene. Times are since its start [s]; the drive's clock then read
    `start_time`. What the scene has no part for is 0, or `None` in the history; fields that were
    not asked for (`simulate(only=...)`) are `None`."""

    peak_force: Array
    """Largest normal force of the fence on the parcel [N] (all its corners together), refined
    between steps. For the rigid wall, N_stiff."""
    peak_time: Array
    """Time of the peak force [s]."""
    tip_deflection: Array
    """Largest deflection of the tip from the rigid link's line [m], either way."""
    tip_time: Array
    """Time of the largest tip deflection [s]."""
    peak_stress: Array
    """Largest bending stress in the flexible link [Pa]."""
    stress_place: Array
    """Arc coordinate of the largest bending stress, from the hinge [m]."""
    impulse: Array
    """Integral of the fence's normal force [N s]."""
    contact_time: Array
    """Time spent in contact with the fence [s]."""
    first_contact: Array
    """Time of the first touch [s]; NaN if there is none."""
    last_contact: Array
    """Time of the last contact, D = 0 [s]; NaN if there is none. The force ends a little before it,
    where the two part faster than the parcel recovers its shape."""
    leave_x: Array
    """x of C_s at the last contact, where the parcel leaves the fence [m]; NaN if there is none."""
    leave_y: Array
    """y of C_s at the last contact [m]; NaN if there is none."""
    furthest_y: Array
    """Largest y of C_s at a step [m]: how far the parcel got across the belt."""
    largest_place: Array
    """Largest arc coordinate of a corner under load [m]: how far out the contact got."""
    peak_border_force: Array
    """Largest normal force of the border on the parcel [N]."""
    peak_torque: Array
    """Largest moment of the drive at the hinge, either way [N m]."""
    deepest: Array
    """Largest gap D of a corner under load [m]: how far it was pressed in."""
    final: Body
    """The parcel's motion at the end."""
    energy: Ledger
    """The energy ledger [J]."""
    start_time: Array
    """The drive's clock at the start [s]."""
    defect: Array
    """Largest force left unbalanced by a step's equations [N]."""
    status: Array
    """A `Status`, as an integer (one a lane)."""
    history: Sample | None
    """Every sample, if asked for: each field with the time as its first axis."""
    error: ErrorEstimate | None = None
    """Estimated errors of the fields above, if asked for."""

    def __str__(self) -> str:
        named = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        if any(isinstance(leaf, Tracer) for leaf in named.values()):
            return "Result(traced)"
        if any(leaf is None for name, leaf in named.items() if name not in ("history", "error")):
            kept = (f"{name} {leaf}" for name, leaf in named.items() if leaf is not None)
            return "\n".join(kept)
        leaf = self.peak_force
        if leaf.ndim:
            counts = np.unique(np.asarray(self.status), return_counts=True)
            names = ", ".join(
                f"{Status(int(s)).name} {n}" for s, n in zip(*counts, strict=True)
            )
            force = np.asarray(leaf)
            return (
                f"Result of {leaf.shape} lanes: {names}; peak force "
                f"{force.min():.4g} ... {force.max():.4g} N"
            )
        rows = [
            ("status", Status(int(self.status)).text, ""),
            ("peak force", f"{self.peak_force:.2f} N", f"at {1e3 * self.peak_time:.2f} ms"),
        ]
        if np.isfinite(self.first_contact):
            between = f"from {1e3 * self.first_contact:.2f} to {1e3 * self.last_contact:.2f} ms"
            place = f"({self.leave_x:.3f}, {self.leave_y:.3f}) m"
            rows += [
                ("impulse", f"{self.impulse:.3f} N s", ""),
                ("contact", f"{1e3 * self.contact_time:.2f} ms", between),
                ("leaves at", place, "(C_s, last contact)"),
            ]
        rows += [
            (
                "tip deflection",
                f"{1e3 * self.tip_deflection:.2f} mm",
                f"at {1e3 * self.tip_time:.2f} ms",
            ),
            (
                "bending stress",
                f"{1e-6 * self.peak_stress:.2f} MPa",
                f"at {self.stress_place:.3f} m from the hinge",
            ),
            ("drive torque", f"{self.peak_torque:.2f} N m", "largest"),
            ("border force", f"{self.peak_border_force:.2f} N", "largest"),
            ("pressed in by", f"{1e3 * self.deepest:.2f} mm", ""),
            ("energy residual", f"{self.energy.residual:.2e} J", ""),
        ]
        text = "\n".join(f"{name:>16}  {value}  {note}".rstrip() for name, value, note in rows)
        return text if self.error is None else f"{text}\n{'errors':>16}  estimated:\n{self.error}"


def gather(tally: Tally, samples: Sample | None, time: Array, status: Array) -> Result:
    """The result from the running tallies."""
    stay = tally.stay
    return Result(
        peak_force=tally.force.value,
        peak_time=tally.force.time,
        tip_deflection=tally.tip.value,
        tip_time=tally.tip.time,
        peak_stress=tally.stress.value,
        stress_place=tally.stress_place,
        impulse=tally.impulse,
        contact_time=stay.total,
        first_contact=jnp.where(stay.touched > 0, stay.first, jnp.nan),
        last_contact=jnp.where(stay.touched > 0, stay.last, jnp.nan),
        leave_x=jnp.where(stay.touched > 0, stay.x, jnp.nan),
        leave_y=jnp.where(stay.touched > 0, stay.y, jnp.nan),
        furthest_y=tally.furthest,
        largest_place=tally.largest_place,
        peak_border_force=tally.border.value,
        peak_torque=tally.torque.value,
        deepest=tally.deepest,
        final=tally.last.body,
        energy=ledger(tally.origin, tally.last.energy, tally.work),
        start_time=time,
        defect=tally.defect,
        status=status,
        history=samples,
    )
