"""First-order descent: any transformation of optax on the augmented Lagrangian.

Each evaluation gives the whole Jacobian, and with it the gradient of the augmented Lagrangian for
any multipliers. optax turns that gradient into a step. At every step the multipliers change, too,
by a share of the change that the method of multipliers prescribes. A step so needs one evaluation,
and the same descent works where every evaluation is of another random sample.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import optax

from .lagrangian import (
    Evaluation,
    Multipliers,
    Vector,
    augmented,
    projected,
    residual,
    shortfall,
    updated,
)

Evaluate = Callable[[Vector], Evaluation | None]

# A step shorter than this is rounding; so many steps in a row that do not move end a run.
_SHORTEST, _IDLE = 1e-10, 1000


class FirstOrder:
    """The state of a descent: that of the optax transformation, and the multipliers.

    With u the transformation's update for the gradient of the augmented Lagrangian L at z_k,

        z_{k+1} = P(z_k + u(grad L)),   y_{k+1} = y_k + share (Y(z_k, y_k) - y_k),

    with P the projection onto [0, 1] where z are shares, y the multipliers and Y those of the
    method of multipliers (`updated`).
    """

    def __init__(
        self,
        transform: optax.GradientTransformation,
        multipliers: Multipliers,
        *,
        penalty: float = 10.0,
        bounded: bool = True,
        share: float = 0.03,
    ):
        """**Arguments:**

        - `transform`: any one whose update needs no function to call: a line search of optax
          needs one, `optax.lbfgs(linesearch=None)` does not.
        - `multipliers`: those at the start.
        - `penalty`: rho.
        - `bounded`: whether z are shares in [0, 1].
        - `share`: of the multipliers' change that is made at a step [1]. If the multipliers change
          faster than the transformation's memory of some ten to thirty steps, the descent circles
          round the optimum; for runs of a few steps a tenth is better.
        """
        self.multipliers, self.penalty = multipliers, penalty
        self.bounded, self.share = bounded, share
        full = optax.with_extra_args_support(transform)
        self._init, self._state = full.init, None
        self._update = jax.jit(lambda g, state, z, value: full.update(
            g, state, z, value=value, grad=g
        ))  # fmt: skip

    def step(self, at: Evaluation) -> Vector:
        """The next point. Raises `ValueError` for a transformation that needs more than
        gradient and value."""
        value, gradient = augmented(at, self.multipliers, self.penalty)
        # optax mixes widths of integers, which a session with strict promotion refuses.
        with jax.numpy_dtype_promotion("standard"):
            if self._state is None:
                self._state = self._init(jnp.asarray(at.point))
            try:
                change, self._state = self._update(
                    jnp.asarray(gradient), self._state, jnp.asarray(at.point), value
                )
            except TypeError as error:
                raise ValueError(
                    "Argument `method` must be a transformation that needs the gradient and the "
                    f"value alone, but optax says: {error}. Write, for example, optax.adam(1e-2)."
                ) from error
        new = updated(at, self.multipliers, self.penalty)
        self.multipliers = Multipliers(*(
            old + self.share * (aim - old) for old, aim in zip(self.multipliers, new, strict=True)
        ))  # fmt: skip
        point = at.point + np.asarray(change, dtype=float)
        point = np.clip(point, 0.0, 1.0) if self.bounded else point
        if np.array_equal(point, at.point):
            # A quasi-Newton method learns from changes, and never moves again after one of 0.
            self._state = None
        return point

    def run(
        self, evaluate: Evaluate, at: Evaluation, tolerance: float, feasibility: float
    ) -> tuple[Evaluation, str]:
        """Step until the conditions of Karush, Kuhn and Tucker hold within the tolerance.

        Returns the last point and the outcome: `"optimal"`, `"spent"` where `evaluate` returns
        `None`, `"stalled"` where the point no longer moves, `"infeasible"` where the violation is
        stationary. `multipliers` are then those at that point. A step to a point that cannot be
        evaluated is halved.
        """
        idle = 0
        while True:
            for multipliers in (self.multipliers, updated(at, self.multipliers, self.penalty)):
                left = residual(at, multipliers, self.bounded)
                if max(left[:2]) <= tolerance and left.violation <= feasibility:
                    self.multipliers = multipliers
                    return at, "optimal"
            if at.violation > feasibility:
                value, gradient = shortfall(at)
                if projected(at.point, gradient, self.bounded) <= tolerance * np.sqrt(value):
                    return at, "infeasible"
            step = self.step(at) - at.point
            if not np.all(np.isfinite(step)):
                return at, "stalled"
            trial: Evaluation | None = at
            while np.max(np.abs(step)) > _SHORTEST:
                trial = evaluate(at.point + step)
                if trial is None:
                    return at, "spent"
                if not trial.failed:
                    break
                step = 0.5 * step
            # A point pressed against its bounds stays while the multipliers still change.
            idle = idle + 1 if trial is at or trial.failed else 0
            if idle > _IDLE:
                return at, "stalled"
            at = at if trial.failed else trial
