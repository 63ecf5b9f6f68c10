"""The normal direction alone: a parcel with one coordinate strikes a fence at rest, or a rigid
wall.

Everything but the contact law is linear, so that the gap and its rate at the end of a step are
affine in the force there: one scalar equation a step, whatever the number of modes.
"""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Fidelity
from ..model import FenceState, FlexibleLink, NormalState
from ..parts import AbstractContactLaw, DriveMotion
from ..scenes import Body, NormalScene
from . import newton, time_loop
from .fence_response import FenceResponse
from .observer import Observer
from .pad_response import PadResponse
from .step_control import Control, controlled
from .step_defect import ContactData, Ends
from .step_size import Clock, StepSize, stride_counts, units


class _Memory(NamedTuple):
    """The state between steps: the parcel's displacement [m] from first contact, `advance`, and its
    rate [m/s], the contact force [N] now and one step back, the fence, and under error control the
    length of steps."""

    advance: Array
    rate: Array
    force: Array
    force_before: Array
    fence: FenceState | None
    step_size: StepSize | None


class _Blow(NamedTuple):
    """The scalar equation of a step: N = law(gap - give N - c, rate - give_rate N - c'), with the
    compression c of the fence's cover under N, if it has one."""

    law: AbstractContactLaw
    viscosity: Array
    gap: Array
    rate: Array
    give: Array
    give_rate: Array
    pad: PadResponse | None

    def evaluate(self, unknowns):
        """Residual, its slope, the ratio of its size to the tolerated one, and gap, rate,
        unbalance."""
        (force,) = unknowns
        gap, rate = self.gap - self.give * force, self.rate - self.give_rate * force
        give, give_rate = self.give, self.give_rate
        if self.pad is not None:
            pressed, pressed_rate = self.pad.compression(force)
            gap, rate = gap - pressed, rate - pressed_rate
            pressed, pressed_rate = self.pad.compliance(force)
            give, give_rate = give + pressed, give_rate + pressed_rate
        law = self.law.force(gap, rate, self.viscosity)
        value = force - law.force
        slope = 1 + law.by_gap * give + law.by_rate * give_rate
        unbalance = jnp.abs(value)
        size = unbalance / (1e-9 * law.force + 1e-9)
        return (value,), [[slope]], size, (gap, rate, unbalance)

    def shorten(self, extra, change, last):
        """Always 1, as the residual is monotone."""
        return jnp.ones_like(self.gap)


def prepared(scene: NormalScene, fidelity: Fidelity) -> FlexibleLink | None:
    """The flexible link of the scene's fence; `None` without a fence, and for a rigid one without
    cover."""
    if scene.fence is None:
        return None
    if not (fidelity.mode_count or scene.fence.pad or scene.fence.shaft):
        return None
    return FlexibleLink(scene.fence, fidelity)


def run(
    scene: NormalScene,
    link: FlexibleLink | None,
    fidelity: Fidelity,
    observer: Observer,
    history: bool,
) -> tuple[Any, Any, Array, Array | None]:
    """Integrate m_p pddot = -N(D, Ddot), D = p - w(sigma), from p = 0, pdot = v_n, with the fence's
    deflection w in the direction of the blow; without a `link` w = 0.

    Returns the observer's record, the values that it saves at every sample if `history` is set, the
    start time 0 [s], and whether the steps' errors exceed the tolerated ones (`None` without error
    control).
    """
    steps = time_loop.count_steps(scene.duration, fidelity.step)
    fidelity = fidelity.replace(longest_stride=1)
    step = scene.duration / (steps * units(fidelity))
    zero = jnp.zeros_like(scene.parcel.mass + scene.speed)
    shape = maps = fence = None
    if link is not None:
        assert scene.distance is not None
        shape = link.shape(scene.distance)
        zero = zero + 0.0 * (link.mass_scale + link.reach + shape.place)
        maps = link.propagators([zero + step * count for count in stride_counts(fidelity)[1:]])
        fence = FenceState.unloaded(link, link.rest(), 1)
    clock = Clock(link, fidelity, zero, step, maps)
    size = None
    if fidelity.step_tolerance is not None:
        size = StepSize(zero, zero + 1, Control.start((None,), 0, zero))
    begin = _Memory(zero, scene.speed + zero, zero, zero, fence, size)
    reach = zero if link is None else link.reach
    given = (scene.parcel, link, shape, clock)
    advance_one = functools.partial(_step, fidelity)

    def advance(args, y, begins, ends):
        memory, record = y
        memory, state, length, unbalance = advance_one(args, memory, begins, ends)
        return memory, observer.update(record, state, length, unbalance)

    _, like, _, _ = jax.eval_shape(advance_one, given, begin, zero, zero)
    body = Body(reach, *(zero,) * 5)
    (memory, record), samples = time_loop.run_steps(
        advance,
        (begin, observer.begin(like, body)),
        given,
        (lambda y: observer.saved(y[1])) if history else None,
        steps,
        fidelity,
        clock,
    )
    return record, samples, zero, time_loop.unmet(memory)


def _step(fidelity: Fidelity, given, memory: _Memory, begins: Array, ends: Array):
    """The memory after one step, the scene's state there, the step's length [s] and the force by
    which its equation is out of balance [N]."""
    parcel, link, shape, clock = given
    stride = clock.stride(ends - begins)
    h = stride.length
    share = h / parcel.mass
    gap = memory.advance + h * memory.rate - h * share * memory.force / 3
    rate = memory.rate - 0.5 * share * memory.force
    give, give_rate, fence, pad = h * share / 6, 0.5 * share, None, None
    if link is not None:
        assert memory.fence is not None
        still = DriveMotion(*(jnp.zeros_like(gap),) * 3)
        fence = FenceResponse(link, stride, still, memory.fence, (memory.force,), (shape,))
        deflection, deflection_rate, _ = fence.deflection(0, (jnp.zeros_like(gap),))
        yields, yields_rate = fence.bending_compliance(0, 0)
        gap, rate = gap + deflection, rate + deflection_rate
        give, give_rate = give + yields, give_rate + yields_rate
        pad = fence.pads[0] if fence.pads else None
    law = parcel.contact_law
    blow = _Blow(law, law.viscosity(parcel.mass), gap, rate, give, give_rate, pad)
    ratio = 1.0
    if memory.step_size is not None:
        ratio = (ends - begins) / jnp.maximum(memory.step_size.last, 1.0)
    guess = (jnp.maximum(memory.force + ratio * (memory.force - memory.force_before), 0.0),)
    (force,), (gap, rate, unbalance) = newton.solve(
        _Blow.evaluate, _Blow.shorten, blow, guess, clock.iterations
    )
    fence_after = None if fence is None else fence.state((force,))
    size = None
    if memory.step_size is not None:
        tolerance = fidelity.step_tolerance
        assert tolerance is not None
        proposed = StepSize(ends - begins, jnp.full_like(ends, clock.unit))
        now = (Ends(force, gap, rate),)
        size = controlled(
            ContactData(law, blow.viscosity, parcel.mass), tolerance, clock,
            memory.step_size.control, proposed, ends, stride, now, fence, memory.fence, fence_after,
        )
    after = _Memory(
        advance=memory.advance + h * memory.rate - h * share * (memory.force / 3 + force / 6),
        rate=memory.rate - 0.5 * share * (memory.force + force),
        force=force,
        force_before=memory.force,
        fence=None if fence_after is None else fence_after.kept(),
        step_size=size,
    )
    state = NormalState(clock.time(ends), after.advance, after.rate, force, gap, rate, fence_after)
    return after, state, h, unbalance
