"""The error of a result, estimated by the spread between neighbouring fidelities."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Fidelity
from ..scenes import NormalScene, Scene
from .error_estimate import ErrorEstimate
from .measures import ESTIMATED, MEASURES
from .result import Result

# With this factor 95 % of the components and norms of gradients of 200 random impacts are within
# their estimates, in seven numbers, at `fast` (`test_calibration_of_gradients` in
# tests/results/test_error_estimate.py); at `standard` more are. Errors that are controlled step by
# step go with the tolerance in the mean, and by jumps in each scene. The factors of values are in
# `fencejax.results.measures`.
_GRADIENT_SAFETY = 8.0
# Relative error of a value by geometries other than the paper's chords in a bad case. The spread
# between fidelities does not include it, as chords take three times as long in a batch.
_GEOMETRY = 5e-4


def coarser(fidelity: Fidelity, smoothing: float = 1.0) -> Fidelity:
    """A fidelity whose difference from `fidelity` measures its error, at half as many steps.

    It has twice the step, four times the tolerance of its defect (with a general integrator: ten
    times the tolerance) and three quarters of the modes. Below two modes, and below 20 elements, it
    has more of them, and in place of the geometry `"small"` it has `"arc"`. Friction is smoothed
    over `smoothing` [1] times the speed.
    """
    count = fidelity.mode_count
    fewer = 3 * count // 4 if count > 1 else count + 1
    geometry = "arc" if fidelity.geometry == "small" else fidelity.geometry
    coarse = fidelity.replace(
        modes=fewer, elements=max(20, fidelity.elements), geometry=geometry
    )
    if fidelity.integrator == "modal":
        coarse = coarse.replace(step=2 * fidelity.step)
        if fidelity.step_tolerance is not None:
            coarse = coarse.replace(step_tolerance=4 * fidelity.step_tolerance)
    else:
        coarse = coarse.replace(tolerance=10 * fidelity.tolerance)
    return coarse.replace(
        slip_speed=smoothing * fidelity.slip_speed,
        static_speed=smoothing * fidelity.static_speed,
    )


def companions(fidelity: Fidelity) -> tuple[Fidelity, Fidelity]:
    """The two fidelities, A and B, whose spread from `fidelity` measures its error: a coarser one,
    and that with friction smoothed over four times the speed."""
    return coarser(fidelity), coarser(fidelity, smoothing=4.0)


def _spread(value: Array, coarse: Array, smooth: Array) -> Array:
    return jnp.abs(value - coarse) + 0.5 * jnp.abs(coarse - smooth)


@functools.partial(jax.jit, static_argnames=("share", "step"))
def _combine(values, coarse, smooth, share: float, step: float):
    """Estimates by name, of at least `share` of the value, or of at least `step` [s]."""
    errors = {}
    for name, value in values.items():
        spread = _spread(value, coarse[name], smooth[name])
        factor = MEASURES[name].error_factor
        assert factor is not None
        error = factor * spread
        # Round-off of some hundred steps, for a spread that happens to vanish.
        least = max(share, 64 * float(jnp.finfo(value.dtype).eps)) * jnp.abs(value)
        error = error + (step if MEASURES[name].moment else least)
        known = jnp.isnan(value) | jnp.isfinite(spread)
        errors[name] = jnp.where(known, error, jnp.inf)
    return errors


def estimate(
    run: Callable[[Scene | NormalScene, Fidelity, bool, tuple[str, ...]], Result],
    scene: Scene | NormalScene,
    fidelity: Fidelity,
    result: Result,
) -> ErrorEstimate:
    """The error of a result at `fidelity`, from two more runs.

    `run(scene, fidelity, history, only)` returns a result with the fields named in `only`. Measures
    that `result` lacks have no estimate. A scene without friction needs only one more run.
    """
    values = {name: result.measures[name] for name in ESTIMATED if name in result.measures}
    scene, values = jax.lax.stop_gradient((scene, values))
    only = tuple(sorted((*values, "status")))
    first, second = companions(fidelity)
    coarse = run(scene, first, False, only)
    smooth = run(scene, second, False, only) if _has_friction(scene) else coarse
    others = ({name: r.measures[name] for name in values} for r in (coarse, smooth))
    bends = isinstance(scene, Scene) and scene.fence is not None
    share = _GEOMETRY if bends and fidelity.geometry != "chord" else 0.0
    found = _combine(values, *others, share, fidelity.step)
    return ErrorEstimate(found)


def _has_friction(scene: Scene | NormalScene) -> bool:
    """Whether there is dry friction in the scene."""
    if isinstance(scene, NormalScene):
        return False
    surfaces = [part for part in (scene.border, *scene.surfaces) if part is not None]
    frictions = (scene.fence_friction, *(surface.friction for surface in surfaces))
    return scene.belt is not None or any(friction is not None for friction in frictions)


class GradientEstimate(NamedTuple):
    """A gradient with an estimate of its error.

    - `value`, `value_error`: of the function, in its unit.
    - `gradient`, `gradient_error`: leaves like those of the argument, in the function's unit over
      the leaf's; the errors are absolute.
    - `relative`: the error's elasticities over the gradient's, |x dg| / |x g| [1].

    >>> found = fj.estimate_gradient_error(lambda x, fidelity: x**2, 3.0)
    >>> float(found.value), float(found.gradient), float(found.relative)
    (9.0, 6.0, 0.0)
    """

    value: Array
    value_error: Array
    gradient: Any
    gradient_error: Any
    relative: Array


def estimate_gradient_error(
    function: Callable[[Any, Fidelity], Array], x: Any, *, fidelity: Fidelity | None = None
) -> GradientEstimate:
    """A function's gradient at `fidelity`, with its error from that at two companions.

    As in `ErrorEstimate`, with g the gradient, component by component,

    e = 8 (|g - g_A| + |g_A - g_B| / 2),

    a cautious bound: several times the true error in most scenes, so that it covers that in nearly
    all, in each component and in the norm.

    Three gradients, the second and third of half the steps: about twice the cost of one. Works
    inside `jax.jit` and `jax.vmap`.

    **Arguments:**

    - `function`: (x, fidelity) -> scalar, by way of `simulate(..., fidelity=fidelity)`.
    - `x`: a pytree of floating-point arrays.
    - `fidelity`: default `Fidelity.standard()`.

    Raises `TypeError` where the fidelity is none.

    >>> def force(speed, fidelity):
    ...     scene = fj.scenes.rigid_wall(speed=speed)
    ...     return fj.simulate(scene, fidelity=fidelity, only="peak_force").peak_force
    >>> found = fj.estimate_gradient_error(force, 2.0)
    >>> print(f"{found.gradient:.0f} N s/m")
    1895 N s/m
    """
    fidelity = Fidelity.standard() if fidelity is None else fidelity
    if not isinstance(fidelity, Fidelity):
        raise TypeError(
            f"Argument `fidelity` must be a `fencejax.Fidelity`, but is {fidelity!r}. Write, for "
            "example, fidelity=fj.Fidelity.fast()."
        )
    (value, gradient), coarse, smooth = (
        jax.value_and_grad(functools.partial(_at, function, other))(x)
        for other in (fidelity, *companions(fidelity))
    )
    value_error = _GRADIENT_SAFETY * _spread(value, coarse[0], smooth[0])
    errors = jax.tree.map(
        lambda *g: _GRADIENT_SAFETY * _spread(*g), gradient, coarse[1], smooth[1]
    )
    relative = jnp.sqrt(_square(x, errors) / _square(x, gradient))
    return GradientEstimate(value, value_error, gradient, errors, relative)


def _at(function, fidelity: Fidelity, x: Any) -> Array:
    return function(x, fidelity)


def _square(x: Any, gradient: Any) -> Array:
    """Squared norm of p dq/dp over all leaves."""
    products = jax.tree.map(lambda p, g: jnp.sum((p * g) ** 2), x, gradient)
    return functools.reduce(jnp.add, jax.tree.leaves(products))
