"""Integration by this package's own solver: a step that diffrax could take too, stepped by hand.

Its clock counts steps, so that it is exact and the same for every lane of a batch whatever the
lane's own start time. Where all steps are of one length their number is known beforehand, and a
plain scan runs them; where free flight is taken in longer ones, a loop that ends when the last
sample is reached. The private types that diffrax asks of a solver are met here and nowhere else.
"""

import itertools
import math
from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar

import equinox.internal as eqxi
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..derivatives import complete, one_a_lane
from ..fidelity import Fidelity
from ..model import Mechanics
from . import modal_step
from .observer import Observer
from .step_memory import Memory
from .step_size import Clock, is_whole


def as_diffrax(advance: Callable[[Any, Any, Any, Any], Any]) -> tuple[Any, Any]:
    """A one-step map `advance(args, y, t0, t1) -> y` as a term and a solver of second order for
    `diffrax.diffeqsolve`; times are counted in steps."""
    import diffrax

    class Scene(diffrax.AbstractTerm):
        """The scene as a whole. The solver knows its structure and asks for no vector field: what
        diffrax wants to see of one is the state itself."""

        def vf(self, t, y, args):
            return y

        def contr(self, t0, t1, **kwargs):
            return t1 - t0

        def prod(self, vf, control):
            return vf

    class Stepper(diffrax.AbstractSolver):
        term_structure: ClassVar = Scene
        interpolation_cls: ClassVar = diffrax.LocalLinearInterpolation

        def order(self, terms):
            return 2

        def init(self, terms, t0, t1, y0, args):
            return None

        def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
            # Whole steps: diffrax's own sums of times may be off by a last digit.
            y1 = advance(args, y0, jnp.round(t0), jnp.round(t1))
            return y1, None, dict(y0=y0, y1=y1), None, diffrax.RESULTS.successful

        def func(self, terms, t0, y0, args):
            return terms.vf(t0, y0, args)

    return Scene(), Stepper()


def count_steps(duration: float, step: float) -> int:
    """Number of steps over `duration` [s], none longer than `step` [s]."""
    return max(1, round(duration / step + 0.5 - 1e-9))


def run_steps(
    advance: Callable[[Any, Any, Any, Any], Any],
    begin,
    args,
    sample,
    steps: int,
    fidelity: Fidelity,
    clock: Clock | None = None,
):
    """Run over `steps` steps, from a first one of no length.

    **Arguments:**

    - `advance`: the one-step map `(args, y, t0, t1) -> y`; times are counted in steps.
    - `begin`: the state before anything; all its leaves are floating-point scalars or vectors.
    - `sample`: what of a state to keep at each step, or `None`.
    - `clock`: where its steps are of several lengths, the state is a pair of a memory and a record,
      and `memory.step_size` says how long the next step is to be and whether the last one is good.

    Returns the last state and the samples: `steps` + 1 of them, the last one repeated where longer
    steps have left room.
    """
    precision = jax.tree.leaves(begin)[0].dtype

    def strict(tree):
        return jax.tree.map(lambda leaf: leaf.astype(precision), tree)

    def trip(y, given):
        begins, ends, args = given
        return strict(advance(args, y, begins, ends))

    def step(y, begins, ends):
        return trip(y, (begins, ends, args))

    # One row of numbers a step: XLA fuses several buffers into one kernel, which then writes all of
    # them out anew at every step.
    def row(y):
        leaves = [] if sample is None else jax.tree.leaves(sample(y))
        return jnp.concatenate([jnp.ravel(leaf) for leaf in leaves]) if leaves else None

    reverse = fidelity.gradient == "reverse"
    one = jnp.ones((), precision)
    begin, given = strict(begin), (one, one, args)
    begin = complete(begin, trip, given) if reverse else one_a_lane(begin, given)
    if clock is None or clock.counts[-1] == 1:
        ends = jnp.arange(steps + 1, dtype=precision)

        def next_step(y, end):
            y = step(y, jnp.maximum(end - 1, 0.0), end)
            return y, row(y)

        scan = partial(eqxi.scan, kind="checkpointed") if reverse else jax.lax.scan
        y, rows = scan(next_step, begin, ends)
    else:
        y, rows = _run_adaptively(step, begin, clock, row, steps, reverse)
    if sample is None or rows is None:
        return y, None
    return y, _unpacked(rows, sample(begin))


def _unpacked(rows: Array, like):
    """Columns of `rows`, of the structure and shapes of `like` at every row."""
    leaves, structure = jax.tree.flatten(like)
    ends = itertools.accumulate(leaf.size for leaf in leaves)
    parts = [
        rows[:, end - leaf.size : end].reshape(-1, *leaf.shape)
        for leaf, end in zip(leaves, ends, strict=True)
    ]
    return jax.tree.unflatten(structure, parts)


