"""The status of a simulation."""

import enum

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike


class Status(enum.IntEnum):
    """The outcome of a simulation, one a lane. Where several apply, it is the largest.

    `text` has the likely cause and a remedy. Up to `LEFT_OVER_TIP` the numbers are good within what
    `Fidelity` promises; from `PEAK_AT_END` on they are not to be relied on, and `fencejax.good`
    takes them out of a sum and of its gradient.

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
        """The likely cause, and a remedy."""
        return _TEXT[self]

    @property
    def numerical(self) -> bool:
        """Whether it concerns the accuracy of the numbers, not the design: a finer fidelity removes
        it."""
        return self in NUMERICAL


_AT_TIP = (
    "write `tip_contact=True` in the scene, unless it has it, so that the tip goes on pushing the "
    "parcel's side, and name in `fence_corners` every corner that can meet the fence"
)
_TEXT = {
    Status.SUCCESSFUL: "successful",
    Status.NEVER_TOUCHED: "the parcel did not touch the fence before the end; run longer with "
    "`duration=...`",
    Status.IN_CONTACT_AT_END: "still in contact with the fence at the end; run longer with "
    "`duration=...` if what follows matters",
    Status.LEFT_OVER_TIP: "a corner slid over the fence's tip while pressed on it, where its "
    f"contact force ends, or a corner not in `fence_corners` came under the fence; {_AT_TIP}",
    Status.PEAK_AT_END: "the fence's force was largest as the simulation ended, and may grow "
    "further; run longer with `duration=...`",
    Status.PEAK_AT_TIP: "the force was largest while a corner slid over the fence's tip, where its "
    f"contact force ends, or as a corner not in `fence_corners` came under the fence; {_AT_TIP}",
    Status.LARGE_DEFLECTION: "the tip deflects by more than a quarter of the flexible link's "
    "length, where linear beam theory no longer holds; make the fence thicker",
    Status.DEEP_PENETRATION: "a corner is pressed in by more than half the parcel's shorter side, "
    "where the contact law no longer holds; soften the blow (thinner fence, slower drive), or "
    "correct the parcel's `stiffness` if it was guessed",
    Status.FRICTION_SMOOTHED: "the peak force depends on the smoothing of the belt's friction, or "
    "a corner on the fence was close to its limit of static friction; lower `slip_speed` and "
    "`static_speed` by the same factor; if the status stays, the outcome hangs on the coefficient "
    "of friction",
    Status.MODES_TOO_FEW: "the bending modes that are kept are too few to follow the force; raise "
    "`modes` in the fidelity",
    Status.ENERGY_UNBALANCED: "the energy balance does not close: the work done is not what is "
    "stored and lost; lower `step` in the fidelity",
    Status.STEP_TOO_COARSE: "the steps are too long for what happens within one of them (a blow, "
    "a second blow, friction that reverses), or for the derivatives that are asked for; lower "
    "`step` and `step_tolerance` in the fidelity; where two maxima of the force are about equally "
    "high, a finer fidelity tells which one counts; where the parcel bounced on the fence three "
    "times or more before its largest force, no fidelity settles it: change the design",
    Status.LIMIT_REACHED: "a general integrator (`integrator` other than \"modal\") gave up before "
    "the end, at its largest number of steps or its shortest step; use `integrator=\"modal\"` in "
    "the fidelity",
    Status.INCONSISTENT: "a number of the scene is out of its bounds, or contradicts another one; "
    "build the scene outside of jit, vmap and grad, where the refusal names the number and its "
    "bound",
    Status.NON_FINITE: "the state is not finite, or grows without bound; print the scene, and "
    "correct the number that is extreme",
}


NUMERICAL = frozenset({
    Status.FRICTION_SMOOTHED, Status.MODES_TOO_FEW, Status.ENERGY_UNBALANCED,
    Status.STEP_TOO_COARSE, Status.LIMIT_REACHED,
})  # fmt: skip
"""The statuses that concern the accuracy of the numbers, not the design."""
LARGEST_BEND, DEEPEST = 0.25, 0.5
"""Limits of the model: the tip's deflection over the flexible link's length [1], and the depth of a
corner's contact over the parcel's shorter side [1]. Beyond are `LARGE_DEFLECTION` and
`DEEP_PENETRATION`."""


def counted(statuses: ArrayLike) -> dict[str, int]:
    """The number of lanes with each status, by the status' name."""
    found = np.unique(np.asarray(statuses), return_counts=True)
    return {Status(int(code)).name: int(number) for code, number in zip(*found, strict=True)}


def worst(checks, like: Array) -> Array:
    """The largest status whose check holds, as a floating-point number shaped like `like`."""
    status = jnp.zeros_like(like)
    for code, holds in checks:
        status = jnp.maximum(status, jnp.where(holds, float(code), 0.0))
    return status
