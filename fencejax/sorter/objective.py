"""What a sorter's design minimises: a quantity, and its worst, mean or CVaR over the parcels."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from .. import _check
from ..design import Quantity, risk
from .amounts import amount, nearest, refuse_unknown
from .limits import quantities


class Objective(eqx.Module):
    """The objective: a quantity's `"worst"`, `"mean"` or `"cvar"` over the parcels (the last is the
    mean of the largest values, beyond the share `level`)."""

    quantity: Quantity = eqx.field(static=True)
    over: str = eqx.field(static=True, default="worst")
    level: float = eqx.field(static=True, default=0.95)

    def over_parcels(self, values: ArrayLike, weights: ArrayLike) -> Array:
        """The worst case, mean or CVaR of one number a parcel (P,), with the parcels'
        frequencies."""
        if self.over == "worst":
            return jnp.max(jnp.asarray(values))
        return risk.risk(values, self.over, self.level, weights=weights)


_KEYS = ("minimize", "over", "level")


def read(raw: Any) -> Objective:
    """The objective of a sorter file: a quantity's name, or a table."""
    table = raw if isinstance(raw, Mapping) else {"minimize": raw}
    refuse_unknown("objective", table, _KEYS)
    wanted = table.get("minimize", "peak_force")
    if isinstance(wanted, str):
        known = quantities()
        if wanted not in known:
            raise ValueError(
                f"Argument `objective.minimize` must be one of {', '.join(known)}, but is "
                f"{wanted!r}.{nearest(wanted, known)}"
            )
        wanted = known[wanted]
    wanted = _check.part("objective", wanted, Quantity, "objective='peak_force'")
    over = _check.choice("objective.over", table.get("over", "worst"), risk.MEASURES)
    level = amount("objective.level", table.get("level", 0.95), "1")
    if not 0 < level < 1:
        raise ValueError(
            f"Argument `objective.level` must be above 0 and below 1 [1], but is {level:g}. Write "
            'over = "worst" for the largest value.'
        )
    return Objective(wanted, over, level)
