"""The hinge on a flexible shaft at the end of a step, as a function of the loads there."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from ..model import Blocks, ClutchState, FlexibleLink, Hinge, Vibration, blocks
from .step_size import Stride

# Least value of D, the derivative [1] of the shaft's moment in the clutch's load (`HingeResponse`).
# D is 1 less what spring and damper take up within the step, which steps that resolve the shaft
# keep small.
_OWN = 0.1


class HingeResponse(eqx.Module):
    """The response of modes and hinge to each load at the end of a step, and the slip of the
    clutch.

    A clutch acts as one more load, the moment L = k_t s + c_t s' by which its slip s relieves the
    shaft. At the step's end either nothing slips, s' = 0 and L = k_t s_0, or |T| = T_c. Both are
    one condition, piecewise linear in the other loads:

        T = L - k_t theta - c_t theta',  L = k_t s_0 - (T_0 - clip(T_0, -T_c, T_c)) / D,

    T_0 the moment at L = k_t s_0, and D = dT / dL over the step.
    """

    hinge: Hinge
    stride: Stride
    free: tuple[Array, Array]
    pushes: tuple[Vibration, ...]
    turns: tuple[tuple[Array, Array], ...]
    before: ClutchState | None

    def __init__(
        self,
        link: FlexibleLink,
        stride: Stride,
        free: Vibration,
        pushes: tuple[Vibration, ...],
        before: ClutchState | None,
    ):
        """`free` is the vibration at the end without loads. `pushes` are the modes' responses to a
        unit of each load, without the shaft's damping, in units of 1 / m_0. `before` is the clutch
        at the start."""
        assert link.hinge is not None
        self.hinge, self.stride, self.before = link.hinge, stride, before
        self.free = self.hinge.twist(free)
        self.pushes = tuple(self.hinge.coupled(stride.maps, push) for push in pushes)
        if before is not None:
            self.pushes += (self._push(blocks(self.hinge.turn)),)
        mass = link.mass_scale
        turns = (self.hinge.twist(push) for push in self.pushes)
        self.turns = tuple((angle / mass, rate / mass) for angle, rate in turns)

    def _push(self, load: Blocks) -> Vibration:
        """The modes' response to a unit load at the step's end, in units of 1 / m_0."""
        maps = self.stride.maps
        pushed = tuple(m.q_end * share for m, share in zip(maps, load, strict=True))
        struck = tuple(m.v_end * share for m, share in zip(maps, load, strict=True))
        return self.hinge.coupled(maps, Vibration(pushed, struck))

    def twist(self, loads: tuple[Array, ...]) -> tuple[Array, Array]:
        """theta [rad] and its rate [rad/s] under contact forces [N], each against its direction,
        and under the clutch's load, if `loads` has it after them."""
        angle, rate = self.free
        for load, (give, give_rate) in zip(loads, self.turns, strict=False):
            angle, rate = angle - give * load, rate - give_rate * load
        return angle, rate

    def with_clutch(self, loads: tuple[Array, ...]) -> tuple[Array, ...]:
        """The contact forces, followed by the clutch's load -L [N m], if there is a clutch."""
        clutch = self.hinge.clutch
        if clutch is None or self.before is None:
            return loads
        stuck = clutch.stiffness * clutch.slip(self.before)
        give, give_rate = self.turns[-1]
        own = jnp.maximum(1 + clutch.moment(give, give_rate), _OWN)
        moment = stuck * own + clutch.moment(*self.twist(loads))
        excess = moment - jnp.clip(moment, -clutch.limit, clutch.limit)
        return (*loads, excess / own - stuck)

    def clutch(self, loads: tuple[Array, ...]) -> ClutchState | None:
        """The clutch at the end. The last of the `loads` is its own."""
        clutch, before = self.hinge.clutch, self.before
        if clutch is None or before is None:
            return None
        assert self.stride.slip_decay is not None
        assert self.stride.slip_gain is not None
        change = (-loads[-1] - before.relief) / clutch.stiffness
        rate = self.stride.slip_decay * before.rate + self.stride.slip_gain * change
        return ClutchState(-loads[-1], rate)