def _checkpoints(steps: int, unit: int) -> int:
    """Number of states that reverse mode keeps. With c of them, (c + 1)(c + 2) / 2 trials are
    computed again once; more trials are computed again more often (Stumm and Walther, New
    algorithms for optimal online checkpointing, SIAM Journal on Scientific Computing 32(2), 2010).
    It is enough for eight trials a step where steps are of several lengths; they may be more."""
    trials = (steps + 1) * (1 if unit == 1 else 8)
    return max(1, math.ceil(math.sqrt(2 * trials + 0.25) - 1.5))


def _settled(old, new):
    """The state after a trial under error control, which is the `old` one but for the next step's
    length where the trial is rejected, and whether it is accepted."""
    accepted = new[0].step_size.control.accepted > 0
    memory, record = jax.tree.map(lambda a, b: jnp.where(accepted, b, a), old, new)
    size = memory.step_size._replace(next=new[0].step_size.next)
    return (memory._replace(step_size=size), record), accepted


def _run_adaptively(step, begin, clock: Clock, row, steps: int, reverse: bool):
    first = jax.tree.leaves(begin)[0]
    zero = jnp.zeros_like(first)
    # The counters below are one a lane as soon as their loop has begun: so they are from the start.
    if not reverse:
        zero = one_a_lane(zero, first)
    unit, total = clock.unit, steps * clock.unit

    def ahead(y, now):
        count = y[0].step_size.next
        least = jnp.minimum(count, float(unit))
        return jnp.where(now < 0, 1.0, jnp.where(now + count <= total, count, least))

    def go_on(carry):
        return carry[1] < total

    def trip(carry):
        y, now, taken, saved = carry
        end = jnp.minimum(now + ahead(y, now), total)
        new = step(y, jnp.maximum(now, 0.0), end)
        went = 1.0
        if new[0].step_size.control is not None:
            new, accepted = _settled(y, new)
            end = jnp.where(accepted, end, now)
            went = jnp.where(accepted & is_whole(end, unit), 1.0, 0.0)
        if saved is not None:
            # What is no sample goes into a last row that nobody reads: reverse mode gives every
            # write into a row the derivative of that row, not of the last write alone.
            place = jnp.where(went > 0, taken, steps + 1.0)
            saved = saved.at[place.astype(jnp.int32)].set(row(new))
        return new, end, taken + went, saved

    like = row(begin)
    saved = None if like is None else jnp.zeros((steps + 2, like.size), like.dtype)
    carry = (begin, zero - 1, zero, saved)
    if saved is None and not reverse:
        return jax.lax.while_loop(go_on, trip, carry)[0], None
    y, _, taken, saved = eqxi.while_loop(
        go_on,
        trip,
        carry,
        buffers=lambda carry: carry[3],
        kind="checkpointed" if reverse else "lax",
        checkpoints=_checkpoints(steps, unit),
    )
    if saved is None:
        return y, None
    places = jnp.minimum(jnp.arange(steps + 1, dtype=jnp.int32), taken.astype(jnp.int32) - 1)
    return y, saved[places]


def unmet(memory: Any) -> Array | None:
    """Whether the steps that led to a memory missed more than the error control tolerates."""
    size = memory.step_size
    return None if size is None or size.control is None else size.control.unmet


def modal(
    mechanics: Mechanics,
    clock: Clock,
    begin: Memory,
    steps: int,
    observer: Observer,
    history: bool,
) -> tuple[Any, Any, Array | None]:
    """Integrate a scene by the package's own solver. Returns the observer's record, if asked for
    what it saved at every sample, and whether the steps missed more than is tolerated (`None`
    without error control)."""
    # Traced once, however often the loop and the transformations around it look at the step.
    step = jax.jit(modal_step.step)

    def advance(args, y, begins, ends):
        mechanics, clock = args
        memory, record = y
        memory, state, length, unbalance = step(mechanics, clock, memory, begins, ends)
        return memory, observer.update(record, state, length, unbalance)

    zero = jnp.zeros_like(clock.start)
    _, like, _, _ = jax.eval_shape(step, mechanics, clock, begin, zero, zero)
    (memory, record), samples = run_steps(
        advance,
        (begin, observer.begin(like, begin.body)),
        (mechanics, clock),
        (lambda y: observer.saved(y[1])) if history else None,
        steps,
        mechanics.fidelity,
        clock,
    )
    return record, samples, unmet(memory)
