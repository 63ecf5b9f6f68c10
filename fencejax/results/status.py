"""What a simulation says about itself."""

import enum

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike


class Status(enum.IntEnum):
    """The outcome of a simulation, one a lane; the largest that applies counts.

    `text` says the likely cause and what to change. Up to `LEFT_OVER_TIP` the numbers are good
    within what `Fidelity` promises; from `PEAK_AT_END` on they are not to be relied on, and
    `fencejax.good` takes them out of a sum and of its gradient.

    >>> status = fj.Status(11)
    >>> status.name, status.numerical
    ('STEP_TOO_COARSE', True)
    """

    SUCCESSFUL = 0
    NEVER_TOUCHED = 1
    IN_CONTACT_AT_END = 2
    LEFT_OVER_TIP = 3
    PEAK_AT_END = 4
    PEAK_AT_TIP = 5
    LARGE_DEFLECTION = 6
    DEEP_PENETRATION = 7
    FRICTION_SMOOTHED = 8
    MODES_TOO_FEW = 9
    ENERGY_UNBALANCED = 10
    STEP_TOO_COARSE = 11
    LIMIT_REACHED = 12
    INCONSISTENT = 13
    NON_FINITE = 14

    @property
    def text(self) -> str:
        """Likely cause, and what to change."""
        return _TEXT[self]

    @property
    def numerical(self) -> bool:
        """Whether it doubts the numbers and not the design: a finer fidelity settles it."""
        return self in NUMERICAL


_TEXT = {
    Status.SUCCESSFUL: "successful",
    Status.NEVER_TOUCHED: "the parcel did not touch the fence before the end; run longer with "
    "`duration=...`",
    Status.IN_CONTACT_AT_END: "still in contact with the fence at the end; run longer with "
    "`duration=...` if what follows matters",
    Status.LEFT_OVER_TIP: "a corner ran over the fence's tip while pressed on it, and the force "
    "was ended there; let the tip carry on against the parcel's side by `tip_contact=True` in the "
    "scene, with the corner that follows, or that came under the fence, in `fence_corners`",
    Status.PEAK_AT_END: "the fence's force was largest as the simulation ended, and may grow on; "
    "run longer with `duration=...`",
    Status.PEAK_AT_TIP: "the force was largest while a corner ran over the fence's tip, where it "
    "is ended; let the tip carry on against the parcel's side by `tip_contact=True` in the scene, "
    "with the corner that follows, or that came under the fence, in `fence_corners`",
    Status.LARGE_DEFLECTION: "the tip deflects by more than a quarter of the flexible link, "
    "beyond the linear beam; make the fence thicker",
    Status.DEEP_PENETRATION: "a corner goes in by more than half the parcel's shorter side, "
    "beyond the contact law; give the parcel a larger contact stiffness",
    Status.FRICTION_SMOOTHED: "what dry friction on the belt is smoothed over bears on the peak "
    "force, or a corner was only just held on the fence, or let go; lower `slip_speed` and "
    "`static_speed` in the fidelity, both alike",
    Status.MODES_TOO_FEW: "the bending modes kept do not follow the force; raise `modes` in the "
    "fidelity",
    Status.ENERGY_UNBALANCED: "the energy ledger does not close with the work done; "
    "lower `step` in the fidelity",
    Status.STEP_TOO_COARSE: "the steps are too long for what happens within one (a blow, a second "
    "one, friction that turns round), or for the derivatives that are asked for; lower `step` and "
    "`step_tolerance` in the fidelity; where two maxima of the force are about equally high, a "
    "finer one tells whose derivatives count; where the parcel bounced on the fence three times "
    "before the force was largest, change the design",
    Status.LIMIT_REACHED: "a general integrator came to its limit of steps; use "
    "`integrator=\"modal\"` in the fidelity",
    Status.INCONSISTENT: "the scene's numbers do not go together; build the scene outside the "
    "transformation, which names the number and its bound",
    Status.NON_FINITE: "the state is not finite, or runs away; print the scene, and correct the "
    "number that is extreme",
}


NUMERICAL = frozenset({
    Status.FRICTION_SMOOTHED, Status.MODES_TOO_FEW, Status.ENERGY_UNBALANCED,
    Status.STEP_TOO_COARSE, Status.LIMIT_REACHED,
})  # fmt: skip
"""The statuses that doubt the numbers and not the design."""


def counted(statuses: ArrayLike) -> dict[str, int]:
    """How many lanes ended with each status, by its name."""
    found = np.unique(np.asarray(statuses), return_counts=True)
    return {Status(int(code)).name: int(number) for code, number in zip(*found, strict=True)}


def worst(checks, like: Array) -> Array:
    """The largest status whose check holds, as a floating-point number shaped like `like`."""
    status = jnp.zeros_like(like)
    for code, holds in checks:
        status = jnp.maximum(status, jnp.where(holds, float(code), 0.0))
    return status
