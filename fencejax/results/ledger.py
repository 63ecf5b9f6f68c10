"""The energy ledger: energy stored, work done, energy dissipated."""

from jaxtyping import Array

from ..printing import Part
from .sample import Energy, Power


class Ledger(Part):
    """The energy ledger of a scene [J]: changes of stored energy, work done, energy dissipated.

    residual = changes + dissipated + contact - work. With `Fidelity(longest_stride=1)` it vanishes
    at the order of the step. By default a fence that rings freely is followed in longer strides, up
    to 2 ms, at whose ends alone the work of its drive is sampled: a small share of that work is
    left then, whatever the step.

    >>> energy = fj.simulate(fj.scenes.rigid_wall()).energy
    >>> print(f"{energy.contact_loss:.1f} J of 44.1 J are lost in the contact")
    35.6 J of 44.1 J are lost in the contact
    """

    parcel_kinetic: Array
    """Change of the parcel's kinetic energy."""
    fence_kinetic: Array
    """Change of the fence's kinetic energy, with that of a torque drive."""
    strain: Array
    """Change of the energy of bending, and of the shaft or a torque drive's spring."""
    contact_stored: Array
    """Change of the elastic energy of the contacts, with the fence's cover."""
    drive_work: Array
    """Work of the drive at the hinge."""
    belt_work: Array
    """Work of the belt's motion on the parcel."""
    geometry_work: Array
    """Work that small-deflection beam theory leaves out (see `fencejax.results.Power`)."""
    contact_loss: Array
    """Dissipated in the contacts, with the fence's cover."""
    fence_friction_loss: Array
    """Dissipated by corners sliding along the fence."""
    border_friction_loss: Array
    """Dissipated by corners sliding along the border and other still surfaces."""
    belt_friction_loss: Array
    """Dissipated between parcel and belt."""
    damping_loss: Array
    """Dissipated in the fence's material, its shaft and its clutch, or by a torque drive's
    damping."""

    def _unit(self, name):
        return "J"

    @property
    def residual(self) -> Array:
        """The energy by which the ledger does not close [J]."""
        stored = self.parcel_kinetic + self.fence_kinetic + self.strain + self.contact_stored
        lost = (
            self.contact_loss
            + self.fence_friction_loss
            + self.border_friction_loss
            + self.belt_friction_loss
            + self.damping_loss
        )
        return stored + lost - self.drive_work - self.belt_work - self.geometry_work


def ledger(begin: Energy, end: Energy, work: Power) -> Ledger:
    """The ledger from the energies stored at the beginning and at the end, and the integrals of the
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
