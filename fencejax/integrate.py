"""Integration through diffrax: this package's own solver, and general ones as a check.

diffrax's clock counts steps in the first case, so that it is exact and the same for every lane of
a batch whatever the lane's own start time. The private types that diffrax asks of a solver are
met here and nowhere else.
"""

from collections.abc import Callable
from typing import Any, ClassVar

import diffrax
import jax
import jax.numpy as jnp
from jaxtyping import Array

from . import modal_step, tally
from .fidelity import Fidelity
from .instant import FenceState, Instant, describe
from .link import Vibration
from .mechanics import Body, Mechanics
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

    advance: Callable[[Any, Any, Array], Any]
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


def _adjoint(fidelity: Fidelity) -> diffrax.AbstractAdjoint:
    if fidelity.gradient == "reverse":
        return diffrax.RecursiveCheckpointAdjoint()
    return diffrax.ForwardMode()


def count_steps(duration: float, step: float) -> int:
    """Number of steps over `duration` [s], none longer than `step` [s]."""
    return max(1, round(duration / step + 0.5 - 1e-9))


def run_steps(advance, begin, args, sample, steps: int, fidelity: Fidelity, history: bool):
    """Run `steps` steps of `advance` from `begin`; the last state, and `sample(y)` of each step."""
    # Traced once, however often diffrax and the transformations around it look at the step.
    advance = jax.jit(advance)
    # diffrax's buffers hold arrays alone: parts that a scene does not hold are put back after.
    structure = jax.tree.structure(begin)
    sampled = jax.tree.structure(sample(begin))
    saves = [diffrax.SubSaveAt(t1=True, fn=lambda t, y, args: jax.tree.leaves(y))]
    if history:
        saves.append(diffrax.SubSaveAt(steps=True, fn=lambda t, y, _: jax.tree.leaves(sample(y))))
    solution = diffrax.diffeqsolve(
        _Steps(),
        Stepper(advance),
        t0=0.0,
        t1=float(steps),
        dt0=None,
        y0=begin,
        args=args,
        saveat=diffrax.SaveAt(subs=saves),
        stepsize_controller=_CountSteps(),
        adjoint=_adjoint(fidelity),
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
    mechanics: Mechanics, clock: modal_step.Clock, start, steps: int, history: bool
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


def general(
    mechanics: Mechanics,
    clock: modal_step.Clock,
    body: Body,
    vibration: Vibration | None,
    steps: int,
) -> tuple[Tally, Instant, Array]:
    """Integrate a scene as a plain ordinary differential equation by a solver of diffrax.

    Every mode is a state (all of them: the full finite-element model), the contact force follows
    from the state, and the foot of each corner is found anew. The samples are those at every
    `step`; peaks and integrals are taken from them. The last value returned is whether the solver
    came through.
    """
    fidelity = mechanics.fidelity
    link = mechanics.link

    def evaluate(time, body, vibration):
        drive = None if mechanics.drive is None else mechanics.drive.motion(clock.start + time)
        places, shapes, points = (), (), ()
        if link is not None:
            places = tuple(
                modal_step.foot(mechanics, body, number, vibration, drive)
                for number in mechanics.fence_corners
            )
            shapes = tuple(link.shape(place) for place in places)
            points = tuple(modal_step.fence_point(mechanics, s, vibration) for s in shapes)
        arms = mechanics.arms(body.angle)
        forces = mechanics.forces(body, arms, mechanics.frame(drive, places), points)
        if link is None:
            return forces, None
        normals = tuple(c.normal for c in forces.fence)
        load = modal_step.contact_load(
            shapes, normals, link.mass_scale, link.inertia_force(drive)
        )
        still = tuple(jnp.zeros_like(n) for n in normals)
        return forces, FenceState(drive, vibration, load, shapes, normals, still)

    def field(time, y, args):
        del args
        body, vibration = y
        forces, fence = evaluate(time, body, vibration)
        moved = Body(*body[3:], *forces.acceleration)
        if fence is None:
            return moved, None
        assert link is not None
        bent = tuple(
            f - c * v - k * q
            for f, c, v, k, q in zip(
                fence.modal_force,
                link.damping,
                vibration.rate,
                link.frequency_squared,
                vibration.amplitude,
                strict=True,
            )
        )
        return moved, Vibration(vibration.rate, bent)

    times = clock.step * jnp.arange(steps + 1, dtype=float)
    tolerance = fidelity.tolerance
    solvers = {"kvaerno5": diffrax.Kvaerno5, "tsit5": diffrax.Tsit5}
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(field),
        solvers[fidelity.integrator](),
        t0=times[0],
        t1=times[-1],
        dt0=1e-6,
        y0=(body, vibration),
        saveat=diffrax.SaveAt(ts=times),
        stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=1e-3 * tolerance),
        adjoint=_adjoint(fidelity),
        max_steps=500_000,
        throw=False,
    )

    def sample(time, y):
        forces, fence = evaluate(time, *y)
        return describe(mechanics, time, y[0], forces, fence)

    samples = jax.vmap(sample)(times, solution.ys)
    reach = None if link is None else link.reach
    first = jax.tree.map(lambda x: x[0], samples)
    rest = jax.tree.map(lambda x: x[1:], samples)

    def take(tallied, instant):
        zero = jnp.zeros_like(instant.time)
        return tally.add(tallied, instant, clock.step, reach, zero), None

    tallied, _ = jax.lax.scan(take, tally.begin(first, reach), rest)
    done = (solution.result == diffrax.RESULTS.successful).astype(times.dtype)
    return tallied, samples, done
