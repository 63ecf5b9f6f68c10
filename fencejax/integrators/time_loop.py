"""Integration by this package's own solver, in loops of its own.

Its clock counts steps, so that times are exact and the same for every lane of a batch whatever the
lane's own start time. Where all steps have one length their number is known beforehand, and a plain
scan runs them. Where steps have several lengths, a loop runs until the last sample is reached. The
step can be run by diffrax as well (`as_diffrax`).
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

from .. import _check
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
        """The scene as a whole. The solver needs no vector field; where diffrax evaluates one, it
        gets the state itself."""

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
    """Run over `steps` steps, after a first one of length 0.

    **Arguments:**

    - `advance`: the one-step map `(args, y, t0, t1) -> y`; times are counted in steps.
    - `begin`: the state before anything; all its leaves are floating-point scalars or vectors.
    - `sample`: the part of a state to keep at each step, or `None`.
    - `clock`: where its steps have several lengths, the state is a pair of a memory and a record;
      `memory.step_size` has the length of the next step and whether the last one is accepted.

    Returns the last state and the samples: `steps` + 1 of them, the last one repeated where longer
    steps have left room.

    Raises `ValueError` where the samples do not fit into this machine's memory.
    """
    precision = jax.tree.leaves(begin)[0].dtype
    shapes = None
    if sample is not None:
        shapes = jax.eval_shape(sample, begin)
        columns = sum(leaf.size for leaf in jax.tree.leaves(shapes))
        _check.room(
            "step", steps + 1, columns, what="samples",
            remedy="Raise `step`, or write history=False.",
        )  # fmt: skip

    def strict(tree):
        return jax.tree.map(lambda leaf: leaf.astype(precision), tree)

    def trip(y, given):
        begins, ends, args = given
        return strict(advance(args, y, begins, ends))

    def step(y, begins, ends):
        return trip(y, (begins, ends, args))

    # All numbers of a step go into one row: with several buffers, XLA makes one kernel that writes
    # each buffer as a whole at every step.
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
    return y, _unpacked(rows, shapes)


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
    """The state after a trial under error control, and whether the trial is accepted. Where it is
    rejected, this is the `old` state with the next step's length."""
    accepted = new[0].step_size.control.accepted > 0
    memory, record = jax.tree.map(lambda a, b: jnp.where(accepted, b, a), old, new)
    size = memory.step_size._replace(next=new[0].step_size.next)
    return (memory._replace(step_size=size), record), accepted


def _run_adaptively(step, begin, clock: Clock, row, steps: int, reverse: bool):
    first = jax.tree.leaves(begin)[0]
    zero = jnp.zeros_like(first)
    # The loop makes the counters below one a lane; they are so from the start, as the types of its
    # carry must not change.
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
            # A step that is no sample writes into an extra row that is never read: reverse mode
            # would give every write into a row the derivative of that row, not the last write
            # alone.
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
    """Whether the errors of the steps before a memory exceed those that error control tolerates."""
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
    """Integrate a scene by the package's own solver. Returns the observer's record, the values that
    it saves at every sample if `history` is set, and whether the steps' errors exceed the tolerated
    ones (`None` without error control)."""
    # Traced once, however often the loop and the transformations around it call the step.
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
