"""Integration through diffrax by this package's own solver.

diffrax's clock counts steps, so that it is exact and the same for every lane of
a batch whatever the lane's own start time. The private types that diffrax asks of a solver are
met here and nowhere else.
"""

import functools
from collections.abc import Callable
from typing import Any, ClassVar

import diffrax
import jax
import jax.numpy as jnp

from . import modal_step, tally
from .clock import Clock
from .fidelity import Fidelity
from .instant import Instant
from .mechanics import Mechanics
from .tally import Tally


class _Steps(diffrax.AbstractTerm):
    """The scene as a whole. The solver knows its structure and asks for no vector field: what
    diffrax wants to see of one is the state itself."""

    def vf(self, t, y, args):
        return y

    def contr(self, t0, t1, **kwargs):
        return t1 - t0

    def prod(self, vf, control):
        return vf


class _CountSteps(diffrax.AbstractStepSizeController):
    """Steps of length one, on a clock that counts them."""

    def wrap(self, direction):
        return self

    def init(self, terms, t0, t1, y0, dt0, args, func, error_order):
        return t0 + 1.0, None

    def adapt_step_size(
        self, t0, t1, y0, y1_candidate, args, y_error, error_order, controller_state
    ):
        return True, t1, t1 + 1.0, False, None, diffrax.RESULTS.successful


class Stepper(diffrax.AbstractSolver):
    """Wraps a one-step map `advance(args, y, index) -> y` as a diffrax solver of second order."""

    advance: Callable[[Any, Any, Any], Any]
    term_structure: ClassVar = _Steps
    interpolation_cls: ClassVar = diffrax.LocalLinearInterpolation

    def order(self, terms):
        return 2

    def init(self, terms, t0, t1, y0, args):
        return None

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        y1 = self.advance(args, y0, t0)
        return y1, None, dict(y0=y0, y1=y1), None, diffrax.RESULTS.successful

    def func(self, terms, t0, y0, args):
        return terms.vf(t0, y0, args)


def adjoint(fidelity: Fidelity) -> diffrax.AbstractAdjoint:
    """How diffrax's loop is to be differentiated."""
    if fidelity.gradient == "reverse":
        return diffrax.RecursiveCheckpointAdjoint()
    return diffrax.ForwardMode()


def count_steps(duration: float, step: float) -> int:
    """Number of steps over `duration` [s], none longer than `step` [s]."""
    return max(1, round(duration / step + 0.5 - 1e-9))


def run_steps(advance, begin, args, sample, steps: int, fidelity: Fidelity, history: bool):
    """Run `steps` steps of `advance` from `begin`; the last state, and `sample(y)` of each step."""
    precision = jax.tree.leaves(begin)[0].dtype
    strict = functools.partial(jax.tree.map, lambda leaf: leaf.astype(precision))
    begin = strict(begin)
    # Traced once, however often diffrax and the transformations around it look at the step.
    step = jax.jit(lambda args, y, index: strict(advance(args, y, index)))
    # diffrax's buffers hold arrays alone: parts that a scene does not hold are put back after.
    structure = jax.tree.structure(begin)
    sampled = jax.tree.structure(sample(begin))
    saves = [diffrax.SubSaveAt(t1=True, fn=lambda t, y, args: jax.tree.leaves(y))]
    if history:
        saves.append(diffrax.SubSaveAt(steps=True, fn=lambda t, y, _: jax.tree.leaves(sample(y))))
    solution = diffrax.diffeqsolve(
        _Steps(),
        Stepper(step),
        t0=jnp.zeros((), precision),
        t1=jnp.full((), steps, precision),
        dt0=None,
        y0=begin,
        args=args,
        saveat=diffrax.SaveAt(subs=saves),
        stepsize_controller=_CountSteps(),
        adjoint=adjoint(fidelity),
        max_steps=steps,
        throw=False,
    )
    assert solution.ys is not None
    last = jax.tree.unflatten(structure, [x[0] for x in solution.ys[0]])
    return last, jax.tree.unflatten(sampled, solution.ys[1]) if history else None


def join(first, rest):
    """Put the first sample before the others."""
    return jax.tree.map(lambda a, b: jnp.concatenate([jnp.asarray(a)[None], b]), first, rest)


def modal(
    mechanics: Mechanics, clock: Clock, start, steps: int, history: bool
) -> tuple[Tally, Instant | None]:
    """Integrate a scene by the package's own solver."""
    memory, instant = start
    reach = None if mechanics.link is None else mechanics.link.reach

    def advance(args, y, index):
        mechanics, clock = args
        memory, tallied = y
        memory, instant, defect = modal_step.step(mechanics, clock, memory, index)
        return memory, tally.add(tallied, instant, clock.step, reach, defect)

    begin = (memory, tally.begin(instant, reach))
    (_, tallied), samples = run_steps(
        advance,
        begin,
        (mechanics, clock),
        lambda y: y[1].last,
        steps,
        mechanics.fidelity,
        history,
    )
    return tallied, None if samples is None else join(instant, samples)
