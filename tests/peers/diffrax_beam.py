"""Plain diffrax: an adaptive, stiff solver of its own on the full finite-element system.

The state is (eta, eta', D, D') with the penetration as a coordinate, as in `casadi_beam`; diffrax
factorises the dense Jacobian.

Settings found by halving and doubling:

- Kvaerno3 where 1e-4 is asked for, Kvaerno5 at 5e-7.
- Samples by `SaveAt(ts=...)` are interpolated by the solver's third-order dense output: the step
  near the peak, not their number, limits them.
- Gradient by `jacfwd` through `ForwardMode`: five tangents share the steps and the factorisation.
  The default reverse mode takes twice as long.
- The adaptive gradient converges far more slowly than its value.
"""

from typing import NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from . import race


class Settings(NamedTuple):
    """solver. value, gradient: rtol of the two runs; atol is a tenth of it. samples: of the
    force."""

    solver: type
    value: float
    gradient: float
    samples: int


SETTINGS = {
    (race.ENGINEERING.name, None): Settings(diffrax.Kvaerno3, 5e-5, 4e-5, 251),
    (race.TIGHT.name, None): Settings(diffrax.Kvaerno5, 1e-7, 2e-8, 251),
}


def _run(parameters, modes, solver, tolerance, time, adjoint):
    """N [N] at the times of the grid."""
    thickness, modulus, density, beta, length = parameters
    rate = modulus * thickness**2 / (12 * density * length**4)
    square = rate * modes.eigenvalues
    load = modes.shape / jnp.sqrt(density * race.WIDTH * thickness * length)

    def force(state):
        _, _, depth, closing = state
        law = race.VISCOSITY * closing * depth**2 + race.STIFFNESS * depth**4
        return jnp.where(depth > 0, jnp.maximum(law, 0.0), 0.0)

    def field(_, state, __):
        amplitude, speed, _, closing = state
        contact = force(state)
        acceleration = load * contact - beta * square * speed - square * amplitude
        away = -contact / race.MASS - load @ acceleration
        return speed, acceleration, closing, away

    rest = jnp.zeros(modes.shape.size)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(field),
        solver(),
        t0=0.0,
        t1=race.DURATION,
        dt0=1e-5,
        y0=(rest, rest, jnp.zeros(()), jnp.asarray(race.SPEED)),
        saveat=diffrax.SaveAt(ts=jnp.asarray(time)),
        stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=0.1 * tolerance),
        adjoint=adjoint,
        max_steps=200_000,
    )
    return jax.vmap(force)(solution.ys)


def make(accuracy, modes=None):
    """diffrax at `accuracy`; `modes` kept of the 40, all by default."""
    settings = SETTINGS[accuracy.name, modes]
    kept = race.unit_modes(modes)
    time = np.linspace(0.0, race.DURATION, settings.samples)

    @jax.jit
    def history(parameters):
        return _run(
            parameters,
            kept,
            settings.solver,
            settings.value,
            time,
            diffrax.RecursiveCheckpointAdjoint(),
        )

    @jax.jit
    def history_and_slopes(parameters):
        def both(p):
            forces = _run(
                p, kept, settings.solver, settings.gradient, time, diffrax.ForwardMode()
            )
            return forces, forces

        slopes, forces = jax.jacfwd(both, has_aux=True)(parameters)
        return forces, slopes

    def value(parameters):
        return race.refined_peak(time, np.asarray(history(jnp.asarray(parameters))))

    def value_and_gradient(parameters):
        forces, slopes = history_and_slopes(jnp.asarray(parameters))
        peak, at = race.refined_peak(time, np.asarray(forces))
        first, weights = race.interpolation(time, at)
        return peak, weights @ np.asarray(slopes)[first : first + 9]

    kind = "full" if modes is None else f"{modes} modes"
    name = f"diffrax {settings.solver.__name__}, {kind}"
    return race.Peer(name, diffrax.__version__, value, value_and_gradient)
