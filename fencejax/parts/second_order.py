"""Second-order loads on the fence."""

import equinox as eqx

from .. import _check
from ..printing import Part


class SecondOrderLoads(Part):
    """The loads of a contact force on the bent fence, beyond N across the rigid link's line (2.8).

    On the fence act -N n and the friction F_f t, at the face and in the directions of the bent
    line. By their virtual work, with U the contact's place and q the deflection's amplitudes, they
    load a mode with

        Q_i = (F_f t - N n) . dU / dq_i - F_f integral of (h / 2) phi_i'' from root to U,

    which is -N phi_i where the fence is straight. The additional terms are in three parts, each on
    or off: `friction_moment`, F_f half the thickness off the neutral axis; `friction_force`, F_f t
    . dU / dq_i, which bends the fence across the rigid link's line and stiffens it along that; and
    `normal_force`, N (phi_i - n . dU / dq_i). The effects of a force's component along the
    rigid link's line and of that across it nearly cancel. So the load of a beam-column, by the
    component along the line alone, is no more accurate than no second-order load at all.

    The contact face is straight, and the taper is on the back: the moment at a section is F_f times
    half its own thickness, and 0 about the hinge, which is on the face's line.

    They act in the modes, the moment of the drive and the bending stress. U moves as in the chords'
    geometry, whatever the fidelity's. The corner slides against the line of U, which does not
    stretch as a face does. Where the tip carries the contact on a parcel's side, the load along the
    fence there is left out.

    V. V. Bolotin, Nonconservative Problems of the Theory of Elastic Stability, Pergamon 1963
    (forces that follow a bent rod). There at its end.

    >>> fence = fj.Fence(second_order=fj.SecondOrderLoads(normal_force=False))
    >>> fence.second_order
    SecondOrderLoads(friction_moment=True, friction_force=True, normal_force=False)
    """

    friction_moment: bool = eqx.field(static=True)
    friction_force: bool = eqx.field(static=True)
    normal_force: bool = eqx.field(static=True)

    def __init__(
        self, friction_moment: bool = True, friction_force: bool = True, normal_force: bool = True
    ):
        """**Arguments:** whether each of them acts, by default all.

        Raises `TypeError` for anything but True and False.
        """
        self.friction_moment = _check.flag("friction_moment", friction_moment)
        self.friction_force = _check.flag("friction_force", friction_force)
        self.normal_force = _check.flag("normal_force", normal_force)

    @property
    def act(self) -> bool:
        """Whether any of them acts."""
        return self.friction_moment or self.friction_force or self.normal_force
