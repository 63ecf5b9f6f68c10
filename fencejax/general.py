"""Integration by a general solver of diffrax: slower by far, and an independent check."""

import diffrax
import jax
import jax.numpy as jnp
from jaxtyping import Array

from . import tally
from .clock import Clock
from .explicit import at_state
from .instant import Instant, describe
from .integrate import adjoint
from .kinematics import Body
from .link import Vibration
from .mechanics import Mechanics
from .tally import Tally


def run(
    mechanics: Mechanics,
    clock: Clock,
    body: Body,
    vibration: Vibration | None,
    steps: int,
) -> tuple[Tally, Instant, Array]:
    """Integrate a scene as a plain ordinary differential equation by a solver of diffrax.

    Every mode is a state (all of them: the full finite-element model), the contact force follows
    from the state, and the foot of each corner is found anew; modes left out do not yield. The
    samples are those at every
    `step`; peaks and integrals are taken from them. The last value returned is whether the solver
    came through.
    """
    fidelity = mechanics.fidelity
    link = mechanics.link

    def drive_at(time):
        return None if mechanics.drive is None else mechanics.drive.motion(clock.start + time)

    # Traced once, however often the stages and their Jacobians look at it.
    @jax.jit
    def field(time, y, args):
        del args
        body, vibration = y
        forces, fence = at_state(mechanics, body, vibration, drive_at(time))
        moved = Body._make((*body[3:], *forces.acceleration))
        if link is None or fence is None:
            return moved, None
        return moved, Vibration(vibration.rate, link.acceleration(vibration, fence.modal_force))

    times = clock.step * jnp.arange(steps + 1, dtype=body.x.dtype)
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
        # A state that is not a number is refused at every length: it ends at the shortest step.
        stepsize_controller=diffrax.PIDController(
            rtol=tolerance, atol=1e-3 * tolerance, dtmin=1e-12, force_dtmin=False
        ),
        adjoint=adjoint(fidelity),
        max_steps=500_000,
        throw=False,
    )

    def sample(time, y):
        body, vibration = y
        forces, fence = at_state(mechanics, body, vibration, drive_at(time))
        return describe(mechanics, time, body, forces, fence)

    samples = jax.vmap(sample)(times, solution.ys)
    reach = None if link is None else link.reach
    scope = tally.Scope(reach, bool(mechanics.sides), fidelity.smoothing)
    one = jax.tree.map(lambda x: x[0], samples)

    def take(tallied, numbered):
        instant, length = numbered
        return tally.add(tallied, instant, length, jnp.zeros_like(length), scope), None

    lengths = jnp.full_like(times, clock.step).at[0].set(0.0)
    tallied, _ = jax.lax.scan(take, tally.empty(one, body, alike=True), (samples, lengths))
    done = (solution.result == diffrax.RESULTS.successful).astype(times.dtype)
    return tallied, samples, done
