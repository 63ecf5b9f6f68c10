"""What a simulation says about itself."""

import enum

import jax.numpy as jnp
from jaxtyping import Array


class Status(enum.IntEnum):
    """The outcome of a simulation, one a lane; the largest that applies counts.

    `text` says the likely cause and what to change. Up to `LEFT_OVER_TIP` the numbers are good
    within the fidelity's error; from `LARGE_DEFLECTION` on they are not to be relied on.
    """

    SUCCESSFUL = 0
    NEVER_TOUCHED = 1
    IN_CONTACT_AT_END = 2
    LEFT_OVER_TIP = 3
    LARGE_DEFLECTION = 4
    DEEP_PENETRATION = 5
    STEP_TOO_COARSE = 6
    NON_FINITE = 7

    @property
    def text(self) -> str:
        """Likely cause, and what to change."""
        return _TEXT[self]


_TEXT = {
    Status.SUCCESSFUL: "successful",
    Status.NEVER_TOUCHED: "the parcel never touched the fence; start it nearer or run longer",
    Status.IN_CONTACT_AT_END: "still in contact with the fence at the end; run longer with "
    "`duration=...` if what follows matters",
    Status.LEFT_OVER_TIP: "a corner ran over the fence's tip while pressed on it; the force was "
    "ended there, the real one goes on between the tip and the parcel's side",
    Status.LARGE_DEFLECTION: "the tip deflects by more than a quarter of the flexible link, "
    "beyond the linear beam; stiffen the fence",
    Status.DEEP_PENETRATION: "a corner goes in by more than half the parcel's shorter side, "
    "beyond the contact law; check its stiffness and the speed",
    Status.STEP_TOO_COARSE: "a step's equations were not solved; lower `step` or raise "
    "`iterations` in the fidelity",
    Status.NON_FINITE: "the state is not finite; check the inputs for extreme values, then lower "
    "`step`",
}


def worst(checks, like: Array) -> Array:
    """The largest status whose check holds, as a floating-point number shaped like `like`."""
    status = jnp.zeros_like(like)
    for code, holds in checks:
        status = jnp.maximum(status, jnp.where(holds, float(code), 0.0))
    return status
